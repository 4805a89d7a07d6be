"""Where the odometry comes from: a stream of the session, or one whose turning the gyro measures.

Wheels tell well how far a car went and badly how far it turned (tyres slip, steering has play);
a gyro tells turning well once its bias is known. `imu+SOURCE` takes each from where it is good.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from capture import Imu, Odometry, Session, VescState
from dialogue import UsageError
from geometry import Floats, Stamps, Trajectory, between, wrap
from slam.errors import SlamError

Mask = npt.NDArray[np.bool_]

IMU_PREFIX = "imu+"
TACHOMETER = "tachometer"


@dataclass(frozen=True, kw_only=True)
class SourceConfig:
    """How odometry is put together."""

    gyro_bias_rad_s: float | None = None
    """None: the median of the gyro while the car stands."""
    imu_offset_s: float = 0.0
    """Added to the stamps of the IMU."""
    still_speed_m_s: float = field(default=0.01, metadata={"min": 0.0})
    still_yaw_rate_rad_s: float = field(default=0.01, metadata={"min": 0.0})
    still_s: float = field(default=1.0, metadata={"min": 0.0})
    """The car stands when the source tells less than both rates for at least this long."""
    max_gap_s: float = field(default=0.2, metadata={"min": 0.0})
    """In longer gaps of the gyro the source's own turning is taken."""
    metres_per_count: float = 0.0
    """Of the tachometer (six counts per electrical turn); negative if it counts backwards."""
    max_speed_m_s: float = field(default=20.0, metadata={"min": 0.0})
    """A tachometer that tells more was reset; that step is left out."""


@dataclass(frozen=True, kw_only=True)
class SourceReport:
    """What was found on the way; None where no gyro was used."""

    gyro_bias_rad_s: float | None = None
    still_s: float = 0.0
    gyro_gaps: int = 0
    gyro_gap_s: float = 0.0
    source_gaps: int = 0
    tachometer_resets: int = 0

    def __str__(self) -> str:
        """One line for a person."""
        if self.gyro_bias_rad_s is None:
            return f"gaps of the odometry: {self.source_gaps}"
        told = [
            f"gyro bias {np.degrees(self.gyro_bias_rad_s):.3f} deg/s "
            + (f"({self.still_s:.1f} s standing)" if self.still_s else "(the car never stood)"),
            f"gaps of the gyro: {self.gyro_gaps} ({self.gyro_gap_s:.1f} s)",
            f"gaps of the odometry: {self.source_gaps}",
        ]
        if self.tachometer_resets:
            told.append(f"resets of the tachometer: {self.tachometer_resets}")
        return ", ".join(told)


def odometry_of(
    session: Session, source: str | None, config: SourceConfig | None = None
) -> tuple[Odometry, SourceReport]:
    """The odometry that `source` names, and what was found while making it.

    vesc, wheel, zed, viso, ... : as the session has it (None: the preferred one); imu+vesc, ... :
    its translation with the turning of the gyro; imu+tachometer : the distance counted by the motor
    controller with the turning of the gyro. Raises `MissingStreamError`, naming what the session
    has, and `UsageError` for words that name no source.
    """
    config = config or SourceConfig()
    if source is None or not source.startswith(IMU_PREFIX):
        if source is not None and (source == TACHOMETER or "+" in source or not source):
            raise UsageError(_no_source(session, source))
        driven = session.odometry(source)
        return driven, SourceReport(source_gaps=_count_gaps(driven.t_ns, config.max_gap_s))
    translation = source.removeprefix(IMU_PREFIX)
    if not translation or "+" in translation:
        raise UsageError(_no_source(session, source))
    if translation != TACHOMETER:
        return gyro_aided(session.odometry(translation), session.imu(), config)
    counted, resets = counted_odometry(session.vesc_state(), config)
    driven, report = gyro_aided(counted, session.imu(), config)
    return driven, replace(report, tachometer_resets=resets)


