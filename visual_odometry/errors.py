"""Why there is no visual odometry of a recording."""

from __future__ import annotations

from dialogue import TracksideError


class VisualOdometryError(TracksideError):
    """Pictures that do not fit the calibration, or of which none can be used."""
