from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from capture import topics
from capture.messages import typestore
from capture.sensor_messages import (
    WARN,
    diagnostics_message,
    diagnostics_of,
    drive_message,
    image_message,
    imu_message,
    laser_scan_message,
    magnetic_field_message,
    odometry_message,
    raw_message,
    vesc_telemetry_message,
)

T_NS = 1_700_000_000_123_456_789


def read(data: bytes, type_name: str) -> Any:
    return typestore().deserialize_cdr(data, type_name)


def stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


@pytest.mark.parametrize("size", [0, 1, 3, 4, 132, 70_000])
def test_raw_bytes_come_back_as_they_were(size: int) -> None:
    sent = bytes(k * 7 % 256 for k in range(size))
    message = read(raw_message(sent), topics.RAW_TYPE)
    assert message.data.tobytes() == sent
    assert message.layout.dim == []


def test_a_frame_keeps_its_bytes_and_its_stamp() -> None:
    message = read(image_message(T_NS, "overhead", "jpeg", b"\xff\xd8abc"), topics.IMAGE_TYPE)
    assert message.data.tobytes() == b"\xff\xd8abc"
    assert (message.format, message.header.frame_id) == ("jpeg", "overhead")
    assert stamp_ns(message) == T_NS


def test_an_imu_without_orientation_says_so() -> None:
    message = read(imu_message(T_NS, "imu", (1.0, 2.0, 3.0), (4.0, 5.0, 9.8)), topics.IMU_TYPE)
    assert message.orientation_covariance[0] == -1.0
    rate, acceleration = message.angular_velocity, message.linear_acceleration
    assert (rate.x, rate.y, rate.z) == (1.0, 2.0, 3.0)
    assert (acceleration.x, acceleration.y, acceleration.z) == (4.0, 5.0, 9.8)
    assert stamp_ns(message) == T_NS


def test_a_magnetic_field_is_in_tesla() -> None:
    data = magnetic_field_message(T_NS, "imu", (2e-5, 0.0, -4e-5))
    field = read(data, topics.MAGNETIC_FIELD_TYPE).magnetic_field
    assert (field.x, field.y, field.z) == (2e-5, 0.0, -4e-5)


def test_an_odometry_turns_about_z() -> None:
    message = read(
        odometry_message(T_NS, (1.0, 2.0, math.pi / 2), 0.5, -0.25), topics.ODOMETRY_TYPE
    )
    pose, twist = message.pose.pose, message.twist.twist
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    assert (pose.orientation.z, pose.orientation.w) == pytest.approx((math.sqrt(0.5),) * 2)
    assert (twist.linear.x, twist.angular.z) == (0.5, -0.25)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")


def test_a_scan_has_its_angles_and_times() -> None:
    data = laser_scan_message(
        T_NS,
        "lidar",
        angle_min_rad=0.5,
        angle_increment_rad=0.25,
        time_increment_s=-1e-3,
        scan_time_s=0.1,
        range_limits_m=(0.1, 12.0),
        range_m=np.array([1.0, np.inf, 3.0]),
        intensity=np.array([10.0, 0.0, 30.0]),
    )
    scan = read(data, topics.SCAN_TYPE)
    assert scan.angle_max == pytest.approx(1.0)
    assert scan.time_increment == pytest.approx(-1e-3)
    assert scan.ranges.tolist() == [1.0, np.inf, 3.0]
    assert scan.intensities.tolist() == [10.0, 0.0, 30.0]


def test_telemetry_that_a_firmware_has_not_is_nan_or_zero() -> None:
    data = vesc_telemetry_message(T_NS, {"speed": -1000.0, "displacement": -37045})
    state = read(data, topics.VESC_STATE_TYPE).state
    assert (state.speed, state.displacement, state.fault_code) == (-1000.0, -37045, 0)
    assert math.isnan(state.avg_vd)


def test_a_command_is_an_ackermann_drive() -> None:
    message = read(drive_message(T_NS, 0.25, 1.5), topics.DRIVE_TYPE)
    assert (message.drive.steering_angle, message.drive.speed) == (0.25, 1.5)


def test_diagnostics_come_back_by_name() -> None:
    data = diagnostics_message(
        T_NS, [("lidar", WARN, "slow", {"rate_hz": "8.0"}), ("recorder", 0, "", {})]
    )
    assert diagnostics_of(data) == {
        "lidar": {"message": "slow", "rate_hz": "8.0"},
        "recorder": {"message": ""},
    }
    assert read(data, topics.DIAGNOSTICS_TYPE).status[0].level == WARN
