"""`imu+SOURCE` while it is being recorded: the source's translation with the turning of the gyro.

The bias of the gyro is the median of what it told while the car stood so far (offline: in all of
the session). Where a bias is given both agree but for rounding.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from capture import Arrived, Imu, Odometry, extended, joined, no_odometry, split
from geometry import Floats, Stamps, between, compose
from slam.errors import SlamError
from slam.live_sources import LiveOdometry
from slam.sources import (
    Mask,
    SourceConfig,
    SourceReport,
    bias_of,
    gyro_rates,
    slow_samples,
    standing_samples,
    standing_steps,
    turned_by_gyro,
)

SILENT_S = 0.5
"""Beyond its longest gap: a gyro that is not heard for so long has a gap."""


class LiveGyroAided:
    """Waits for the gyro, and while the car is slow until it is known whether it stands."""

    def __init__(self, inner: LiveOdometry, config: SourceConfig) -> None:
        self._inner, self._config = inner, config
        # A window of both that reaches back before the last sample given out.
        self._driven = no_odometry("")
        self._imu = Imu(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
        self._standing_rates: Floats = np.zeros(0)
        self._given_ns: int | None = None
        self._pose: Floats = np.zeros(3)
        self._covered = True
        self._found = SourceReport(gyro_bias_rad_s=bias_of(self._standing_rates, config))

    @property
    def report(self) -> SourceReport:
        """What was found of the gyro and of the source."""
        inner = self._inner.report
        return replace(
            self._found,
            source_gaps=inner.source_gaps,
            tachometer_resets=inner.tachometer_resets,
            lost=inner.lost,
            lost_s=inner.lost_s,
        )

    def take(self, new: Arrived, log_t_ns: int, *, last: bool) -> Odometry:
        """Samples of the source and of the gyro, merged.

        The turn rate of the last is that of a step which may still change; its pose is final.
        Raises `SlamError` when at the end the gyro has told nothing.
        """
        self._driven = joined(self._driven, self._inner.take(new, log_t_ns, last=last))
        self._imu = extended(self._imu, new.imu())
        gyro_ns, rate = gyro_rates(self._imu, self._config)
        if last and not gyro_ns.size:
            raise SlamError(
                "the gyro told nothing: the turning of the odometry cannot be taken from it; "
                "leave imu+ out of --odometry"
            )
        until_ns = self._settled_ns(gyro_ns, log_t_ns, last=last)
        if until_ns is None or until_ns <= (self._given_ns or 0):
            return no_odometry(self._driven.source)
        made = self._made(gyro_ns, rate, until_ns)
        self._forget()
        return made

    def _settled_ns(self, gyro_ns: Stamps, log_t_ns: int, *, last: bool) -> int | None:
        """Until when nothing can change any more; None where that is nowhere yet."""
        t_ns = self._driven.t_ns
        if not t_ns.size or not gyro_ns.size:
            return None
        until_ns = int(t_ns[-1])
        if last:
            return until_ns
        moving = np.flatnonzero(~slow_samples(self._driven, self._config))
        slow_from = int(moving[-1]) + 1 if moving.size else 0
        if slow_from < t_ns.size and until_ns - t_ns[slow_from] < self._config.still_s * 1e9:
            until_ns = int(t_ns[slow_from])
        silent_ns = round((self._config.max_gap_s + SILENT_S) * 1e9)
        return min(until_ns, max(int(gyro_ns[-1]), log_t_ns - silent_ns))

    def _made(self, gyro_ns: Stamps, rate: Floats, until_ns: int) -> Odometry:
        """The samples after those given out, up to a time."""
        driven, given_ns = self._driven, self._given_ns
        still = standing_steps(driven, self._config)
        fresh = (gyro_ns > (given_ns or 0)) & (gyro_ns <= until_ns)
        standing = standing_samples(driven.t_ns, still, gyro_ns) & fresh
        self._standing_rates = np.append(self._standing_rates, rate[standing])
        bias = bias_of(self._standing_rates, self._config)
        made, covered = turned_by_gyro(driven, still, gyro_ns, rate - bias, self._config.max_gap_s)
        first = 0 if given_ns is None else int(np.searchsorted(made.t_ns, given_ns))
        stop = int(np.searchsorted(made.t_ns, until_ns, side="right"))
        stands = still[np.searchsorted(driven.t_ns, made.t_ns[first : stop - 1], side="right") - 1]
        self._note(np.diff(made.t_ns[first:stop]) * 1e-9, stands, covered[first : stop - 1], bias)
        poses = made.pose_odom_base
        if given_ns is not None:
            poses = compose(self._pose, between(poses[first], poses))
            first += 1
        block = split(split(replace(made, pose_odom_base=poses), stop)[0], first)[1]
        if block.t_ns.size:
            self._given_ns, self._pose = int(block.t_ns[-1]), block.pose_odom_base[-1]
        return block

    def _note(self, dt_s: Floats, stands: Mask, covered: Mask, bias: float) -> None:
        found = self._found
        holes = np.diff(np.append(self._covered, covered).astype(np.int8)) < 0
        self._covered = bool(covered[-1]) if covered.size else self._covered
        self._found = replace(
            found,
            gyro_bias_rad_s=bias,
            still_s=found.still_s + float(dt_s[stands].sum()),
            gyro_gaps=found.gyro_gaps + int(np.count_nonzero(holes)),
            gyro_gap_s=found.gyro_gap_s + float(dt_s[~covered].sum()),
        )

    def _forget(self) -> None:
        """Keep what a standstill that goes on, and a gap that is open, must be known from."""
        if self._given_ns is None:
            return
        keep_ns = self._given_ns - round(2e9 * self._config.still_s)
        row = int(np.searchsorted(self._driven.t_ns, keep_ns, side="right")) - 1
        self._driven = split(self._driven, max(row, 0))[1]
        keep_ns = int(self._driven.t_ns[0]) - round(
            1e9 * (self._config.max_gap_s + self._config.imu_offset_s)
        )
        row = int(np.searchsorted(self._imu.t_ns, keep_ns, side="right")) - 1
        self._imu = split(self._imu, max(row, 0))[1]
