"""What an emulated VESC turns: a motor that obeys, a function of time, or a recording."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import Protocol

from drivers.port import Chunk
from drivers.vesc.commands import Kind
from drivers.vesc.framing import FrameReceiver
from drivers.vesc.odometry import COUNTS, ERPM_PER_COUNT_S
from drivers.vesc.requests import ReadId
from drivers.vesc.values import VescValues

VOLTAGE_V = 11.7
ERPM_PER_DUTY = 48_000.0
"""Of the car in data/vesc: duty -0.11 at 11.7 V is -5312 ERPM."""
ERPM_PER_A = 1500.0
RPM_LAG_S, DRIVE_LAG_S, COAST_LAG_S = 0.1, 0.4, 0.8


class Motor(Protocol):
    """What moves, or stands for it; times never go back."""

    def command(self, kind: Kind, value: float, t_ns: int) -> None:
        """Obey from now on."""

    def values(self, t_ns: int) -> VescValues:
        """The state at a time."""

    def restart(self, t_ns: int) -> None:
        """The VESC has rebooted: its counters begin anew, nothing drives."""


class DrivenMotor:
    """A motor that follows its commands with a first-order lag; its counts are exact integrals.

    tachometer : where it begins, so that a wrap can be tried.
    """

    def __init__(self, *, tachometer: int = 0) -> None:
        self.erpm = 0.0
        self._counts, self._counts_abs = float(tachometer), 0.0
        self._target_erpm, self._lag_s = 0.0, COAST_LAG_S
        self._kind: Kind = "current"
        self._value, self._t_ns = 0.0, 0

    def command(self, kind: Kind, value: float, t_ns: int) -> None:
        """Obey from now on; what does not turn the motor is not for it."""
        self._run(t_ns)
        if kind in ("servo", "alive"):
            return
        self._kind, self._value = kind, value
        if kind == "rpm":
            self._target_erpm, self._lag_s = value, RPM_LAG_S
        elif kind == "duty":
            self._target_erpm, self._lag_s = ERPM_PER_DUTY * value, DRIVE_LAG_S
        elif kind == "current":
            self._target_erpm = ERPM_PER_A * value
            self._lag_s = DRIVE_LAG_S if value else COAST_LAG_S
        else:
            self._target_erpm, self._lag_s = 0.0, COAST_LAG_S / (1.0 + abs(value))

    def values(self, t_ns: int) -> VescValues:
        """The state at a time."""
        self._run(t_ns)
        currents = self._kind not in ("rpm", "duty")
        return VescValues(
            t_ns,
            0,
            fet_celsius=27.6,
            motor_current_a=self._value if currents else 0.0,
            duty=self.erpm / ERPM_PER_DUTY,
            erpm=float(round(self.erpm)),
            input_voltage_v=VOLTAGE_V,
            tachometer=counter_reading(self._counts),
            tachometer_abs=counter_reading(self._counts_abs),
            fault=0,
        )

    def restart(self, t_ns: int) -> None:
        """The VESC has rebooted: its counters begin anew, nothing drives."""
        self.command("current", 0.0, t_ns)
        self._counts = self._counts_abs = 0.0

    def _run(self, t_ns: int) -> None:
        seconds = max(t_ns - self._t_ns, 0) * 1e-9
        self._t_ns = max(t_ns, self._t_ns)
        gap = self.erpm - self._target_erpm
        if self.erpm * self._target_erpm < 0:  # it turns round on its way: count both parts
            turn_s = self._lag_s * math.log(-gap / self._target_erpm)
            if turn_s < seconds:
                self._turn(turn_s)
                self.erpm, seconds = 0.0, seconds - turn_s
        self._turn(seconds)

    def _turn(self, seconds: float) -> None:
        """Closed form of erpm' = (target - erpm) / lag, while the direction stays."""
        gap, left = self.erpm - self._target_erpm, math.exp(-seconds / self._lag_s)
        counts = (self._target_erpm * seconds + gap * self._lag_s * (1.0 - left)) / ERPM_PER_COUNT_S
        self._counts += counts
        self._counts_abs += abs(counts)
        self.erpm = self._target_erpm + gap * left


class SourceMotor:
    """A motor whose state is a function of time (monotonic nanoseconds); it obeys nothing."""

    def __init__(self, source: Callable[[int], VescValues]) -> None:
        self.values = source

    def command(self, kind: Kind, value: float, t_ns: int) -> None:
        """Nothing."""

    def restart(self, t_ns: int) -> None:
        """Nothing."""


class RecordedReplies:
    """The replies in recorded raw bytes, each at its own time after the first question.

    Raises `ValueError` where the bytes hold no reply with values.
    """

    def __init__(self, chunks: Sequence[Chunk]) -> None:
        receiver = FrameReceiver()
        self._replies = [
            (chunk.t_ns, frame.payload)
            for chunk in chunks
            for frame in receiver.feed(chunk.data)
            if frame.payload[0] in (ReadId.VALUES, ReadId.VALUES_SELECTIVE)
        ]
        if not self._replies:
            raise ValueError("these bytes hold no reply of a VESC; expected those of /raw/vesc")
        self._times = [t_ns - self._replies[0][0] for t_ns, _ in self._replies]
        self._start_ns: int | None = None

    @property
    def first(self) -> bytes:
        """The payload of the first one."""
        return self._replies[0][1]

    def payload(self, t_ns: int) -> bytes | None:
        """The next one at this time; None when the recording is over."""
        if self._start_ns is None:
            self._start_ns = t_ns
        at = bisect_left(self._times, t_ns - self._start_ns)
        return self._replies[at][1] if at < len(self._replies) else None


def counter_reading(counts: float) -> int:
    """What a 32-bit counter that wraps shows of so many counts."""
    return (math.floor(counts) + COUNTS // 2) % COUNTS - COUNTS // 2
