"""Messages of the sensors of a car, each from plain values in SI units, as CDR.

Stamps are UTC nanoseconds of the measurement. An unknown covariance is zero, and -1 in its first
element where the whole quantity is unknown (sensor_msgs/Imu, REP 145).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from capture.messages import header, serialised, typestore
from capture.topics import (
    DIAGNOSTICS_TYPE,
    DRIVE_TYPE,
    IMAGE_TYPE,
    IMU_TYPE,
    MAGNETIC_FIELD_TYPE,
    ODOMETRY_TYPE,
    RAW_TYPE,
    SCAN_TYPE,
    VESC_STATE_TYPE,
)
from geometry import Floats

if TYPE_CHECKING:
    from rosbags.typesys.store import Msg

Vector = tuple[float, float, float]
Pose = tuple[float, float, float]
UNKNOWN = -1.0


def raw_message(data: bytes) -> bytes:
    """`std_msgs/UInt8MultiArray`: bytes exactly as they came."""
    types = typestore().types
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    array = np.frombuffer(data, dtype=np.uint8)
    return serialised(types[RAW_TYPE](layout=layout, data=array), RAW_TYPE)


def raw_bytes(message: bytes) -> bytes:
    """What `raw_message` was made of."""
    array: Any = typestore().deserialize_cdr(message, RAW_TYPE)
    return bytes(array.data)


def image_message(t_ns: int, frame_id: str, image_format: str, data: bytes) -> bytes:
    """`sensor_msgs/CompressedImage`: the camera's own bytes; `image_format` as in ROS: "jpeg"."""
    array = np.frombuffer(data, dtype=np.uint8)
    make = typestore().types[IMAGE_TYPE]
    message = make(header=header(t_ns, frame_id), format=image_format, data=array)
    return serialised(message, IMAGE_TYPE)


