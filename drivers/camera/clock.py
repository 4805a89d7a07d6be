"""The clock by which a camera without a port is paced: the machine's, or one that costs no time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Monotonic time and the patience to let it pass; every `drivers.Port` is one."""

    def now_ns(self) -> int:
        """Monotonic time."""

    def pause(self, seconds: float) -> None:
        """Let that time pass."""


class RealClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """`time.monotonic_ns()`."""
        return time.monotonic_ns()

    def pause(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)


class FreeClock:
    """A clock that passes only while one waits on it, and then at once."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        """The time that has been waited for."""
        return self._now_ns

    def pause(self, seconds: float) -> None:
        """Be that much later."""
        self._now_ns += max(round(seconds * 1e9), 0)
