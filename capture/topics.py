"""Names and types of what a log holds (`docs/formats.md` has the table)."""

from __future__ import annotations

LOG_NAME = "car.mcap"

ODOMETRY_TYPE = "nav_msgs/msg/Odometry"
SCAN_TYPE = "sensor_msgs/msg/LaserScan"
POINTS_TYPE = "sensor_msgs/msg/PointCloud2"
IMU_TYPE = "sensor_msgs/msg/Imu"
POSE_TYPE = "geometry_msgs/msg/PoseStamped"
DRIVE_TYPE = "ackermann_msgs/msg/AckermannDriveStamped"
VESC_STATE_TYPE = "vesc_msgs/msg/VescStateStamped"
RANGE_BEARING_TYPE = "trackside_msgs/msg/RangeBearingArray"

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