def imu_message(
    t_ns: int, frame_id: str, angular_velocity_rad_s: Vector, linear_acceleration_m_s2: Vector
) -> bytes:
    """`sensor_msgs/Imu` without orientation; x, y, z each, the acceleration with gravity."""
    unknown = np.array([UNKNOWN] + [0.0] * 8)
    message = typestore().types[IMU_TYPE](
        header=header(t_ns, frame_id),
        orientation=_geometry("Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=unknown,
        angular_velocity=_vector(angular_velocity_rad_s),
        angular_velocity_covariance=_no_covariance(9),
        linear_acceleration=_vector(linear_acceleration_m_s2),
        linear_acceleration_covariance=_no_covariance(9),
    )
    return serialised(message, IMU_TYPE)


def magnetic_field_message(t_ns: int, frame_id: str, magnetic_field_t: Vector) -> bytes:
    """`sensor_msgs/MagneticField`; x, y, z in tesla."""
    message = typestore().types[MAGNETIC_FIELD_TYPE](
        header=header(t_ns, frame_id),
        magnetic_field=_vector(magnetic_field_t),
        magnetic_field_covariance=_no_covariance(9),
    )
    return serialised(message, MAGNETIC_FIELD_TYPE)


def odometry_message(
    t_ns: int, pose_odom_base: Pose, speed_m_s: float, yaw_rate_rad_s: float
) -> bytes:
    """`nav_msgs/Odometry` of the car in the frame `odom`."""
    x, y, heading = pose_odom_base
    orientation = _geometry(
        "Quaternion", x=0.0, y=0.0, z=float(np.sin(heading / 2)), w=float(np.cos(heading / 2))
    )
    position = _geometry("Point", x=x, y=y, z=0.0)
    pose = _geometry("Pose", position=position, orientation=orientation)
    linear, angular = _vector((speed_m_s, 0.0, 0.0)), _vector((0.0, 0.0, yaw_rate_rad_s))
    twist = _geometry("Twist", linear=linear, angular=angular)
    message = typestore().types[ODOMETRY_TYPE](
        header=header(t_ns, "odom"),
        child_frame_id="base_link",
        pose=_geometry("PoseWithCovariance", pose=pose, covariance=_no_covariance(36)),
        twist=_geometry("TwistWithCovariance", twist=twist, covariance=_no_covariance(36)),
    )
    return serialised(message, ODOMETRY_TYPE)


def laser_scan_message(
    t_ns: int,
    frame_id: str,
    *,
    angle_min_rad: float,
    angle_increment_rad: float,
    time_increment_s: float,
    scan_time_s: float,
    range_limits_m: tuple[float, float],
    range_m: Floats,
    intensity: Floats,
) -> bytes:
    """`sensor_msgs/LaserScan`; beam i is at `t_ns` + i time increments; no echo is infinity."""
    low, high = range_limits_m
    message = typestore().types[SCAN_TYPE](
        header=header(t_ns, frame_id),
        angle_min=angle_min_rad,
        angle_max=angle_min_rad + angle_increment_rad * max(range_m.size - 1, 0),
        angle_increment=angle_increment_rad,
        time_increment=time_increment_s,
        scan_time=scan_time_s,
        range_min=low,
        range_max=high,
        ranges=range_m.astype(np.float32),
        intensities=intensity.astype(np.float32),
    )
    return serialised(message, SCAN_TYPE)


def vesc_telemetry_message(t_ns: int, fields: Mapping[str, float]) -> bytes:
    """`vesc_msgs/VescStateStamped`; fields by f1tenth's names, absent ones NaN or 0."""
    store = typestore()
    kind = VESC_STATE_TYPE.removesuffix("Stamped")
    values: dict[str, float] = {}
    for name, (_, base) in store.fielddefs[kind][1]:
        is_integer = base[0] == "int32"
        value = fields.get(name, 0 if is_integer else np.nan)
        values[name] = int(value) if is_integer else float(value)
    state = store.types[kind](**values)
    message = store.types[VESC_STATE_TYPE](header=header(t_ns, "base_link"), state=state)
    return serialised(message, VESC_STATE_TYPE)


def drive_message(t_ns: int, steering_angle_rad: float, speed_m_s: float) -> bytes:
    """`ackermann_msgs/AckermannDriveStamped`: what was commanded; NaN where it is unknown."""
    types = typestore().types
    drive = types["ackermann_msgs/msg/AckermannDrive"](
        steering_angle=steering_angle_rad,
        steering_angle_velocity=0.0,
        speed=speed_m_s,
        acceleration=0.0,
        jerk=0.0,
    )
    return serialised(types[DRIVE_TYPE](header=header(t_ns, "base_link"), drive=drive), DRIVE_TYPE)


OK, WARN, ERROR, STALE = range(4)
"""Levels of `diagnostic_msgs/DiagnosticStatus`."""

Status = tuple[str, int, str, Mapping[str, object]]
"""Name, level, message and values of one thing that is watched."""


def diagnostics_message(t_ns: int, statuses: Sequence[Status]) -> bytes:
    """`diagnostic_msgs/DiagnosticArray`."""
    types = typestore().types
    make, pair = (
        types["diagnostic_msgs/msg/DiagnosticStatus"],
        types["diagnostic_msgs/msg/KeyValue"],
    )
    status = [
        make(
            level=level,
            name=name,
            message=text,
            hardware_id="",
            values=[pair(key=key, value=str(value)) for key, value in values.items()],
        )
        for name, level, text, values in statuses
    ]
    message = types[DIAGNOSTICS_TYPE](header=header(t_ns, ""), status=status)
    return serialised(message, DIAGNOSTICS_TYPE)


def diagnostics_of(message: bytes) -> dict[str, dict[str, str]]:
    """The values of each status in a `DiagnosticArray`, by its name; its text under `message`."""
    array: Any = typestore().deserialize_cdr(message, DIAGNOSTICS_TYPE)
    return {
        status.name: {"message": status.message, **{kv.key: kv.value for kv in status.values}}
        for status in array.status
    }


def _geometry(name: str, **fields: float | Floats | Msg) -> Msg:
    return typestore().types[f"geometry_msgs/msg/{name}"](**fields)


def _vector(values: Vector) -> Msg:
    x, y, z = values
    return _geometry("Vector3", x=x, y=y, z=z)


@lru_cache(maxsize=4)
def _no_covariance(size: int) -> Floats:
    zeros: Floats = np.zeros(size)
    zeros.flags.writeable = False
    return zeros
