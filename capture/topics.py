"""Names and types of what a log holds (`docs/formats.md` has the table)."""

from __future__ import annotations

from collections.abc import Iterable

LOG_NAME = "car.mcap"
OVERHEAD_LOG_NAME = "overhead.mcap"
ZED_LOG_NAME = "zed.mcap"
IMAGE_LOGS = frozenset({OVERHEAD_LOG_NAME, ZED_LOG_NAME})
"""Logs whose messages are compressed already, and take long to read through."""

ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
SCAN_TYPE = "sensor_msgs/msg/LaserScan"
POINTS_TYPE = "sensor_msgs/msg/PointCloud2"
IMU_TYPE = "sensor_msgs/msg/Imu"
POSE_TYPE = "geometry_msgs/msg/PoseStamped"
DRIVE_TYPE = "ackermann_msgs/msg/AckermannDriveStamped"
VESC_STATE_TYPE = "vesc_msgs/msg/VescStateStamped"
RANGE_BEARING_TYPE = "trackside_msgs/msg/RangeBearingArray"
RAW_TYPE = "std_msgs/msg/UInt8MultiArray"
POINTS_TYPE = "sensor_msgs/msg/PointCloud2"
MAGNETIC_FIELD_TYPE = "sensor_msgs/msg/MagneticField"
IMAGE_TYPE = "sensor_msgs/msg/CompressedImage"
DIAGNOSTICS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"

RAW_LIDAR_TOPIC = "/raw/lidar"
RAW_VESC_TOPIC = "/raw/vesc"
RAW_IMU_TOPIC = "/raw/imu"
POINTS_TOPIC = "/lidar/points"
MAGNETIC_FIELD_TOPIC = "/imu/mag"
OVERHEAD_TOPIC = "/overhead/image/compressed"
ZED_TOPIC = "/zed/stereo/compressed"
DIAGNOSTICS_TOPIC = "/diagnostics"
SCAN_TOPIC = "/scan"
POINTS_TOPIC = "/lidar/points"
IMU_TOPIC = "/imu/data_raw"
DRIVE_TOPIC = "/drive"
VESC_STATE_TOPIC = "/vesc/state"
RANGE_BEARING_TOPIC = "/landmarks/observed"

ODOMETRY_SUFFIX = "/odom"
PREFERRED_SOURCES = ("vesc", "wheel", "zed", "viso")


def odometry_topic(source: str) -> str:
    """Where the odometry of a source stands."""
    return f"/{source}{ODOMETRY_SUFFIX}"


def odometry_source(topic: str) -> str:
    """The source whose odometry stands on a topic."""
    return topic.removesuffix(ODOMETRY_SUFFIX).strip("/")


def preferred_source(sources: Iterable[str]) -> str | None:
    """The odometry to take where nobody asked for one."""
    return min(sources, key=preference, default=None)


def preference(source: str) -> tuple[int, str]:
    """What sorts sources of odometry, preferred ones first."""
    known = PREFERRED_SOURCES
    return (known.index(source) if source in known else len(known), source)
