"""Where the odometry comes from: a stream of the session, or one whose turning the gyro measures.

Wheels tell well how far a car went and badly how far it turned (tyres slip, steering has play);
a gyro tells turning well once its bias is known. `imu+SOURCE` takes each from where it is good.
(`slam.live_sources` does the same with streams that are still growing, with the functions of here.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from capture import Drive, Imu, Odometry, Session, VescState
from dialogue import UsageError
from geometry import Floats, Stamps, Trajectory, between, wrap
from slam.bridging import Bridge
from slam.errors import SlamError

Mask = npt.NDArray[np.bool_]

IMU_PREFIX = "imu+"
TACHOMETER = "tachometer"


@dataclass(frozen=True, kw_only=True)
class SourceConfig:
    """How odometry is put together."""

    gyro_bias_rad_s: float | None = None
    """None: the median of the gyro while the car stands."""
    gyro_usual_bias_rad_s: float = 0.0
    """Taken where nobody said and the car never stood."""
    gyro_scale: float = field(default=1.0, metadata={"min": 0.5, "max": 2.0})
    """True turn for each turn that the gyro tells; biases are of the scaled rate."""
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
    wheelbase_m: float = field(default=0.0, metadata={"min": 0.0})
    """Between the axles; 0: nobody said."""
    steering_offset_rad: float = 0.0
    """What is commanded when the car drives straight."""
    steering_scale: float = 1.0
    """Angle of the wheels for each angle that is commanded beyond that."""
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
    lost: int = 0
    lost_s: float = 0.0

    @property
    def remarkable(self) -> bool:
        """Whether there is anything to tell a person."""
        faults = (self.source_gaps, self.tachometer_resets, self.lost)
        return self.gyro_bias_rad_s is not None or any(faults)

    def __str__(self) -> str:
        """One line for a person."""
        told = []
        if self.gyro_bias_rad_s is not None:
            told += [
                f"gyro bias {np.degrees(self.gyro_bias_rad_s):.3f} deg/s "
                + (f"({self.still_s:.1f} s standing)" if self.still_s else "(the car never stood)"),
                f"gaps of the gyro: {self.gyro_gaps} ({self.gyro_gap_s:.1f} s)",
            ]
        told.append(f"gaps of the odometry: {self.source_gaps}")
        if self.lost:
            told.append(
                f"the odometry was lost {self.lost} times ({self.lost_s:.1f} s), there the car is "
                "taken to have gone on as before"
            )
        if self.tachometer_resets:
            told.append(f"resets of the tachometer: {self.tachometer_resets}")
        return ", ".join(told)


def odometry_of(
    session: Session, source: str | None, config: SourceConfig | None = None
) -> tuple[Odometry, SourceReport]:
    """The odometry that `source` names, and what was found while making it.

    vesc, wheel, zed, viso, ... : as the session has it (None: the preferred one), bridged where it
    says that it was lost; tachometer : the distance counted by the motor controller with the
    turning that the commanded steering gives; imu+vesc, ..., imu+tachometer : that distance with
    the turning of the gyro. Raises `MissingStreamError`, naming what the session has, and
    `UsageError` for words that name no source.
    """
    config = config or SourceConfig()
    own, aided = parsed_source(source, session.odometry_sources)
    if own == TACHOMETER:
        driven, resets = counted_odometry(session.vesc_state(), config)
        report = SourceReport(tachometer_resets=resets)
        if not aided:
            driven = wound(steered(driven, session.drive(), config))
    else:
        driven, report = _bridged(session.odometry(own))
    gaps = _count_gaps(driven.t_ns, config.max_gap_s)
    if not aided:
        return driven, replace(report, source_gaps=gaps)
    driven, found = gyro_aided(driven, session.imu(), config)
    return driven, replace(
        found,
        tachometer_resets=report.tachometer_resets,
        lost=report.lost,
        lost_s=report.lost_s,
    )


def parsed_source(source: str | None, known: Sequence[str]) -> tuple[str | None, bool]:
    """The stream of a source (or `tachometer`, or None), and whether the gyro turns it.

    Raises `UsageError`, naming the `known` streams, for words that name no source.
    """
    if source is None:
        return None, False
    own = source.removeprefix(IMU_PREFIX)
    if not own or "+" in own:
        raise UsageError(
            f"--odometry {source}: no such source; expected a stream (this session has: "
            f"{', '.join(known) or 'none'}), {TACHOMETER}, {IMU_PREFIX}STREAM or "
            f"{IMU_PREFIX}{TACHOMETER}"
        )
    return own, own != source


def gyro_aided(odometry: Odometry, imu: Imu, config: SourceConfig) -> tuple[Odometry, SourceReport]:
    """Odometry at its own stamps and the gyro's, turning as the gyro's z axis says.

    Each small step keeps its length and its direction against the middle heading of the step, so
    that driving backwards and sliding stay what they are. No heading changes while the car stands.
    Raises `SlamError` when the gyro was not on while the car drove.
    """
    gyro_ns, rate = gyro_rates(imu, config)
    _refuse_other_times(gyro_ns, odometry)
    still = standing_steps(odometry, config)
    samples = standing_samples(odometry.t_ns, still, gyro_ns)
    bias = bias_of(rate[samples], config)
    made, covered = turned_by_gyro(odometry, still, gyro_ns, rate - bias, config.max_gap_s)
    return made, SourceReport(
        gyro_bias_rad_s=bias,
        still_s=float(np.diff(odometry.t_ns)[still[:-1]].sum()) * 1e-9,
        gyro_gaps=int(np.count_nonzero(np.diff(np.append(True, covered).astype(np.int8)) < 0)),
        gyro_gap_s=float(np.diff(made.t_ns)[~covered].sum()) * 1e-9,
        source_gaps=_count_gaps(odometry.t_ns, config.max_gap_s),
    )


def turned_by_gyro(
    odometry: Odometry, still: Mask, gyro_ns: Stamps, rate_rad_s: Floats, max_gap_s: float
) -> tuple[Odometry, Mask]:
    """Odometry (n,) that turns as a gyro without bias says, and which steps (n - 1,) it covers.

    still : whether the car stands from each sample of the odometry to the next.
    """
    inside = (gyro_ns >= odometry.t_ns[0]) & (gyro_ns <= odometry.t_ns[-1])
    t_ns = np.union1d(odometry.t_ns, gyro_ns[inside])
    driven = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    poses = driven.interpolated(t_ns).poses
    step = between(poses[:-1], poses[1:])
    covered = _within(gyro_ns, t_ns, max_gap_s)
    stands = still[np.searchsorted(odometry.t_ns, t_ns[:-1], side="right") - 1]
    turn = np.where(covered, np.diff(_turned(gyro_ns, rate_rad_s, t_ns)), step[:, 2])
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
    return wound(made), covered


def counted_odometry(
    state: VescState, config: SourceConfig, start_m: float = 0.0
) -> tuple[Odometry, int]:
    """Straight odometry as far as the tachometer counted, and how often that was reset.

    Raises `UsageError` when nobody said how far a count is.
    """
    if config.metres_per_count == 0.0:
        raise UsageError(
            "the tachometer needs metres_per_count: drive a measured distance and divide it by the "
            "counts (six per electrical turn of the motor), then "
            "--set odometry.metres_per_count=..."
        )
    period_s = np.diff(state.t_ns) * 1e-9
    step = np.diff(state.tachometer) * config.metres_per_count
    reset = ~(np.abs(step) <= config.max_speed_m_s * period_s)
    step[reset] = 0.0
    pose = np.zeros((state.t_ns.size, 3))
    pose[:, 0] = np.cumsum(np.append(start_m, step))[: state.t_ns.size]
    speed = step / period_s
    speed = np.append(speed, speed[-1:] if speed.size else 0.0)[: state.t_ns.size]
    counted = Odometry(TACHOMETER, state.t_ns, pose, speed, np.zeros(state.t_ns.size))
    return counted, int(np.count_nonzero(reset))


def steered(
    counted: Odometry, drive: Drive, config: SourceConfig, start: Floats | None = None
) -> Odometry:
    """Straight odometry bent as the commanded steering bends it, from pose `start` (3,) on.

    Headings are not wrapped.

    The middle of the rear axle goes round with curvature tan(steering) / wheelbase (Ackermann, as
    one wheel per axle); a command holds until the next, before the first the wheels are straight.
    Raises `UsageError` when nobody said how long the wheelbase is.
    """
    if config.wheelbase_m == 0.0:
        raise UsageError(
            "--odometry tachometer turns by the steering and needs the wheelbase: measure from "
            "axle to axle, then --set odometry.wheelbase_m=...; or use --odometry imu+tachometer"
        )
    row = np.searchsorted(drive.t_ns, counted.t_ns, side="right") - 1
    angle = drive.steering_rad[np.maximum(row, 0)] if drive.t_ns.size else np.zeros(row.size)
    angle = np.where((row >= 0) & np.isfinite(angle), angle - config.steering_offset_rad, 0.0)
    curvature = np.tan(config.steering_scale * angle) / config.wheelbase_m
    step = np.zeros((max(counted.t_ns.size - 1, 0), 3))
    step[:, 0] = np.diff(counted.pose_odom_base[:, 0])
    turn = step[:, 0] * curvature[:-1]
    pose = _with_turns(np.zeros(3) if start is None else start, step, turn)
    return replace(counted, pose_odom_base=pose, yaw_rate_rad_s=counted.speed_m_s * curvature)


def _bridged(told: Odometry) -> tuple[Odometry, SourceReport]:
    bridge = Bridge()
    poses = bridge.carried(told)
    report = SourceReport(lost=bridge.lost, lost_s=bridge.lost_s)
    return replace(told, pose_odom_base=poses), report


def gyro_rates(imu: Imu, config: SourceConfig) -> tuple[Stamps, Floats]:
    """Stamps and scaled turn rate (n,) of the finite samples, on the clock of the odometry."""
    rate = imu.angular_velocity_rad_s[:, 2] * config.gyro_scale
    told = np.isfinite(rate)
    return imu.t_ns[told] + round(config.imu_offset_s * 1e9), rate[told]


def _refuse_other_times(t_ns: Stamps, odometry: Odometry) -> None:
    if t_ns.size < 2 or t_ns[-1] <= odometry.t_ns[0] or t_ns[0] >= odometry.t_ns[-1]:
        covers = f"{t_ns[0] * 1e-9:.3f} to {t_ns[-1] * 1e-9:.3f} s" if t_ns.size else "nothing"
        raise SlamError(
            f"the gyro covers {covers} and odometry {odometry.source!r} "
            f"{odometry.t_ns[0] * 1e-9:.3f} to {odometry.t_ns[-1] * 1e-9:.3f} s: its turning "
            f"cannot be taken from the gyro; use --odometry {odometry.source}"
        )


def standing_steps(odometry: Odometry, config: SourceConfig) -> Mask:
    """(n,): whether the car stands from each sample of the odometry to the next."""
    slow = slow_samples(odometry, config)
    still = np.append(slow[:-1] & slow[1:], False)
    edges = np.flatnonzero(np.diff(still.astype(np.int8), prepend=0))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if odometry.t_ns[end] - odometry.t_ns[start] < config.still_s * 1e9:
            still[start:end] = False
    return still


def slow_samples(odometry: Odometry, config: SourceConfig) -> Mask:
    """(n,): where the source tells hardly any motion."""
    slow: Mask = (np.abs(odometry.speed_m_s) <= config.still_speed_m_s) & (
        np.abs(odometry.yaw_rate_rad_s) <= config.still_yaw_rate_rad_s
    )
    return slow


def standing_samples(t_ns: Stamps, still: Mask, gyro_ns: Stamps) -> Mask:
    """(m,): which samples of the gyro were taken while the car stood."""
    row = np.searchsorted(t_ns, gyro_ns, side="right") - 1
    standing: Mask = (row >= 0) & still[np.maximum(row, 0)]
    return standing


def bias_of(standing_rate: Floats, config: SourceConfig) -> float:
    """Bias of the gyro [rad/s] from its rates while the car stood; the usual one if never."""
    if config.gyro_bias_rad_s is not None:
        return config.gyro_bias_rad_s
    usual_rad_s = config.gyro_usual_bias_rad_s
    # The median: a push while the car stands is no bias.
    return float(np.median(standing_rate)) if standing_rate.size else usual_rad_s


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
    """Poses (n, 3) from `start` by steps (n - 1, 3), given in the car's frame, turned otherwise.

    Headings are not wrapped, so that it can be gone on with exactly.
    """
    heading = np.cumsum(np.append(start[2], turn))
    direction = heading[:-1] + 0.5 * (turn - step[:, 2])
    cos, sin = np.cos(direction), np.sin(direction)
    x = np.cumsum(np.append(start[0], cos * step[:, 0] - sin * step[:, 1]))
    y = np.cumsum(np.append(start[1], sin * step[:, 0] + cos * step[:, 1]))
    return np.stack([x, y, heading], axis=1)


def wound(odometry: Odometry) -> Odometry:
    """The same with headings in (-pi, pi]."""
    pose = odometry.pose_odom_base.copy()
    pose[:, 2] = wrap(pose[:, 2])
    return replace(odometry, pose_odom_base=pose)


def _seconds(t_ns: Stamps, origin_ns: Stamps) -> Floats:
    seconds: Floats = (t_ns - origin_ns[0]) * 1e-9
    return seconds


def _count_gaps(t_ns: Stamps, max_gap_s: float) -> int:
    return int(np.count_nonzero(np.diff(t_ns) > max_gap_s * 1e9))
