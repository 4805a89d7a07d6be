"""Why two recordings cannot be brought onto one clock."""

from __future__ import annotations

from calibration.errors import CalibrationError

EXCITE = (
    "begin and end each run with a figure of eight, or with a sharp start, stop and turn, all of "
    "it in the camera's picture"
)
"""What to do where the motion does not tell the clocks apart."""


class ClockError(CalibrationError):
    """Two recordings whose clocks cannot be told, or that contradict each other."""
