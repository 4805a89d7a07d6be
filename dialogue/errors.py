"""The root of every error that trackside raises on purpose.

TracksideError
├── UsageError                 the words of the call are wrong (exit code 2)
├── geometry.GeometryError     values that are no trajectory, map or transform
├── capture.CaptureError       sessions, logs and text files
├── slam.SlamError             an estimate that cannot be made
├── tracking.TrackingError     pictures or markers that cannot be followed
└── scoring.ScoringError       a score that cannot be given
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class TracksideError(Exception):
    """What happened, to which file or device, what was expected, what to do next: in one text."""


class UsageError(TracksideError):
    """An option or a configuration value that cannot be used; the command ends with exit code 2."""


def nearest_names(name: str, valid: Iterable[str]) -> str:
    """A hint `did you mean 'x'?`, or the list of valid names when none is near."""
    names = sorted(valid)
    near = difflib.get_close_matches(name, names, n=1)
    if near:
        return f"did you mean {near[0]!r}?"
    return f"valid names: {', '.join(names)}"
