"""One filter on a recording that is still growing: odometry and scans in the order of time."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from capture import Arrived, extended, no_odometry, split
from geometry import Trajectory
from slam.interface import Slam
from slam.live_scans import ScanReader, WaitingScan, WaitingScans
from slam.live_sources import LiveOdometry
from slam.stepping import Stepper, steps_between

KEPT_NS = 3_000_000_000
"""So far back odometry is kept: further than any revolution reaches."""


class LiveRun:
    """Steps the filter as far as odometry and scans have come; `stepper` is None before that.

    taken : is told of every scan that was taken, and the seconds of computing for it.
    outside : scans outside the time of the odometry; cpu_s : computing in all.
    """

    def __init__(
        self,
        slam: Slam,
        path_period_s: float,
        source: LiveOdometry,
        reader: ScanReader,
        taken: Callable[[WaitingScan, float], None],
    ) -> None:
        self.source, self.reader = source, reader
        self.waiting = WaitingScans()
        self.stepper: Stepper | None = None
        self.start_ns = 0
        self.outside = 0
        self._slam, self._path_period_s, self._taken = slam, path_period_s, taken
        self._driven = no_odometry("")

    def take(self, new: Arrived, log_t_ns: int, *, last: bool) -> None:
        """Take what arrived; `log_t_ns` is how far the log was read, `last` that it ends there."""
        self._driven = extended(self._driven, self.source.take(new, log_t_ns, last=last))
        self.waiting.add(self.reader.arrived(new))
        if not self._driven.t_ns.size:
            return
        if self.stepper is None:
            self.start_ns = int(self._driven.t_ns[0])
            self.stepper = Stepper(self._slam, self.start_ns, self._path_period_s)
        while scan := self.waiting.next(int(self._driven.t_ns[-1]), last=last):
            self._see(self.stepper, scan)
        if last:
            self.outside += len(self.waiting)
            self._go_to(self.stepper, int(self._driven.t_ns[-1]))
        self._forget(self.stepper.t_ns - KEPT_NS)

    def _see(self, stepper: Stepper, scan: WaitingScan) -> None:
        if scan.stamp_ns < self.start_ns:
            self.outside += 1
            return
        started_s = perf_counter()
        seen = self.reader.seen(scan, self._driven)
        # As in a finished session a scan that shows nothing is none.
        if seen[0].size:
            self._go_to(stepper, scan.stamp_ns)
            stepper.see(*seen)
        self._taken(scan, perf_counter() - started_s)

    def _go_to(self, stepper: Stepper, t_ns: int) -> None:
        """Follow the odometry up to a time within it."""
        own_ns = self._driven.t_ns
        # From the sample before here, as it would be found in the whole recording.
        first = max(int(np.searchsorted(own_ns, stepper.t_ns)) - 1, 0)
        rows = slice(first, int(np.searchsorted(own_ns, t_ns)) + 1)
        window = Trajectory.from_poses(own_ns[rows], self._driven.pose_odom_base[rows])
        on_the_way = window.t_ns[(window.t_ns > stepper.t_ns) & (window.t_ns < t_ns)]
        ends = np.array([stepper.t_ns, t_ns], np.int64)
        stepper.move(steps_between(window, np.union1d(on_the_way, ends)))

    def _forget(self, before_ns: int) -> None:
        row = int(np.searchsorted(self._driven.t_ns, before_ns)) - 1
        if row > 0:
            self._driven = split(self._driven, row)[1]
