"""What a person sees while a recording is followed: one line that is renewed, or one a second."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, TextIO

from slam.online import Position

RENEW_S, PLAIN_S = 0.1, 1.0


class Echo(Protocol):
    """`click.echo`."""

    def __call__(self, message: str, *, nl: bool = True) -> None:
        """Print, with a new line or without."""


class Display:
    """Shows where the car is, through `echo`; a context manager that leaves a whole line behind."""

    def __init__(
        self,
        echo: Echo,
        stream: TextIO | None = None,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._echo, self._clock_s = echo, clock_s
        self._renews = (stream or sys.stdout).isatty()
        self._shown_s = -math.inf
        self._width = 0

    def __enter__(self) -> Display:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._width:
            self._echo("")

    def show(self, position: Position | None) -> None:
        """Show it, if the last line is old enough."""
        now_s = self._clock_s()
        if now_s - self._shown_s < (RENEW_S if self._renews else PLAIN_S):
            return
        self._shown_s = now_s
        text = line(position)
        if self._renews:
            self._echo("\r" + text.ljust(self._width), nl=False)
            self._width = len(text)
        else:
            self._echo(text)


def line(position: Position | None) -> str:
    """Where the car is, in words of one line."""
    if position is None:
        return "waiting for odometry and scans"
    x, y, heading = position.pose.tolist()
    behind = "" if position.age_s is None else f"  {position.age_s:.2f} s behind"
    return (
        f"{position.since_start_s:.1f} s  x {x:.2f} m  y {y:.2f} m  heading "
        f"{math.degrees(heading):.0f} deg  {position.landmarks} landmarks  {position.scans} scans  "
        f"{position.update_s * 1e3:.1f} ms each{behind}"
    )
