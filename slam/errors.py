"""Why an estimate cannot be made."""

from __future__ import annotations

from dialogue import TracksideError


class SlamError(TracksideError):
    """Root of this room's errors."""
