"""The calibrations as files: dated, never overwritten, read back whole.

`KIND_DATE.yaml`; all say how they were made, what was left over, and whether they were accepted.
`files.KINDS` is the table of all kinds.
"""

from capture.calibrations.files import (
    KINDS,
    Calibration,
    accepted_file,
    accepted_files,
    calibration_file,
    kind_of,
    now_utc,
    read_calibration,
    read_camera_calibration,
    read_camera_delay,
    read_measured_calibration,
    read_stereo_calibration,
    read_world_calibration,
    write_calibration,
)
from capture.calibrations.measured import MeasuredCalibration, Parameter
from capture.calibrations.overhead import (
    CameraCalibration,
    CameraDelayCalibration,
    DelayOfSession,
    LengthResidual,
    PlacedMarker,
    ViewResidual,
    WorldCalibration,
)
from capture.calibrations.stereo import StereoCalibration

__all__ = [
    "KINDS",
    "Calibration",
    "CameraCalibration",
    "CameraDelayCalibration",
    "DelayOfSession",
    "LengthResidual",
    "MeasuredCalibration",
    "Parameter",
    "PlacedMarker",
    "StereoCalibration",
    "ViewResidual",
    "WorldCalibration",
    "accepted_file",
    "accepted_files",
    "calibration_file",
    "kind_of",
    "now_utc",
    "read_calibration",
    "read_camera_calibration",
    "read_camera_delay",
    "read_measured_calibration",
    "read_stereo_calibration",
    "read_world_calibration",
    "write_calibration",
]
