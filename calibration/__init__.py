"""One module for each thing that is calibrated: measurements in, parameters and a verdict out.

The inside of a camera from pictures of a board, and its place above the floor from rings whose
distances were measured; of the car, from drives in sight of that camera: where its rings are
(`lever/`), what counts and servo mean (`odometry/`), where the lidar is (`lidar/`), and what its
IMU does (`imu/`). What comes out is a dated file (`capture.KINDS`) that says how it was made, what
was left over, and whether to trust it.
"""

from calibration.board import Board, BoardSighting
from calibration.camera import CameraLimits, CameraResult, Sightings, calibrate_camera
from calibration.charuco import CharucoBoard
from calibration.chessboard import Chessboard
from calibration.errors import CalibrationError
from calibration.intrinsics import IntrinsicsFit, fit_intrinsics
from calibration.pictures import Picture, Skipped, pictures_from, pictures_of
from calibration.ring_grid import RingGrid
from calibration.survey import Floor, FloorMarker, MeasuredLength, read_floor
from calibration.verify import LengthCheck, verify_length
from calibration.world import WorldLimits, WorldResult, calibrate_world

__all__ = [
    "Board",
    "BoardSighting",
    "CalibrationError",
    "CameraLimits",
    "CameraResult",
    "CharucoBoard",
    "Chessboard",
    "Floor",
    "FloorMarker",
    "IntrinsicsFit",
    "LengthCheck",
    "MeasuredLength",
    "Picture",
    "RingGrid",
    "Sightings",
    "Skipped",
    "WorldLimits",
    "WorldResult",
    "calibrate_camera",
    "calibrate_world",
    "fit_intrinsics",
    "pictures_from",
    "pictures_of",
    "read_floor",
    "verify_length",
]
