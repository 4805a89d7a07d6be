"""The session: recording it, importing it, reading it, exporting it.

The only room that knows the file formats: session folders, MCAP logs, ROS bags, TUM trajectories,
landmark tables. `rosbags` and `mcap` are imported when a log is opened, not before.
"""

from capture.arrived import Arrived
from capture.calibrations import (
    KINDS,
    Calibration,
    CameraCalibration,
    LengthResidual,
    MeasuredCalibration,
    Parameter,
    PlacedMarker,
    ViewResidual,
    WorldCalibration,
    accepted_file,
    accepted_files,
    calibration_file,
    kind_of,
    now_utc,
    read_calibration,
    read_camera_calibration,
    read_measured_calibration,
    read_world_calibration,
    write_calibration,
)
from capture.configuration import (
    configuration_from_mapping,
    configuration_from_text,
    read_configuration,
    with_overrides,
)
from capture.errors import (
    CalibrationFileError,
    CaptureError,
    ConfigurationError,
    LogError,
    MissingStreamError,
    SessionError,
    TextFileError,
)
from capture.estimate import NO_STAMP, Estimate, EstimatedMap, GroundTruth
from capture.growing_odometry import GrowingOdometry, no_odometry
from capture.images import LoggedImage
from capture.imu_text import read_imu_csv
from capture.landmark_table import (
    read_estimated_map,
    read_landmarks,
    read_path_covariance,
    write_estimated_map,
    write_landmarks,
    write_path_covariance,
)
from capture.log_tail import LogTail
from capture.point_cloud import point_cloud_message
from capture.session import Session, list_sessions, preferred_source
from capture.session_info import ClockPair, SessionInfo, software
from capture.stamps import ns_to_stamp, stamp_to_ns
from capture.streams import (
    Drive,
    Imu,
    MagneticField,
    Observations,
    Odometry,
    Scans,
    VescState,
    extended,
    joined,
    split,
)
from capture.transaction import new_folder, write_text
from capture.tum import TumPath, read_planar_tum, read_tum, write_tum
from capture.yaml_file import read_yaml, write_yaml

__all__ = [
    "KINDS",
    "NO_STAMP",
    "Arrived",
    "Calibration",
    "CalibrationFileError",
    "CameraCalibration",
    "CaptureError",
    "ClockPair",
    "ConfigurationError",
    "Drive",
    "Estimate",
    "EstimatedMap",
    "GroundTruth",
    "GrowingOdometry",
    "Imu",
    "LengthResidual",
    "LogError",
    "LogTail",
    "LoggedImage",
    "MagneticField",
    "MeasuredCalibration",
    "MissingStreamError",
    "Observations",
    "Odometry",
    "Parameter",
    "PlacedMarker",
    "Scans",
    "Session",
    "SessionError",
    "SessionInfo",
    "TextFileError",
    "TumPath",
    "VescState",
    "ViewResidual",
    "WorldCalibration",
    "accepted_file",
    "accepted_files",
    "calibration_file",
    "configuration_from_mapping",
    "configuration_from_text",
    "extended",
    "joined",
    "kind_of",
    "list_sessions",
    "new_folder",
    "no_odometry",
    "now_utc",
    "ns_to_stamp",
    "point_cloud_message",
    "preferred_source",
    "read_calibration",
    "read_camera_calibration",
    "read_configuration",
    "read_estimated_map",
    "read_imu_csv",
    "read_landmarks",
    "read_measured_calibration",
    "read_path_covariance",
    "read_planar_tum",
    "read_tum",
    "read_world_calibration",
    "read_yaml",
    "software",
    "split",
    "stamp_to_ns",
    "with_overrides",
    "write_calibration",
    "write_estimated_map",
    "write_landmarks",
    "write_path_covariance",
    "write_text",
    "write_tum",
    "write_yaml",
]
