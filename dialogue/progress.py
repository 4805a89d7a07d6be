"""Progress of long work: a bar with rate and time left, or plain lines when nobody watches."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

PLAIN_PERIOD_S = 5.0


class Progress:
    """Counts `total` steps of one job; a context manager that leaves the screen as it found it.

    On a terminal a rich bar; elsewhere a line every five seconds, so that quick work stays silent.
    Writes to `stream` (standard error by default), never to standard output.
    """

    def __init__(
        self,
        label: str,
        total: int,
        *,
        stream: TextIO | None = None,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._label, self._total, self._done = label, total, 0
        self._stream = stream or sys.stderr
        self._clock_s = clock_s
        self._started_s = self._spoke_s = clock_s()
        self._bar: RichProgress | None = None

    def __enter__(self) -> Progress:
        if self._stream.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as RichBar

            self._bar = RichBar(
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[rate]}"),
                TimeRemainingColumn(),
                console=Console(file=self._stream),
                transient=True,
            )
            self._bar.add_task(self._label, total=self._total, rate="")
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def advance(self, steps: int = 1) -> None:
        """Note that `steps` more are done."""
        self._done += steps
        if self._bar is not None:
            rate = f"{self._rate(self._clock_s()):.1f}/s"
            self._bar.update(self._bar.task_ids[0], advance=steps, rate=rate)
            return
        now_s = self._clock_s()
        if now_s - self._spoke_s >= PLAIN_PERIOD_S:
            self._spoke_s = now_s
            self._stream.write(self._plain_line(now_s) + "\n")

    def _plain_line(self, now_s: float) -> str:
        rate = self._rate(now_s)
        left_s = max(self._total - self._done, 0) / max(rate, 1e-9)
        return f"{self._label}: {self._done}/{self._total}, {rate:.1f}/s, {left_s:.0f} s left"

    def _rate(self, now_s: float) -> float:
        return self._done / max(now_s - self._started_s, 1e-9)