def gyro_aided(odometry: Odometry, imu: Imu, config: SourceConfig) -> tuple[Odometry, SourceReport]:
    """Odometry at its own stamps and the gyro's, turning as the gyro's z axis says.

    Each small step keeps its length and its direction against the middle heading of the step, so
    that driving backwards and sliding stay what they are. No heading changes while the car stands.
    Raises `SlamError` when the gyro was not on while the car drove.
    """
    gyro_ns, rate = _gyro(imu, odometry, config)
    still = _still(odometry, config)
    bias, still_s = _bias(odometry.t_ns, still, gyro_ns, rate, config)
    inside = (gyro_ns >= odometry.t_ns[0]) & (gyro_ns <= odometry.t_ns[-1])
    t_ns = np.union1d(odometry.t_ns, gyro_ns[inside])
    driven = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    poses = driven.interpolated(t_ns).poses
    step = between(poses[:-1], poses[1:])
    covered = _within(gyro_ns, t_ns, config.max_gap_s)
    stands = still[np.searchsorted(odometry.t_ns, t_ns[:-1], side="right") - 1]
    turn = np.where(covered, np.diff(_turned(gyro_ns, rate - bias, t_ns)), step[:, 2])
    turn = np.where(stands, 0.0, turn)
    speed = np.interp(_seconds(t_ns, t_ns), _seconds(odometry.t_ns, t_ns), odometry.speed_m_s)
    yaw_rate = turn / (np.diff(t_ns) * 1e-9)
    made = Odometry(
        f"{IMU_PREFIX}{odometry.source}",
        t_ns,
        _with_turns(poses[0], step, turn),
        speed,
        np.append(yaw_rate, yaw_rate[-1:] if yaw_rate.size else 0.0),
    )
    open_ns = np.diff(t_ns)[~covered]
    return made, SourceReport(
        gyro_bias_rad_s=bias,
        still_s=still_s,
        gyro_gaps=int(np.count_nonzero(np.diff(np.append(True, covered).astype(np.int8)) < 0)),
        gyro_gap_s=float(open_ns.sum()) * 1e-9,
        source_gaps=_count_gaps(odometry.t_ns, config.max_gap_s),
    )


def counted_odometry(state: VescState, config: SourceConfig) -> tuple[Odometry, int]:
    """Straight odometry as far as the tachometer counted, and how often that was reset.

    Raises `UsageError` when nobody said how far a count is.
    """
    if config.metres_per_count == 0.0:
        raise UsageError(
            "imu+tachometer needs metres_per_count: drive a measured distance and divide it by the "
            "counts (six per electrical turn of the motor)"
        )
    period_s = np.diff(state.t_ns) * 1e-9
    step = np.diff(state.tachometer) * config.metres_per_count
    reset = ~(np.abs(step) <= config.max_speed_m_s * period_s)
    step[reset] = 0.0
    pose = np.zeros((state.t_ns.size, 3))
    pose[1:, 0] = np.cumsum(step)
    speed = step / period_s
    speed = np.append(speed, speed[-1:] if speed.size else 0.0)
    counted = Odometry(TACHOMETER, state.t_ns, pose, speed, np.zeros(state.t_ns.size))
    return counted, int(np.count_nonzero(reset))


def _no_source(session: Session, source: str) -> str:
    has = ", ".join(session.odometry_sources) or "none"
    return (
        f"--odometry {source}: no such source; expected a stream (this session has: {has}), "
        f"{IMU_PREFIX}STREAM or {IMU_PREFIX}{TACHOMETER}"
    )


