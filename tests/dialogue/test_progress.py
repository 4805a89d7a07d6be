"""Progress with a clock that we turn, on a terminal and elsewhere."""

from __future__ import annotations

import io

import pytest

from dialogue import Progress

HIDE_CURSOR, SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    for name in ("NO_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    return Terminal()


def test_quick_work_is_silent() -> None:
    stream, clock = io.StringIO(), Clock()
    with Progress("reading", 10, stream=stream, clock_s=clock) as progress:
        for _ in range(10):
            clock.now_s += 0.4
            progress.advance()
    assert stream.getvalue() == ""


def test_long_work_speaks_every_five_seconds() -> None:
    stream, clock = io.StringIO(), Clock()
    with Progress("reading", 20, stream=stream, clock_s=clock) as progress:
        for _ in range(12):
            clock.now_s += 1.0
            progress.advance()
    assert stream.getvalue().splitlines() == [
        "reading: 5/20, 1.0/s, 15 s left",
        "reading: 10/20, 1.0/s, 10 s left",
    ]


def test_steps_may_be_many() -> None:
    stream, clock = io.StringIO(), Clock()
    with Progress("scans", 1000, stream=stream, clock_s=clock) as progress:
        clock.now_s += 10.0
        progress.advance(250)
    assert stream.getvalue() == "scans: 250/1000, 25.0/s, 30 s left\n"


def test_slow_work_has_a_rate() -> None:
    stream, clock = io.StringIO(), Clock()
    with Progress("sessions", 3, stream=stream, clock_s=clock) as progress:
        clock.now_s += 10.0
        progress.advance()
    assert stream.getvalue() == "sessions: 1/3, 0.1/s, 20 s left\n"


@pytest.mark.parametrize(("total", "steps"), [(2, 3), (0, 0), (5, 0)])
def test_odd_counts_leave_no_negative_time(total: int, steps: int) -> None:
    stream, clock = io.StringIO(), Clock()
    with Progress("odd", total, stream=stream, clock_s=clock) as progress:
        clock.now_s += 6.0
        progress.advance(steps)
    assert stream.getvalue().startswith(f"odd: {steps}/{total}, ")
    assert "-" not in stream.getvalue()


def test_standard_error_is_the_default(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    with Progress("reading", 2, clock_s=clock) as progress:
        clock.now_s += 6.0
        progress.advance()
    written = capsys.readouterr()
    assert written.out == ""
    assert written.err == "reading: 1/2, 0.2/s, 6 s left\n"


def test_a_terminal_shows_a_bar_with_count_and_rate(terminal: Terminal) -> None:
    clock = Clock()
    with Progress("[turn_low_1] scans", 8, stream=terminal, clock_s=clock) as progress:
        clock.now_s += 2.0
        progress.advance(3)
        clock.now_s += 2.0
        progress.advance(5)
    text = terminal.getvalue()
    for part in ("[turn_low_1] scans", "8/8", "2.0/s"):
        assert part in text


def test_the_terminal_is_left_as_it_was_found(terminal: Terminal) -> None:
    def interrupted_work() -> None:
        with Progress("scans", 8, stream=terminal) as progress:
            progress.advance()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted_work()
    text = terminal.getvalue()
    assert text.count(HIDE_CURSOR) == text.count(SHOW_CURSOR) == 1
    assert text.index(HIDE_CURSOR) < text.index(SHOW_CURSOR)
