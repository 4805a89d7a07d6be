"""Following a recording: looks into its log again and again, until it ends or nothing comes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from capture import Estimate, Session
from slam.algorithms import Request
from slam.online import OnlineSlam, Position
from slam.run import RunReport

LOOK_EVERY_S = 0.05


@dataclass(frozen=True)
class Clock:
    """Time as following needs it: now_ns UTC, as log times are; monotonic_s and sleep to wait."""

    now_ns: Callable[[], int] = time.time_ns
    monotonic_s: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep


@dataclass(frozen=True, eq=False)
class Followed:
    """What came of it; `why` says what ended it."""

    estimate: Estimate
    report: RunReport
    notes: list[str]
    why: str


def follow_session(
    session: Session,
    request: Request,
    name: str,
    *,
    patience_s: float,
    show: Callable[[Position | None], None] = lambda _: None,
    clock: Clock | None = None,
) -> Followed:
    """The estimate of a session while it is being recorded, when the recording has ended.

    It has when its log has got its end, or when that did not grow for `patience_s`, or when the
    user interrupts. `show` is called at every look. Nothing is written. Raises as `OnlineSlam`.
    """
    clock = clock or Clock()
    online, tail = OnlineSlam(request, session.folder, clock.now_ns), session.log_tail()
    grew_s, why = clock.monotonic_s(), "the recording has ended"
    try:
        while not tail.ended:
            before_bytes = tail.done_bytes
            online.take(tail.read())
            show(online.position)
            if tail.done_bytes > before_bytes:
                grew_s = clock.monotonic_s()
            elif clock.monotonic_s() - grew_s >= patience_s:
                why = f"nothing came for {patience_s:g} s; is the recorder still running?"
                break
            else:
                clock.sleep(LOOK_EVERY_S)
    except KeyboardInterrupt:
        why = "stopped by hand"
    return Followed(*online.finish(name), why)
