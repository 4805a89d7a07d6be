from __future__ import annotations

import io

from capture.recording.facts import Losses
from capture.recording.live_view import LiveView, alarm_line
from capture.recording.status import State, StreamStatus


def status(state: State = "ok", rate_hz: float = 10.0, error: str = "") -> StreamStatus:
    losses = Losses(bad_frames=3, refused=1, lost_samples=2, last_error=error)
    return StreamStatus("lidar", state, 10.0, rate_hz, 2.5, 120, 0.11, losses, {})


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_where_nobody_watches_only_changes_are_told() -> None:
    out, now_s = io.StringIO(), [0.0]
    with LiveView(out, lambda: now_s[0]) as view:
        view.show([status()], "1 s")
        view.show([status("silent")], "2 s")
        view.show([status("silent")], "3 s")
        view.show([status()], "4 s")
    assert out.getvalue().splitlines() == [
        "lidar ALARM: nothing for 2.5 s",
        "lidar gives data",
    ]


def test_where_nobody_watches_a_line_comes_every_five_seconds() -> None:
    out, now_s = io.StringIO(), [0.0]
    with LiveView(out, lambda: now_s[0]) as view:
        for second in range(11):
            now_s[0] = float(second)
            view.show([status(rate_hz=9.96)], f"{second} s, 20.0 GB free")
    assert out.getvalue().splitlines() == [
        "5 s, 20.0 GB free: lidar 10.0 Hz",
        "10 s, 20.0 GB free: lidar 10.0 Hz",
    ]


def test_on_a_terminal_stands_a_table_and_an_alarm_rings() -> None:
    out = Terminal()
    with LiveView(out) as view:
        view.show([status()], "12 s, 20.0 GB free")
        assert "\a" not in out.getvalue()
        view.show([status("lost", error="the device is gone")], "13 s, 20.0 GB free")
    for text in ("lidar", "10 Hz", "13 s, 20.0 GB free", "lost", "\a"):
        assert text in out.getvalue()


def test_an_alarm_says_what_happened() -> None:
    assert alarm_line(status("slow", 7.0)) == "lidar is slow: 7.0 Hz of 10 Hz"
    assert "being tried again: cable" in alarm_line(status("lost", error="cable"))
