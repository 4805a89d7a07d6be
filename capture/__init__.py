"""The session: recording it, importing it, reading it, exporting it.

The only room that knows the file formats: session folders, MCAP logs, ROS bags, TUM trajectories,
landmark tables. `rosbags` and `mcap` are imported when a log is opened, not before.
"""

from capture.arrived import Arrived
from capture.calibrations import (
    CameraCalibration,
    CameraDelayCalibration,
    DelayOfSession,
    LengthResidual,
    PlacedMarker,
    StereoCalibration,
    ViewResidual,
    WorldCalibration,
    calibration_file,
    now_utc,
    read_camera_calibration,
    read_camera_delay,
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
from capture.peer_file import read_peer_clock
from capture.point_cloud import point_cloud_message
from capture.session import Session, list_sessions, preferred_source
from capture.session_info import ClockPair, FilmClock, PeerClock, SessionInfo, software
from capture.stamps import ns_to_stamp, stamp_to_ns
from capture.streams import (
    Drive,
    Imu,
    Observations,
    Odometry,
    Scans,
    UncertainOdometry,
    VescState,
    extended,
    joined,
    split,
)
from capture.transaction import new_folder, write_text
from capture.tum import TumPath, read_planar_tum, read_tum, write_tum
from capture.yaml_file import read_yaml, write_yaml

__all__ = [
    "NO_STAMP",
    "Arrived",
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
    "MissingStreamError",
    "Observations",
    "Odometry",
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
    "calibration_file",
    "check_parts",
    "configuration_from_mapping",
    "configuration_from_text",
    "extended",
    "joined",
    "keep_pictures",
    "list_sessions",
    "mapped_truth",
    "new_folder",
    "new_joined_session",
    "no_odometry",
    "now_utc",
    "ns_to_stamp",
    "point_cloud_message",
    "preferred_source",
    "read_camera_calibration",
    "read_camera_delay",
    "read_configuration",
    "read_estimated_map",
    "read_landmarks",
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
    "with_overrides",
    "write_calibration",
    "write_estimated_map",
    "write_landmarks",
    "write_path_covariance",
    "write_text",
    "write_tum",
    "write_yaml",
]
