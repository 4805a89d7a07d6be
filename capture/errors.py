"""What can go wrong with sessions, logs and the text files beside them."""

from __future__ import annotations

from dialogue import TracksideError


class CaptureError(TracksideError):
    """Root of this room's errors."""


class SessionError(CaptureError):
    """A folder that is not a session, is one already, or has a newer format than this program."""


class LogError(CaptureError):
    """A log that cannot be read or written: truncated, foreign encoding, disk full."""


class MissingStreamError(CaptureError, LookupError):
    """A session without the stream, truth or estimate that was asked for."""


class TextFileError(CaptureError, ValueError):
    """A trajectory or landmark file whose content is wrong; the text names file and line."""


class ConfigurationError(CaptureError, ValueError):
    """Faults of a YAML file, all at once, each as `file:line:column: key: message`."""


class CalibrationFileError(CaptureError):
    """A calibration that is not there, cannot be read, or would be overwritten."""
