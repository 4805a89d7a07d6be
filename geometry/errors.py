"""What can be wrong with a trajectory, a map or an alignment."""

from __future__ import annotations

from dialogue import TracksideError


class GeometryError(TracksideError, ValueError):
    """Values that do not make the geometric object they should."""


class TrajectoryError(GeometryError):
    """Stamps that do not increase, columns of unequal length, values that are not finite."""


class LandmarkMapError(GeometryError):
    """An id that appears twice, a position that is not finite, a covariance that is none."""


class AlignmentError(GeometryError):
    """Too few or coincident points: the rotation between them cannot be known."""


class CameraError(GeometryError):
    """Numbers that are no camera, or points from which its place cannot be known."""
