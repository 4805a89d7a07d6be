"""Why markers cannot be looked for."""

from __future__ import annotations

from dialogue import TracksideError


class TrackingError(TracksideError):
    """Root of this room's errors."""


class ImageError(TrackingError, ValueError):
    """A picture that is none, has the wrong type, or is not from the camera that was told."""
