from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture.clock import ClockFilter, ClockLine, UtcLine, fitted_line, read_clock_pair
from capture.session_info import ClockPair
from drivers import Tick
from geometry import Floats, Stamps

DELAY_NS = 11_500_000
START_NS = 10**15


def arrivals(
    seed: int, n: int, period_ns: float, skew: float, jitter_ns: float
) -> tuple[Stamps, Stamps, Stamps]:
    """Device times, true times on our clock, and arrivals with a delay that is never too short."""
    rng = np.random.default_rng(seed)
    device: Stamps = np.rint(np.arange(n) * period_ns).astype(np.int64)
    true: Stamps = np.rint(device * (1.0 + skew)).astype(np.int64) + START_NS
    late = rng.exponential(jitter_ns, n)
    late[rng.random(n) < 0.02] += 18e6
    return device, true, true + DELAY_NS + np.rint(late).astype(np.int64)


def filtered_error_ms(
    device: Stamps, true: Stamps, arrival: Stamps, max_skew: float = 1e-3
) -> Floats:
    clock = ClockFilter(max_skew=max_skew)
    errors = []
    for d, t, a in zip(device.tolist(), true.tolist(), arrival.tolist(), strict=True):
        clock.observe(Tick(d, a, DELAY_NS))
        assert clock.line is not None
        errors.append((clock.line.ours(d) - t) * 1e-6)
    return np.array(errors)


@pytest.mark.parametrize(
    ("period_ns", "skew", "jitter_ns"),
    [(12.192e6, 35e-6, 0.8e6), (5e6, -80e-6, 0.1e6), (5e6, 0.01, 0.3e6)],
    ids=["lidar", "imu", "imu whose rate is off by 1 %"],
)
def test_the_jitter_of_arrivals_is_taken_out(
    period_ns: float, skew: float, jitter_ns: float
) -> None:
    device, true, arrival = arrivals(1, 5000, period_ns, skew, jitter_ns)
    error_ms = filtered_error_ms(device, true, arrival, 0.02 if skew > 1e-3 else 1e-3)
    raw_ms = (arrival - DELAY_NS - true) * 1e-6
    assert error_ms.std() < 0.1 < raw_ms.std()
    settled = device > 0.5e9
    assert error_ms[settled].std() < 0.05
    assert abs(error_ms[settled].mean()) < 0.02


def test_a_clock_that_drifts_with_temperature_is_followed() -> None:
    device, _, _ = arrivals(2, 40_000, 12.192e6, 0.0, 0.2e6)
    seconds = device * 1e-9
    drift_ns = 20e3 * seconds + 0.05e3 * seconds**2  # 20 ppm, and 0.1 ppm more each second
    true = device + np.rint(drift_ns).astype(np.int64) + START_NS
    late = np.random.default_rng(2).exponential(0.2e6, device.size).astype(np.int64)
    error_ms = filtered_error_ms(device, true, true + DELAY_NS + late)
    assert np.abs(error_ms[seconds > 60]).max() < 0.3


def test_a_device_that_restarts_begins_a_new_line() -> None:
    clock = ClockFilter()
    clock.observe_all([Tick(k * 10**7, START_NS + k * 10**7) for k in range(100)])
    clock.observe(Tick(0, START_NS + 5 * 10**9, epoch=1))
    assert clock.restarts == 1
    assert clock.line is not None
    assert clock.line.ours(0) == START_NS + 5 * 10**9
    before = clock.line_of(0)
    assert before is not None
    assert before.ours(0) == START_NS
    assert clock.line_of(1) == clock.line
    assert clock.line_of(7) is None
    clock.observe(Tick(10**9, START_NS + 6 * 10**9, epoch=1))
    clock.observe(Tick(5 * 10**8, START_NS + 7 * 10**9, epoch=1))  # went back: a restart too
    assert clock.restarts == 2


def test_before_the_first_tick_nothing_is_known() -> None:
    assert ClockFilter().line is None
    with pytest.raises(ValueError, match="no tick"):
        fitted_line([])


def test_jitter_cannot_pretend_a_skew_that_no_crystal_has() -> None:
    ticks = [(0, 5_000_000), (200_000_000, 200_000_000)]  # 5 ms late, then in time
    assert fitted_line(ticks).skew == -1e-3
    assert fitted_line(ticks, 0.05).skew == pytest.approx(-0.025)
    early = fitted_line(ticks[:1])
    assert (early.skew, early.ours(0)) == (0.0, 5_000_000)


points = st.lists(
    st.tuples(st.integers(0, 10**11), st.integers(0, 10**9)), min_size=1, max_size=60, unique=True
)


@given(points)
def test_no_arrival_lies_before_the_line(drawn: Sequence[tuple[int, int]]) -> None:
    ticks = sorted((d, d + late) for d, late in drawn)
    line = fitted_line(ticks)
    # float slopes: a nanosecond over a hundred seconds
    assert all(arrival - line.ours(device) >= -100 for device, arrival in ticks)
    assert min(abs(arrival - line.ours(device)) for device, arrival in ticks) <= 100


def test_a_line_maps_numbers_and_arrays_alike() -> None:
    line = ClockLine(10**9, 7 * 10**18, 1e-4)
    times = np.array([0, 10**9, 4 * 10**9], dtype=np.int64)
    assert line.all_ours(times).tolist() == [line.ours(t) for t in times.tolist()]
    assert line.ours(4 * 10**9) == 7 * 10**18 + 3 * 10**9 + 300_000


def test_utc_goes_on_when_the_system_clock_jumps() -> None:
    line = UtcLine(1000, 5_000_000)
    assert line.utc(2000) == 5_001_000
    assert (
        line.step_ns(ClockPair(monotonic_ns=2000, utc_ns=5_001_000 + 3600 * 10**9)) == 36 * 10**11
    )


def test_the_closest_bracket_of_both_clocks_is_taken() -> None:
    monotonic = iter([0, 900, 1000, 1010, 2000, 2500])
    utc = iter([50, 60, 70])
    pair = read_clock_pair(lambda: next(monotonic), lambda: next(utc), tries=3)
    assert pair == ClockPair(monotonic_ns=1005, utc_ns=60)
