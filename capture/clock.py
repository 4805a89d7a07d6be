"""Times of measurement: device clocks mapped to ours, and ours mapped to UTC.

A device's bytes arrive late by at least its known delay, plus a jitter with a long tail. A straight
line fitted by least squares inherits the mean of the jitter; the lower convex hull of the arrivals
does not (TICSync, Harrison and Newman, ICRA 2011; measured in reference/protocols.md, part E.2).
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from capture.session_info import ClockPair
from drivers import Tick
from geometry import Stamps

Point = tuple[int, int]
"""Device time and the earliest moment on our clock that its arrival allows, in nanoseconds."""

BLOCK_NS = 2_000_000_000
REFIT_NS = 100_000_000
MIN_SPAN_NS = 100_000_000
"""Below this span the slope is taken as 1: jitter would be read as skew."""
MAX_SKEW = 1e-3
"""Of a device with a crystal; far more than any has, and a bound for what jitter may pretend."""


@dataclass(frozen=True)
class UtcLine:
    """Monotonic time <-> UTC through one pair of readings, so that no clock step tears a log."""

    monotonic_ns: int
    utc_ns: int

    def utc(self, monotonic_ns: int) -> int:
        """The UTC time of a monotonic one."""
        return monotonic_ns - self.monotonic_ns + self.utc_ns

    def step_ns(self, pair: ClockPair) -> int:
        """By how much the UTC clock has left this line when `pair` was read."""
        return pair.utc_ns - self.utc(pair.monotonic_ns)


def read_clock_pair(
    monotonic_ns: Callable[[], int] = time.monotonic_ns,
    utc_ns: Callable[[], int] = time.time_ns,
    tries: int = 5,
) -> ClockPair:
    """Both clocks of this machine at one moment: the closest of a few bracketed readings."""
    readings = []
    for _ in range(tries):
        before = monotonic_ns()
        utc = utc_ns()
        after = monotonic_ns()
        readings.append((after - before, (before + after) // 2, utc))
    _, middle, utc = min(readings)
    return ClockPair(monotonic_ns=middle, utc_ns=utc)


@dataclass(frozen=True)
class ClockLine:
    """Our time as a straight line over a device's: `our_origin_ns` at `device_origin_ns`.

    skew : by how much our clock gains on the device's, per device time (0: both run alike).
    """

    device_origin_ns: int
    our_origin_ns: int
    skew: float

    def ours(self, device_ns: int) -> int:
        """Monotonic time of the machine at a device time."""
        since = device_ns - self.device_origin_ns
        # The product is small, so the float holds it to the nanosecond; the rest stays integer.
        return since + self.our_origin_ns + round(since * self.skew)

    def all_ours(self, device_ns: Stamps) -> Stamps:
        """The same for many times, (n,)."""
        since: Stamps = device_ns - self.device_origin_ns
        drift: Stamps = np.rint(since * self.skew).astype(np.int64)
        mapped: Stamps = since + self.our_origin_ns + drift
        return mapped


@dataclass
class ClockFilter:
    """A device's clock as it shows in the arrivals; causal, for ticks in the order of arrival.

    max_skew : how wrong the device's rate can be; window_s : how far back it looks, so that a drift
    with temperature is followed; restarts : how often the device's clock began anew (its epoch
    changed, or it went back).
    """

    max_skew: float = MAX_SKEW
    window_s: float = 60.0
    restarts: int = 0
    _epoch: int | None = None
    _blocks: deque[list[Point]] = field(default_factory=deque)
    _line: ClockLine | None = None
    _past: tuple[int | None, ClockLine | None] = (None, None)
    _fitted_ns: int = 0

    def observe(self, tick: Tick) -> None:
        """Take one pair of device time and arrival."""
        point = (tick.device_ns, tick.arrival_ns - tick.delay_ns)
        last = self._blocks[-1][-1][0] if self._blocks else None
        if tick.epoch != self._epoch or (last is not None and point[0] < last):
            self.restarts += self._epoch is not None
            self._past = self._epoch, self._line
            self._epoch, self._line = tick.epoch, None
            self._blocks.clear()
        if not self._blocks or point[0] - self._blocks[-1][0][0] >= BLOCK_NS:
            self._blocks.append([])
            self._forget(point[0])
        _extend_hull(self._blocks[-1], point)
        if self._line is None or point[0] - self._fitted_ns >= REFIT_NS:
            self._line = fitted_line(chain.from_iterable(self._blocks), self.max_skew)
            self._fitted_ns = point[0]

    def observe_all(self, ticks: Sequence[Tick]) -> None:
        """Take several, oldest first."""
        for tick in ticks:
            self.observe(tick)

    @property
    def line(self) -> ClockLine | None:
        """The present mapping; None before the first tick."""
        return self._line

    def line_of(self, epoch: int) -> ClockLine | None:
        """The mapping of one epoch, the present one or the one before; None for any other."""
        if epoch == self._epoch:
            return self._line
        known, line = self._past
        return line if epoch == known else None

    def _forget(self, now_ns: int) -> None:
        oldest = now_ns - round(self.window_s * 1e9)
        while len(self._blocks) > 1 and self._blocks[0][-1][0] < oldest:
            self._blocks.popleft()


def fitted_line(points: Iterable[Point], max_skew: float = MAX_SKEW) -> ClockLine:
    """The line under all points, in the order of device time, that touches them mid-window.

    That is the segment of their lower hull above the middle, or where this is steeper or flatter
    than `max_skew` allows, the line of that skew. Raises `ValueError` without a point.
    """
    hull: list[Point] = []
    for point in points:
        _extend_hull(hull, point)
    if not hull:
        raise ValueError("no tick, no clock")
    first, last = hull[0][0], hull[-1][0]
    if last - first < MIN_SPAN_NS:
        return _touching(hull, 0.0)
    middle = (first + last) // 2
    right = next(i for i, point in enumerate(hull) if point[0] > middle)
    (d0, a0), (d1, a1) = hull[right - 1], hull[right]
    skew = (a1 - a0) / (d1 - d0) - 1.0
    if abs(skew) > max_skew:
        return _touching(hull, math.copysign(max_skew, skew))
    return ClockLine(d0, a0, skew)


def _touching(hull: Sequence[Point], skew: float) -> ClockLine:
    """The highest line of this skew that lies above no point."""
    start = hull[0][0]
    device_ns, ours_ns = min(
        hull, key=lambda point: point[1] - point[0] - skew * (point[0] - start)
    )
    return ClockLine(device_ns, ours_ns, skew)


def _extend_hull(hull: list[Point], point: Point) -> None:
    """Append a point that is not to the left of the last, keeping the hull convex from below."""
    if hull and hull[-1][0] == point[0]:
        if hull[-1][1] <= point[1]:
            return
        hull.pop()
    while len(hull) >= 2 and _turns_right(hull[-2], hull[-1], point):
        hull.pop()
    hull.append(point)


def _turns_right(a: Point, b: Point, c: Point) -> bool:
    """Whether b lies on or above the line from a to c."""
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])
