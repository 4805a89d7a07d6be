"""Samples that were lost without a trace in the bytes, seen by the time that they took.

Standard nodes have no counter: where whole nodes vanish and the angle goes on less than 45 degrees
further, nothing in the stream tells. But from then on everything comes later than the sample count
says, the earliest packets too.
"""

from __future__ import annotations

from drivers.device import Tick

WINDOW_NS = 250_000_000
SLIP_NS = 2_000_000
"""Above what a busy machine delays even the earliest packet of a window, below a capsule."""


class SlipWatch:
    """Compares how late the earliest packet of each quarter of a second was with the one before."""

    def __init__(self) -> None:
        self._begun_ns = 0
        self._epoch: int | None = None
        self._before_ns: int | None = None
        self._earliest_ns = 0

    def has_slipped(self, ticks: tuple[Tick, ...]) -> bool:
        """Whether a window has just ended that was late from its first packet to its last."""
        for tick in ticks:
            if tick.epoch != self._epoch:
                self._begin(tick)
            late_ns = tick.arrival_ns - tick.device_ns
            if tick.arrival_ns - self._begun_ns < WINDOW_NS:
                self._earliest_ns = min(late_ns, self._earliest_ns)
                continue
            before_ns, self._before_ns = self._before_ns, self._earliest_ns
            self._begun_ns, self._earliest_ns = tick.arrival_ns, late_ns
            if before_ns is not None and self._before_ns - before_ns > SLIP_NS:
                return True
        return False

    def _begin(self, tick: Tick) -> None:
        self._epoch, self._begun_ns, self._before_ns = tick.epoch, tick.arrival_ns, None
        self._earliest_ns = tick.arrival_ns - tick.device_ns
