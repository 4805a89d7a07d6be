from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence

from drivers import (
    Counters,
    DeviceBack,
    DeviceLost,
    DeviceLostError,
    DeviceReader,
    DriverError,
    NoAnswerError,
    Reading,
)

Taken = Reading[int] | DeviceLost | DeviceBack


class Scripted:
    """A device whose reads and connects give what the script says."""

    name = "scripted device"

    def __init__(
        self, reads: Sequence[int | Exception], connects: Sequence[Exception | None]
    ) -> None:
        self.counters = Counters()
        self.closes = 0
        self._reads, self._connects = list(reads), list(connects)
        self.done = threading.Event()

    def connect(self) -> None:
        error = self._connects.pop(0) if self._connects else None
        if error is not None:
            raise error

    def identify(self) -> Mapping[str, object]:
        return {}

    def read(self, timeout_s: float) -> Reading[int] | None:
        if not self._reads:
            self.done.set()
            threading.Event().wait(min(timeout_s, 0.01))
            return None
        step = self._reads.pop(0)
        if isinstance(step, Exception):
            raise step
        return Reading(samples=(step,))

    def close(self) -> None:
        self.closes += 1


def read_all(device: Scripted) -> list[Taken]:
    taken: list[Taken] = []
    reader: DeviceReader[int] = DeviceReader(device, taken.append, retry_s=(0.001,))
    reader.start()
    assert device.done.wait(10.0)
    assert reader.stop()
    return taken


def test_everything_that_is_read_is_handed_on_in_order() -> None:
    device = Scripted([1, 2, 3], [])
    taken = read_all(device)
    assert [t.samples for t in taken if isinstance(t, Reading)] == [(1,), (2,), (3,)]
    assert device.closes == 1


def test_a_lost_device_is_tried_until_it_is_back() -> None:
    gone, silent = DeviceLostError("gone"), NoAnswerError("still silent")
    device = Scripted([1, gone, 2], [silent, silent, None])
    first, lost, back, second = read_all(device)
    assert isinstance(lost, DeviceLost)
    assert lost.error is gone
    assert isinstance(back, DeviceBack)
    assert back.tries == 3
    assert isinstance(first, Reading)
    assert isinstance(second, Reading)


def test_a_fault_of_ours_is_told_as_one_and_tried_again() -> None:
    device = Scripted([1, ZeroDivisionError("x / 0"), 2], [])
    _, lost, _, second = read_all(device)
    assert isinstance(lost, DeviceLost)
    assert str(lost.error) == "scripted device: a fault of trackside: ZeroDivisionError: x / 0"
    assert isinstance(second, Reading)


def test_stopping_ends_a_reader_that_waits_for_its_device() -> None:
    errors: list[DriverError] = []
    device = Scripted([DeviceLostError("gone")], [NoAnswerError("silent")] * 1000)
    lost = threading.Event()

    def take(item: Taken) -> None:
        if isinstance(item, DeviceLost):
            errors.append(item.error)
            lost.set()

    reader: DeviceReader[int] = DeviceReader(device, take, retry_s=(0.001,))
    reader.start()
    assert lost.wait(10.0)
    assert reader.stop()
    assert device.closes >= 2
    assert len(errors) == 1
