"""Raw messages of a topic -> the columns of `capture.streams`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from capture.cdr import (
    ACKERMANN_DRIVE,
    IMU,
    LASER_SCAN,
    MAGNETIC_FIELD,
    ODOMETRY,
    RANGE_BEARING_ARRAY,
    VESC_STATE,
    Block,
    Fields,
    blocks,
)
from capture.errors import LogError
from capture.log_reader import RawMessages
from capture.stamps import NS_PER_S
from capture.streams import Drive, Imu, MagneticField, Observations, Odometry, Scans, VescState
from capture.yaw import heading_of
from geometry import Floats, Stamps, between, wrap

_REST = 1e-12
LOST_COVARIANCE = 9999.0
"""Variance of x by which a visual odometry says that it is lost."""


def odometry_columns(raw: RawMessages, source: str) -> Odometry:
    """Poses and speeds; where a source tells only one of the two, the other is made from it.

    Messages that are not finite are left out, as are repeated stamps and those that say the source
    was lost; raises `LogError` when none is left.
    """
    told = told_odometry(raw, source)
    if not told.t_ns.size:
        raise LogError(
            f"topic {raw.topic}: none of its {len(raw.messages)} messages tells a pose "
            f"({told.lost_t_ns.size} say that the source was lost); use another source"
        )
    pose, speed, yaw_rate = told.pose_odom_base, told.speed_m_s, told.yaw_rate_rad_s
    moves, tells_speed = bool(np.any(at_other(pose, pose[:1]))), bool(np.any(tells_motion(told)))
    if tells_speed and not moves:
        return replace(told, pose_odom_base=integrated(told.t_ns, speed, yaw_rate, pose[:1]))
    if moves and not tells_speed:
        speed, yaw_rate = differentiated(told.t_ns, pose)
        return replace(told, speed_m_s=speed, yaw_rate_rad_s=yaw_rate)
    return told


def told_odometry(raw: RawMessages, source: str) -> Odometry:
    """The messages of an odometry topic as they are, those left out that tell nothing.

    A visual odometry that got lost goes on repeating its pose with a covariance of 9999 (libviso2
    in `viso2_ros`, stereo_odometer.cpp, BAD_COVARIANCE): as a sample that would be a standstill.
    """
    table = _Table(raw, ODOMETRY)
    position, heading = table.column("position"), heading_of(table.column("orientation"))
    pose = np.stack([position[:, 0], position[:, 1], heading], axis=1)
    speed, yaw_rate = table.column("linear")[:, 0], table.column("angular")[:, 2]
    finite = np.isfinite(pose).all(axis=1) & np.isfinite(speed) & np.isfinite(yaw_rate)
    lost = table.column("pose_covariance")[:, 0] == LOST_COVARIANCE
    kept = finite & ~lost
    return Odometry(
        source, table.t_ns[kept], pose[kept], speed[kept], yaw_rate[kept], table.t_ns[lost]
    )


def at_other(pose: Floats, reference: Floats) -> npt.NDArray[np.bool_]:
    """(n,): whether each pose is another than the reference (1, 3)."""
    moved: npt.NDArray[np.bool_] = np.any(np.abs(pose - reference) > _REST, axis=1)
    return moved


def tells_motion(odometry: Odometry) -> npt.NDArray[np.bool_]:
    """(n,): whether each sample tells a speed or a turn rate."""
    moving: npt.NDArray[np.bool_] = (np.abs(odometry.speed_m_s) > _REST) | (
        np.abs(odometry.yaw_rate_rad_s) > _REST
    )
    return moving


def integrated(
    t_ns: Stamps, speed_m_s: Floats, yaw_rate_rad_s: Floats, start: Floats | None = None
) -> Floats:
    """Poses (n, 3) from `start` (1, 3) or (0, 0, 0): each speed holds until the next message.

    Each step goes straight along its mean heading, which is good to second order in the turn.
    """
    start = np.zeros((1, 3)) if start is None else start
    poses = unwound(t_ns, speed_m_s, yaw_rate_rad_s, start)
    poses[:, 2] = wrap(poses[:, 2])
    return poses


def unwound(t_ns: Stamps, speed_m_s: Floats, yaw_rate_rad_s: Floats, start: Floats) -> Floats:
    """The same with headings that are not wrapped, so that it can be gone on with exactly."""
    ((x0, y0, heading0),) = start
    period_s = np.diff(t_ns) * 1e-9
    turn, step = yaw_rate_rad_s[:-1] * period_s, speed_m_s[:-1] * period_s
    heading = np.cumsum(np.append(heading0, turn))
    middle = heading[:-1] + turn / 2
    x = np.cumsum(np.append(x0, step * np.cos(middle)))
    y = np.cumsum(np.append(y0, step * np.sin(middle)))
    return np.stack([x, y, heading], axis=1)


def scan_columns(raw: RawMessages) -> Scans:
    """Revolutions of a `LaserScan` topic; ranges outside the lidar's limits are no echo."""
    table = _Table(raw, LASER_SCAN)
    beam_t_ns, ranges, bearings, intensities = [], [], [], []
    for start_ns, row in zip(table.t_ns.tolist(), table.rows(), strict=True):
        range_m, intensity = (row[name].astype(np.float64) for name in ("ranges", "intensities"))
        beams = np.arange(range_m.size)
        offset_ns = np.rint(beams * (float(row["time_increment"]) * 1e9)).astype(np.int64)
        echo = (range_m >= row["range_min"]) & (range_m <= row["range_max"])
        beam_t_ns.append(start_ns + offset_ns)
        ranges.append(np.where(echo, range_m, np.nan))
        bearings.append(wrap(float(row["angle_min"]) + beams * float(row["angle_increment"])))
        unknown = np.full(range_m.size, np.nan)
        intensities.append(intensity if intensity.size == range_m.size else unknown)
    starts = np.cumsum([0, *(range_m.size for range_m in ranges)], dtype=np.int64)
    return Scans(
        table.t_ns,
        starts,
        np.concatenate(beam_t_ns),
        np.concatenate(ranges),
        np.concatenate(bearings),
        np.concatenate(intensities),
    )


