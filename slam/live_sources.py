"""The sources of odometry of `slam.sources`, sample by sample while they are being recorded.

A sample is given out once nothing that comes later can change it. Each block goes on from the one
before it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from capture import (
    Arrived,
    Drive,
    GrowingOdometry,
    Odometry,
    VescState,
    extended,
    no_odometry,
    split,
)
from geometry import Floats, Stamps
from slam.bridging import Bridge
from slam.sources import TACHOMETER, SourceConfig, SourceReport, counted_odometry, steered, wound

COMMAND_DELAY_NS = 200_000_000
"""So long a command may take to get into the log after it was given."""


class LiveOdometry(Protocol):
    """Odometry that comes block by block."""

    @property
    def report(self) -> SourceReport:
        """What was found so far."""

    def take(self, new: Arrived, log_t_ns: int, *, last: bool) -> Odometry:
        """The samples that are final now; `log_t_ns` is how far the log was read."""


class LiveStream:
    """A source as the session has it; lost stretches are bridged, speeds alone are integrated."""

    def __init__(self, source: str, config: SourceConfig) -> None:
        self._source = source
        self._growing, self._bridge = GrowingOdometry(source), Bridge()
        self._gaps = _Gaps(config.max_gap_s)

    @property
    def report(self) -> SourceReport:
        """Gaps and lost stretches."""
        return SourceReport(
            source_gaps=self._gaps.count, lost=self._bridge.lost, lost_s=self._bridge.lost_s
        )

    def take(self, new: Arrived, log_t_ns: int, *, last: bool) -> Odometry:  # noqa: ARG002
        """Samples as soon as it is known whether the source tells poses."""
        block = self._growing.take(new.odometry(self._source), last=last)
        self._gaps.note(block.t_ns)
        return replace(block, pose_odom_base=self._bridge.carried(block))


class LiveTachometer:
    """The distance that the motor controller counted: straight, or as the steering bends it."""

    def __init__(self, config: SourceConfig, *, steers: bool) -> None:
        self._config, self._steers = config, steers
        self._gaps, self._resets = _Gaps(config.max_gap_s), 0
        # The last sample given out and all after it; where it stands, straight and bent.
        self._state: VescState | None = None
        self._given = 0
        self._counted_m = 0.0
        self._pose: Floats = np.zeros(3)
        self._drive = Drive(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))

    @property
    def report(self) -> SourceReport:
        """Gaps of the telemetry and resets of the counter."""
        return SourceReport(source_gaps=self._gaps.count, tachometer_resets=self._resets)

    def take(self, new: Arrived, log_t_ns: int, *, last: bool) -> Odometry:
        """Samples once the next has come, which tells the speed, and the command in force."""
        told = new.vesc_state()
        self._state = told if self._state is None else extended(self._state, told)
        if self._steers:
            self._drive = extended(self._drive, new.drive())
        if self._state is None:
            return no_odometry(TACHOMETER)
        ready = self._state.t_ns.size
        if not last:
            ready -= 1
            if self._steers:
                known_ns = log_t_ns - COMMAND_DELAY_NS
                ready = min(ready, int(np.searchsorted(self._state.t_ns, known_ns)))
        return self._made(ready) if ready > self._given else no_odometry(TACHOMETER)

    def _made(self, ready: int) -> Odometry:
        """The samples before row `ready` that were not given out yet."""
        assert self._state is not None
        # One more row tells the speed of the last.
        state = split(self._state, ready + 1)[0]
        counted, _ = counted_odometry(state, self._config, self._counted_m)
        self._resets += counted_odometry(split(self._state, ready)[0], self._config)[1]
        self._counted_m = float(counted.pose_odom_base[ready - 1, 0])
        made = steered(counted, self._drive, self._config, self._pose) if self._steers else counted
        block = split(split(made, ready)[0], self._given)[1]
        self._pose = block.pose_odom_base[-1]
        self._state, self._given = split(self._state, ready - 1)[1], 1
        self._gaps.note(block.t_ns)
        return wound(block)


class _Gaps:
    """Counts gaps within and between blocks."""

    def __init__(self, max_gap_s: float) -> None:
        self.count = 0
        self._max_ns = max_gap_s * 1e9
        self._last_ns: Stamps = np.zeros(0, np.int64)

    def note(self, t_ns: Stamps) -> None:
        times = np.append(self._last_ns, t_ns)
        self.count += int(np.count_nonzero(np.diff(times) > self._max_ns))
        self._last_ns = times[-1:]
