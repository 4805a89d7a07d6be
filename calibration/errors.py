"""Why something cannot be calibrated."""

from __future__ import annotations

from dialogue import TracksideError


class CalibrationError(TracksideError):
    """Measurements from which the parameters cannot be known."""
