"""A short drive past cones as the recorder writes it: odometry, gyro, motor, steering, lidar."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from capture import Odometry, Session, SessionInfo, point_cloud_message
from capture.log_writer import LogWriter
from capture.messages import header, odometry_messages, serialised, typestore
from capture.session_info import write_session_info
from capture.topics import (
    DRIVE_TYPE,
    IMU_TYPE,
    LOG_NAME,
    ODOMETRY_TYPE,
    POINTS_TYPE,
    SCAN_TYPE,
    VESC_STATE_TYPE,
)
from geometry import Floats, Stamps

S = 1_000_000_000
START_NS = 1_700_000_000 * S
STAND_S, END_S = 1.6, 8.0
WHEELBASE_M, COUNTS_PER_M = 0.33, 5000.0
CONE_RADIUS_M, BEAMS = 0.05, 400
CONES = np.array(
    [[1.2, 0.6], [1.2, -0.6], [2.2, 0.8], [2.4, -0.4], [3.2, 1.1], [3.4, 0.0], [4.2, 1.6]]
)

Message = tuple[int, int, str, str, bytes]
"""Log time, stamp, topic, type, content."""


def steering(t_s: Floats) -> Floats:
    return np.where(t_s < STAND_S, 0.0, 0.12)


def driven(t_s: Floats) -> Floats:
    """Poses (n, 3): stands, then 0.6 m/s on the circle of a constant steering angle."""
    along = 0.6 * np.maximum(t_s - STAND_S, 0.0)
    radius = WHEELBASE_M / np.tan(0.12)
    turned = along / radius
    return np.stack([radius * np.sin(turned), radius * (1 - np.cos(turned)), turned], axis=1)


def stamps(t_s: Floats) -> Stamps:
    return START_NS + np.rint(t_s * 1e9).astype(np.int64)


def told(source: str = "vesc", rate_hz: float = 50.0, phase_s: float = 0.0) -> Odometry:
    t_s = np.arange(phase_s, END_S, 1.0 / rate_hz)
    moving = t_s >= STAND_S
    speed = np.where(moving, 0.6, 0.0)
    return Odometry(
        source, stamps(t_s), driven(t_s), speed, speed * np.tan(steering(t_s)) / WHEELBASE_M
    )


@dataclass(frozen=True)
class Streams:
    """What the recording shall hold."""

    points: bool = True
    scan: bool = True
    gyro_bias_rad_s: float = 0.01
    gyro_noise_rad_s: float = 0.0


@cache
def messages(streams: Streams = Streams()) -> list[Message]:
    """Everything in the order of log time; the lidar tells a revolution when it is over."""
    odometry = told()
    found = [
        (t + 2_000_000, t, "/vesc/odom", ODOMETRY_TYPE, data)
        for t, data in zip(odometry.t_ns.tolist(), odometry_messages(odometry), strict=True)
    ]
    found += [*_gyro(streams), *_motor(), *_commands(), *_revolutions(streams)]
    return sorted(found, key=lambda message: message[0])


def write(folder: Path, content: list[Message]) -> Session:
    """The finished session, flushed once a second of log time."""
    folder.mkdir()
    write_session_info(folder, SessionInfo(map="test"))
    now_s = [0.0]
    with LogWriter(folder / LOG_NAME, clock_s=lambda: now_s[0]) as log:
        for log_t_ns, stamp_ns, topic, kind, data in content:
            now_s[0] = (log_t_ns - START_NS) * 1e-9
            log.write(topic, kind, data, log_t_ns=log_t_ns, stamp_ns=stamp_ns)
    return Session.open(folder)


def _gyro(streams: Streams) -> list[Message]:
    types = typestore().types
    quaternion = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    vector = types["geometry_msgs/msg/Vector3"]
    unknown = np.zeros(9)
    t_s = np.arange(0.0013, END_S, 0.005)
    rate = np.where(t_s < STAND_S, 0.0, 0.6 * np.tan(0.12) / WHEELBASE_M) + streams.gyro_bias_rad_s
    rate += np.random.default_rng(3).normal(0.0, streams.gyro_noise_rad_s, t_s.size)
    found = []
    for t, z in zip(stamps(t_s).tolist(), rate.tolist(), strict=True):
        imu = types[IMU_TYPE](
            header=header(t, "imu"),
            orientation=quaternion,
            orientation_covariance=unknown,
            angular_velocity=vector(x=0.0, y=0.0, z=z),
            angular_velocity_covariance=unknown,
            linear_acceleration=vector(x=0.0, y=0.0, z=9.8),
            linear_acceleration_covariance=unknown,
        )
        found.append((t + 1_000_000, t, "/imu/data_raw", IMU_TYPE, serialised(imu, IMU_TYPE)))
    return found


def _motor() -> list[Message]:
    types = typestore().types
    state = types["vesc_msgs/msg/VescState"]
    names = {name: kind for name, (_, kind) in _fields("vesc_msgs/msg/VescState")}
    found = []
    t_s = np.arange(0.007, END_S, 0.02)
    for t, at in zip(stamps(t_s).tolist(), t_s.tolist(), strict=True):
        values = {name: 0 if kind[0] == "int32" else 0.0 for name, kind in names.items()}
        values["displacement"] = round(COUNTS_PER_M * 0.6 * max(at - STAND_S, 0.0))
        message = types[VESC_STATE_TYPE](header=header(t, "base_link"), state=state(**values))
        data = serialised(message, VESC_STATE_TYPE)
        found.append((t + 3_000_000, t, "/vesc/state", VESC_STATE_TYPE, data))
    return found


def _fields(name: str) -> list[tuple[str, tuple[object, tuple[str, object]]]]:
    return typestore().fielddefs[name][1]  # type: ignore[return-value]  # rosbags' own nest


def _commands() -> list[Message]:
    types = typestore().types
    found = []
    for t_s in np.arange(0.0, END_S, 0.05).tolist():
        t = int(stamps(np.array([t_s]))[0])
        drive = types["ackermann_msgs/msg/AckermannDrive"](
            steering_angle=float(steering(np.array([t_s]))[0]),
            steering_angle_velocity=0.0,
            speed=0.6,
            acceleration=0.0,
            jerk=0.0,
        )
        message = types[DRIVE_TYPE](header=header(t, "base_link"), drive=drive)
        found.append((t, t, "/drive", DRIVE_TYPE, serialised(message, DRIVE_TYPE)))
    return found


def _revolutions(streams: Streams) -> list[Message]:
    random = np.random.default_rng(1)
    found = []
    for start_s in np.arange(0.013, END_S - 0.1, 0.1).tolist():
        t_s = start_s + np.arange(0.0, BEAMS) * (0.1 / BEAMS)
        bearing = np.arange(0.0, BEAMS) * (2 * np.pi / BEAMS) - np.pi
        range_m = ranges(driven(t_s), bearing) + random.normal(0.0, 0.003, BEAMS)
        beam_ns = stamps(t_s)
        first, log_ns = int(beam_ns[0]), int(beam_ns[-1]) + 4_000_000
        if streams.points:
            cloud = point_cloud_message(first, beam_ns, range_m, bearing, np.full(BEAMS, 47.0))
            found.append((log_ns, first, "/lidar/points", POINTS_TYPE, cloud))
        if streams.scan:
            found.append((log_ns, first, "/scan", SCAN_TYPE, _laser_scan(first, range_m)))
    return found


def ranges(poses: Floats, bearing: Floats) -> Floats:
    """(n,) distance along each beam to the nearest cone; NaN where it hits none within 6 m."""
    direction = poses[:, 2] + bearing
    ray = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    offset = CONES[None] - poses[:, None, :2]
    along = np.einsum("nck,nk->nc", offset, ray)
    across = offset[..., 0] * ray[:, None, 1] - offset[..., 1] * ray[:, None, 0]
    depth = CONE_RADIUS_M**2 - across**2
    hit = (depth > 0.0) & (along > 0.0)
    distance = np.where(hit, along - np.sqrt(np.maximum(depth, 0.0)), np.inf).min(axis=1)
    return np.where(distance < 6.0, distance, np.nan)


def _laser_scan(stamp_ns: int, range_m: Floats) -> bytes:
    message = typestore().types[SCAN_TYPE](
        header=header(stamp_ns, "lidar"),
        angle_min=-np.pi,
        angle_max=np.pi - 2 * np.pi / BEAMS,
        angle_increment=2 * np.pi / BEAMS,
        time_increment=0.1 / BEAMS,
        scan_time=0.1,
        range_min=0.1,
        range_max=12.0,
        ranges=range_m.astype(np.float32),
        intensities=np.zeros(0, dtype=np.float32),
    )
    return serialised(message, SCAN_TYPE)
