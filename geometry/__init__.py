"""Planar poses, trajectories, landmark maps and the rigid alignment between them.

Values and pure functions on numpy arrays; no file, no clock, no device. The few things that a path
in space needs (`SpacePath`, quaternions) live here too, so that a hand-held path can be scored.
"""

from geometry.alignment import alignment_from_first_pose, planar_umeyama, umeyama
from geometry.angles import Floats, circular_mean, wrap
from geometry.errors import AlignmentError, GeometryError, LandmarkMapError, TrajectoryError
from geometry.landmarks import LandmarkMap
from geometry.se2 import between, compose, inverse, rotate_covariance, transform_points
from geometry.space_path import SpacePath
from geometry.trajectory import Stamps, Trajectory

__all__ = [
    "AlignmentError",
    "Floats",
    "GeometryError",
    "LandmarkMap",
    "LandmarkMapError",
    "SpacePath",
    "Stamps",
    "Trajectory",
    "TrajectoryError",
    "alignment_from_first_pose",
    "between",
    "circular_mean",
    "compose",
    "inverse",
    "planar_umeyama",
    "rotate_covariance",
    "transform_points",
    "umeyama",
    "wrap",
]
