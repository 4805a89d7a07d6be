"""What a person sees while recording: a table that is red where something is wrong."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

from capture.recording.status import StreamStatus

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table as RichTable

PLAIN_PERIOD_S = 5.0
BELL = "\a"
COLUMNS = ("device", "state", "asked", "got", "age", "messages", "gap", "bad", "lost")


class LiveView:
    """Shows the streams of a recording; a context manager that leaves the screen as it found it.

    Every change of a state is a line. On a terminal a table stands below that refreshes, and a bell
    rings for each new alarm; elsewhere there is a line every five seconds.
    """

    def __init__(
        self, stream: TextIO | None = None, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = stream or sys.stderr
        self._clock_s = clock_s
        self._spoke_s = clock_s()
        self._states: dict[str, str] = {}
        self._live: Live | None = None

    def __enter__(self) -> LiveView:
        if self._stream.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(file=self._stream), refresh_per_second=4)
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self, statuses: Sequence[StreamStatus], headline: str) -> None:
        """Show how all streams do now, under a line on the whole recording."""
        alarms = [s for s in statuses if s.state != self._states.get(s.device, "ok")]
        self._states = {s.device: s.state for s in statuses}
        for status in alarms:
            self.say(alarm_line(status))
        if self._live is not None:
            self._live.update(_rich_table(statuses, headline))
            if any(s.state in ("silent", "lost") for s in alarms):
                self._live.console.file.write(BELL)
            return
        now_s = self._clock_s()
        if now_s - self._spoke_s >= PLAIN_PERIOD_S:
            self._spoke_s = now_s
            self.say(f"{headline}: {', '.join(_short(s) for s in statuses)}")

    def say(self, text: str) -> None:
        """One line to the person, above the table."""
        if self._live is not None:
            self._live.console.out(text, style="bold")
            return
        self._stream.write(text + "\n")
        self._stream.flush()


def alarm_line(status: StreamStatus) -> str:
    """One line on a stream whose state has changed."""
    told = {
        "ok": "gives data",
        "starting": "is starting",
        "slow": f"is slow: {status.rate_hz:.1f} Hz of {status.asked_hz or 0:g} Hz",
        "silent": f"ALARM: nothing for {status.age_s:.1f} s",
        "lost": f"ALARM: gone, being tried again: {status.losses.last_error}",
    }
    return f"{status.device} {told[status.state]}"


def _short(status: StreamStatus) -> str:
    return f"{status.device} {status.rate_hz:.1f} Hz"


def cells(status: StreamStatus) -> tuple[str, ...]:
    """A stream as the texts under `COLUMNS`."""
    losses = status.losses
    return (
        status.device,
        status.state,
        "-" if status.asked_hz is None else f"{status.asked_hz:g} Hz",
        f"{status.rate_hz:.1f} Hz",
        f"{status.age_s:.1f} s",
        str(status.messages),
        f"{status.longest_gap_s:.2f} s",
        str(losses.bad_frames),
        str(losses.refused + losses.lost_samples),
    )


def _rich_table(statuses: Sequence[StreamStatus], headline: str) -> RichTable:
    from rich.table import Table as RichTable

    table = RichTable(*COLUMNS, title=headline, title_justify="left")
    for status in statuses:
        table.add_row(*cells(status), style=_STYLES[status.state])
    return table


_STYLES = {
    "ok": "",
    "starting": "dim",
    "slow": "yellow",
    "silent": "bold red",
    "lost": "bold red",
}