def drive_columns(raw: RawMessages) -> Drive:
    """Commands of an `AckermannDriveStamped` topic."""
    table = _Table(raw, ACKERMANN_DRIVE)
    return Drive(table.t_ns, table.column("steering_angle"), table.column("speed"))


def imu_columns(raw: RawMessages) -> Imu:
    """Angular velocity and acceleration of a `sensor_msgs/Imu` topic."""
    table = _Table(raw, IMU)
    return Imu(table.t_ns, table.column("angular_velocity"), table.column("linear_acceleration"))


def magnetic_field_columns(raw: RawMessages) -> MagneticField:
    """Samples of a `sensor_msgs/MagneticField` topic."""
    table = _Table(raw, MAGNETIC_FIELD)
    return MagneticField(table.t_ns, table.column("magnetic_field"))


def vesc_state_columns(raw: RawMessages) -> VescState:
    """Telemetry of a `vesc_msgs/VescStateStamped` topic."""
    table = _Table(raw, VESC_STATE)
    names = ("speed", "displacement", "voltage_input", "current_motor", "duty_cycle")
    return VescState(table.t_ns, *(table.column(name) for name in names))


def observation_columns(raw: RawMessages) -> Observations:
    """Every range and bearing of a `RangeBearingArray` topic."""
    table = _Table(raw, RANGE_BEARING_ARRAY, repeated_stamps=True)
    rows = table.rows()
    names = ("landmark_id", "range_m", "bearing_rad")
    sizes = np.array([[row[name].size for name in names] for row in rows])
    if np.any(sizes != sizes[:, :1]):
        raise LogError(
            f"topic {raw.topic}: a message has ids, ranges and bearings of unequal number; "
            "expected one of each per observation; import the data again"
        )
    ids, ranges, bearings = (np.concatenate([row[name] for row in rows]) for name in names)
    t_ns = np.repeat(table.t_ns, sizes[:, 0])
    return Observations(t_ns, ids.astype(np.int64), ranges, bearings)


class _Table:
    """The fields of the messages of a topic in order of their stamps.

    t_ns : (n,) header stamps; where a sender left the stamp empty, the log time.
    """

    def __init__(self, raw: RawMessages, fields: Fields, *, repeated_stamps: bool = False) -> None:
        try:
            self._blocks: list[Block] = list(blocks(raw.messages, fields))
        except ValueError as err:
            raise LogError(
                f"topic {raw.topic}: {err}; expected messages as its schema says; "
                "record or import it again"
            ) from err
        seconds, nanoseconds = self._joined("sec"), self._joined("nanosec")
        t_ns = seconds.astype(np.int64) * NS_PER_S + nanoseconds.astype(np.int64)
        t_ns = np.where(t_ns == 0, raw.log_t_ns, t_ns)
        order = np.argsort(t_ns, kind="stable")
        if not repeated_stamps:
            order = order[np.diff(t_ns[order], prepend=t_ns[order[:1]] - 1) > 0]
        self._order = order
        self.t_ns: Stamps = t_ns[order]

    def column(self, name: str) -> Floats:
        """(n, ...) values of a field of fixed size."""
        return self._joined(name)[self._order].astype(np.float64)

    def rows(self) -> list[np.void]:
        """One structured scalar per message, for fields whose length changes."""
        rows = [row for block in self._blocks for row in block]
        return [rows[at] for at in self._order.tolist()]

    def _joined(self, name: str) -> npt.NDArray[np.generic]:
        return np.concatenate([block[name] for block in self._blocks])


def differentiated(t_ns: Stamps, pose: Floats) -> tuple[Floats, Floats]:
    """Forward speed and turn rate (n,) from one pose to the next; the last two are equal."""
    if t_ns.size < 2:
        return np.zeros(t_ns.size), np.zeros(t_ns.size)
    period_s = np.diff(t_ns) * 1e-9
    step = between(pose[:-1], pose[1:])
    # Along the chord, so that a curve has the sign and length of its motion.
    speed = np.copysign(np.hypot(step[:, 0], step[:, 1]), step[:, 0]) / period_s
    yaw_rate = step[:, 2] / period_s
    return np.append(speed, speed[-1]), np.append(yaw_rate, yaw_rate[-1])
