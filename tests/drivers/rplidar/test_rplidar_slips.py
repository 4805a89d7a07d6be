from __future__ import annotations

import numpy as np

from drivers import Tick
from drivers.rplidar.slips import SlipWatch


def ticks(late_ms: list[float], *, epoch: int = 0, first: int = 0) -> list[Tick]:
    """Ticks every 10 ms of device time, each so late."""
    return [
        Tick(device, device + round(late * 1e6), 0, epoch)
        for place, late in enumerate(late_ms)
        for device in [10_000_000 * (first + place)]
    ]


def slips(all_ticks: list[Tick]) -> list[int]:
    """At which of them a slip was seen."""
    watch = SlipWatch()
    return [place for place, tick in enumerate(all_ticks) if watch.has_slipped((tick,))]


def test_a_lateness_that_stays_is_a_slip_seen_once() -> None:
    seen = slips(ticks([0.0] * 100 + [6.0] * 200))
    assert len(seen) == 1
    assert 125 <= seen[0] <= 155


def test_late_packets_are_none_as_long_as_some_are_early() -> None:
    late = np.random.default_rng(0).exponential(3.0, 1000)
    late[::10] = 0.0
    assert slips(ticks(late.tolist())) == []


def test_a_crystal_that_drifts_is_none() -> None:
    assert slips(ticks((np.arange(5000) * 10.0 * 300e-6).tolist())) == []


def test_a_new_epoch_begins_anew() -> None:
    assert slips([*ticks([0.0] * 100), *ticks([60.0] * 100, epoch=1, first=100)]) == []


def test_nothing_is_no_slip() -> None:
    assert not SlipWatch().has_slipped(())
