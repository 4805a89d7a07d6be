"""The session: recording it, importing it, reading it, exporting it.

The only room that knows the file formats: session folders, MCAP logs, ROS bags, TUM trajectories,
landmark tables. `rosbags` and `mcap` are imported when a log is opened, not before.
"""

from capture.arrived import Arrived
from capture.calibrations import (
    KINDS,
    Calibration,
    CameraCalibration,
    CameraDelayCalibration,
    DelayOfSession,
    LengthResidual,
    MeasuredCalibration,
    Parameter,
    PlacedMarker,
    StereoCalibration,
    ViewResidual,
    WorldCalibration,
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
from capture.in_force import usual_calibrations
from capture.joined import check_parts, keep_pictures, mapped_truth, new_joined_session
from capture.landmark_table import (
    read_estimated_map,
    read_landmarks,
    read_path_covariance,
    write_estimated_map,
    write_landmarks,
    write_path_covariance,
)
from capture.log_tail import LogTail
from capture.network_clock import read_peer_clock
from capture.point_cloud import point_cloud_message
from capture.session import Session
from capture.session_info import ClockPair, FilmClock, PeerClock, SessionInfo, software
from capture.session_list import list_sessions
from capture.stamps import ns_to_stamp, stamp_to_ns
from capture.streams import (
    Drive,
    Imu,
    MagneticField,
    Observations,
    Odometry,
    Scans,
    UncertainOdometry,
    VescState,
    extended,
    joined,
    split,
)
from capture.topics import preferred_source
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
    "CameraDelayCalibration",
    "CaptureError",
    "ClockPair",
    "ConfigurationError",
    "DelayOfSession",
    "Drive",
    "Estimate",
    "EstimatedMap",
    "FilmClock",
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
    "PeerClock",
    "PlacedMarker",
    "Scans",
    "Session",
    "SessionError",
    "SessionInfo",
    "StereoCalibration",
    "TextFileError",
    "TumPath",
    "UncertainOdometry",
    "VescState",
    "ViewResidual",
    "WorldCalibration",
    "accepted_file",
    "accepted_files",
    "calibration_file",
    "check_parts",
    "configuration_from_mapping",
    "configuration_from_text",
    "extended",
    "joined",
    "keep_pictures",
    "kind_of",
    "list_sessions",
    "mapped_truth",
    "new_folder",
    "new_joined_session",
    "no_odometry",
    "now_utc",
    "ns_to_stamp",
    "point_cloud_message",
    "preferred_source",
    "read_calibration",
    "read_camera_calibration",
    "read_camera_delay",
    "read_configuration",
    "read_estimated_map",
    "read_imu_csv",
    "read_landmarks",
    "read_measured_calibration",
    "read_path_covariance",
    "read_peer_clock",
    "read_planar_tum",
    "read_stereo_calibration",
    "read_tum",
    "read_world_calibration",
    "read_yaml",
    "software",
    "split",
    "stamp_to_ns",
    "usual_calibrations",
    "with_overrides",
    "write_calibration",
    "write_estimated_map",
    "write_landmarks",
    "write_path_covariance",
    "write_text",
    "write_tum",
    "write_yaml",
]
