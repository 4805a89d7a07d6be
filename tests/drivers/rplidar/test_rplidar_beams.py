from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.rplidar import bearing_rad, device_ns, range_m


def test_clockwise_becomes_counter_clockwise_once() -> None:
    # Right of the lidar is 90 degrees on the device (manual fig. 4-7), -90 where y points left.
    angle_q6 = np.array([0, 90 * 64, 180 * 64, 270 * 64, 360 * 64 - 1], np.int32)
    expected = np.radians([0.0, -90.0, 180.0, 90.0, 1.0 / 64.0])
    np.testing.assert_allclose(bearing_rad(angle_q6), expected, rtol=0, atol=1e-15)


@given(st.integers(0, 360 * 64 - 1))
def test_a_bearing_is_minus_the_angle_wrapped(angle_q6: int) -> None:
    bearing = float(bearing_rad(np.array([angle_q6], np.int32))[0])
    assert -np.pi < bearing <= np.pi
    turns = (bearing + np.radians(angle_q6 / 64.0)) / (2.0 * np.pi)
    assert abs(turns - round(turns)) < 1e-12


def test_ranges_are_metres_and_nothing_where_no_echo_came() -> None:
    got = range_m(np.array([0, 1, 4 * 12000], np.int32))
    np.testing.assert_array_equal(got, [np.nan, 0.00025, 12.0])


def test_the_sample_clock_neither_rounds_nor_overflows() -> None:
    day = 86_400 * 10**9 // 127_000
    index = np.array([0, 1, day])
    np.testing.assert_array_equal(device_ns(index, 127 * 256), index * 127_000)
    # 476.5 us: a period that is no whole microsecond.
    np.testing.assert_array_equal(device_ns(np.array([2]), 953 * 128), [953_000])
