"""Old footage played as a camera: each frame comes when the footage says, on the camera's clock."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.camera.clock import Clock, FreeClock, RealClock
from drivers.camera.frame import Frame, FrameFormat, Stamp
from drivers.device import Counters, Reading


@dataclass(frozen=True)
class Still:
    """One picture of the footage: its number, its own stamp in nanoseconds, and its bytes."""

    sequence: int
    footage_ns: int
    stamp: Stamp
    format: FrameFormat
    data: bytes
    width_px: int
    height_px: int


class Pacer:
    """Turns footage time into ours: the first still comes when it is first asked for.

    `t_ns` of a frame is that moment plus how much later the footage is, whenever it is fetched.
    clock : None for the machine's, or, without `real_time`, one on which waiting takes no time.
    """

    def __init__(self, real_time: bool, clock: Clock | None, counters: Counters) -> None:
        self._clock = clock or (RealClock() if real_time else FreeClock())
        # At the end of fast footage a thread waits in earnest, or it would spin.
        self._idle_clock = clock or RealClock()
        self._counters = counters
        self._shift_ns: int | None = None

    def restart(self) -> None:
        """From the beginning: the next still sets the pace anew."""
        self._shift_ns = None

    def give(self, still: Still, timeout_s: float) -> Reading[Frame] | None:
        """The still as a frame once its time has come; None if that is after the time-out."""
        now_ns = self._clock.now_ns()
        if self._shift_ns is None:
            self._shift_ns = now_ns - still.footage_ns
        due_ns = still.footage_ns + self._shift_ns
        end_ns = now_ns + round(max(timeout_s, 0.0) * 1e9)
        self._wait_until(min(due_ns, end_ns))
        if due_ns > self._clock.now_ns():
            return None
        self._counters.samples += 1
        frame = Frame(
            t_ns=due_ns,
            stamp=still.stamp,
            sequence=still.sequence,
            format=still.format,
            data=still.data,
            width_px=still.width_px,
            height_px=still.height_px,
            arrival_ns=self._clock.now_ns(),
        )
        return Reading(samples=(frame,))

    def idle(self, timeout_s: float) -> None:
        """Wait where there is nothing left to give: a reader must not spin at the end."""
        self._idle_clock.pause(max(timeout_s, 0.0))

    def _wait_until(self, t_ns: int) -> None:
        while (wait_ns := t_ns - self._clock.now_ns()) > 0:
            # Rounded up to microseconds: floats must not end a wait a nanosecond early.
            self._clock.pause(math.ceil(wait_ns / 1000) * 1e-6)
