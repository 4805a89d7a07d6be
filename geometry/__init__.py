"""Planar poses, trajectories, landmark maps, their alignment, and the camera that looks at a floor.

Values and pure functions on numpy arrays; no file, no clock, no device. The few things that a path
in space needs (`SpacePath`, quaternions) live here too, so that a hand-held path can be scored.
"""

from geometry.alignment import alignment_from_first_pose, planar_umeyama, umeyama
from geometry.angles import Floats, circular_mean, wrap
from geometry.camera import Camera, View, at_height, looking_at
from geometry.circles import RingShape, apparent_centre, circle_centres, circle_outline
from geometry.errors import (
    AlignmentError,
    CameraError,
    GeometryError,
    LandmarkMapError,
    TrajectoryError,
)
from geometry.homography import (
    PoseFit,
    apply_homography,
    fit_homography,
    fit_planar_view,
    refine_view,
    turned,
)
from geometry.landmarks import LandmarkMap
from geometry.se2 import between, compose, inverse, rotate_covariance, transform_points
from geometry.space_path import SpacePath
from geometry.stereo import Mounting, StereoPair
from geometry.trajectory import Stamps, Trajectory, covers
from geometry.uncertainty import (
    INTRINSICS,
    camera_of,
    floor_covariance,
    intrinsics_of,
    view_jacobian,
)

__all__ = [
    "INTRINSICS",
    "AlignmentError",
    "Camera",
    "CameraError",
    "Floats",
    "GeometryError",
    "LandmarkMap",
    "LandmarkMapError",
    "Mounting",
    "PoseFit",
    "RingShape",
    "SpacePath",
    "Stamps",
    "StereoPair",
    "Trajectory",
    "TrajectoryError",
    "View",
    "alignment_from_first_pose",
    "apparent_centre",
    "apply_homography",
    "at_height",
    "between",
    "camera_of",
    "circle_centres",
    "circle_outline",
    "circular_mean",
    "compose",
    "covers",
    "fit_homography",
    "fit_planar_view",
    "floor_covariance",
    "intrinsics_of",
    "inverse",
    "looking_at",
    "planar_umeyama",
    "refine_view",
    "rotate_covariance",
    "transform_points",
    "turned",
    "umeyama",
    "view_jacobian",
    "wrap",
]