def _gyro(imu: Imu, odometry: Odometry, config: SourceConfig) -> tuple[Stamps, Floats]:
    """Stamps and turn rate of the finite samples, once it is sure that they concern the drive."""
    rate = imu.angular_velocity_rad_s[:, 2]
    told = np.isfinite(rate)
    t_ns, rate = imu.t_ns[told] + round(config.imu_offset_s * 1e9), rate[told]
    if t_ns.size < 2 or t_ns[-1] <= odometry.t_ns[0] or t_ns[0] >= odometry.t_ns[-1]:
        covers = f"{t_ns[0] * 1e-9:.3f} to {t_ns[-1] * 1e-9:.3f} s" if t_ns.size else "nothing"
        raise SlamError(
            f"the gyro covers {covers} and odometry {odometry.source!r} "
            f"{odometry.t_ns[0] * 1e-9:.3f} to {odometry.t_ns[-1] * 1e-9:.3f} s: its turning "
            f"cannot be taken from the gyro; use --odometry {odometry.source}"
        )
    return t_ns, rate


def _still(odometry: Odometry, config: SourceConfig) -> Mask:
    """(n,): whether the car stands from each sample of the odometry to the next."""
    slow = (np.abs(odometry.speed_m_s) <= config.still_speed_m_s) & (
        np.abs(odometry.yaw_rate_rad_s) <= config.still_yaw_rate_rad_s
    )
    still = np.append(slow[:-1] & slow[1:], False)
    edges = np.flatnonzero(np.diff(still.astype(np.int8), prepend=0))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if odometry.t_ns[end] - odometry.t_ns[start] < config.still_s * 1e9:
            still[start:end] = False
    return still


def _bias(
    t_ns: Stamps, still: Mask, gyro_ns: Stamps, rate: Floats, config: SourceConfig
) -> tuple[float, float]:
    """Bias of the gyro [rad/s] and for how long the car stood while it was measured [s]."""
    still_s = float(np.diff(t_ns)[still[:-1]].sum()) * 1e-9
    if config.gyro_bias_rad_s is not None:
        return config.gyro_bias_rad_s, still_s
    row = np.searchsorted(t_ns, gyro_ns, side="right") - 1
    standing = (row >= 0) & still[np.maximum(row, 0)]
    # The median: a push while the car stands is no bias.
    return (float(np.median(rate[standing])), still_s) if standing.any() else (0.0, 0.0)


def _turned(gyro_ns: Stamps, rate: Floats, t_ns: Stamps) -> Floats:
    """How far the gyro has turned up to each stamp (trapezoids), held outside of its samples."""
    own_s = _seconds(gyro_ns, t_ns)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(own_s)
    turned: Floats = np.interp(
        _seconds(t_ns, t_ns), own_s, np.concatenate([[0.0], np.cumsum(steps)])
    )
    return turned


def _within(own_ns: Stamps, t_ns: Stamps, max_gap_s: float) -> Mask:
    """(n - 1,): whether the step from each of `t_ns` to the next lies in no gap of `own_ns`."""
    after = np.searchsorted(own_ns, t_ns[:-1], side="right")
    inside = (after > 0) & (after < own_ns.size)
    last = own_ns.size - 1
    gap_ns = own_ns[np.minimum(after, last)] - own_ns[np.clip(after - 1, 0, last)]
    return inside & (gap_ns <= max_gap_s * 1e9)


def _with_turns(start: Floats, step: Floats, turn: Floats) -> Floats:
    """Poses (n, 3) from `start` by steps (n - 1, 3), given in the car's frame, turned otherwise."""
    heading = start[2] + np.concatenate([[0.0], np.cumsum(turn)])
    direction = heading[:-1] + 0.5 * (turn - step[:, 2])
    cos, sin = np.cos(direction), np.sin(direction)
    x = np.cumsum(np.append(start[0], cos * step[:, 0] - sin * step[:, 1]))
    y = np.cumsum(np.append(start[1], sin * step[:, 0] + cos * step[:, 1]))
    return np.stack([x, y, wrap(heading)], axis=1)


def _seconds(t_ns: Stamps, origin_ns: Stamps) -> Floats:
    seconds: Floats = (t_ns - origin_ns[0]) * 1e-9
    return seconds


def _count_gaps(t_ns: Stamps, max_gap_s: float) -> int:
    return int(np.count_nonzero(np.diff(t_ns) > max_gap_s * 1e9))
