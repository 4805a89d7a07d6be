from __future__ import annotations

import threading

from capture.recording.inbox import Inbox


def test_items_come_out_in_the_order_they_went_in() -> None:
    inbox: Inbox[int] = Inbox({"a": 10, "b": 10})
    for item in range(6):
        assert inbox.put("ab"[item % 2], item)
    assert len(inbox) == 6
    assert [inbox.get() for _ in range(6)] == [("ab"[item % 2], item) for item in range(6)]
    assert inbox.high_water == 6


def test_one_source_that_overflows_costs_the_others_nothing() -> None:
    inbox: Inbox[int] = Inbox({"camera": 2, "imu": 2})
    assert [inbox.put("camera", item) for item in range(4)] == [True, True, False, False]
    assert inbox.put("imu", 7)
    assert inbox.refused == {"camera": 2}
    inbox.get()
    assert inbox.put("camera", 9)


def test_get_ends_when_the_inbox_is_closed_and_empty() -> None:
    inbox: Inbox[int] = Inbox({"a": 10})
    inbox.put("a", 1)
    inbox.close()
    assert inbox.get() == ("a", 1)
    assert inbox.get() is None


def test_get_waits_for_another_thread() -> None:
    inbox: Inbox[int] = Inbox({"a": 10})
    got: list[tuple[str, int] | None] = []
    reader = threading.Thread(target=lambda: got.append(inbox.get()))
    reader.start()
    inbox.put("a", 5)
    reader.join(5.0)
    assert got == [("a", 5)]
