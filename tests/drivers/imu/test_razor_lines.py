from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Chunk, Counters, DeviceFaultError
from drivers.imu import ImuSample
from drivers.imu.razor import AhrsDecoder, Layout, MillisClock, RazorDecoder
from drivers.imu.razor.columns import (
    EVERY,
    FACTORY,
    WISHED,
    Columns,
    accel_range_g,
    candidates,
)
from drivers.imu.razor.lines import (
    MOST_LINE_BYTES,
    LineReader,
    Row,
    frame_of,
    reply_of,
    row_of,
)

# sparkfun/9DOF_Razor_IMU issue 16, as quoted by reference protocols C.2: time, accelerometer,
# gyro, magnetometer, quaternion, heading.
REAL = (
    b"1996551, 0.01, 0.12, -1.00, 0.73, 0.38, 0.31, 12.15, -66.92, -45.91, "
    b"0.0369, -0.7548, -0.6537, -0.0402, 169.71"
)
REAL_COLUMNS = replace(FACTORY, quaternion=True, heading=True)


def lines(data: bytes, *, cut_at_first: bool = True) -> list[bytes]:
    reader = LineReader(Counters(), cut_at_first=cut_at_first)
    return [line.text for line in reader.feed(data)]


def decode(*chunks: bytes, layout: Layout | None = None) -> tuple[tuple[ImuSample, ...], Counters]:
    counters = Counters()
    decoder = RazorDecoder(layout or Layout(), counters, MillisClock())
    readings = [decoder.feed(Chunk(k, data)) for k, data in enumerate(chunks)]
    return tuple(sample for reading in readings for sample in reading.samples), counters


def raw_line(millis: int, x: int = 0) -> bytes:
    return b"%d, %d, 0, 16384, 1, -2, 3, 100, -20, 300\r\n" % (millis, x)


def test_the_real_line_of_a_user() -> None:
    row = row_of(REAL)
    assert row is not None
    assert len(row.values) == 15
    assert row.decimals == REAL_COLUMNS.decimals()
    samples, _ = decode(b"\n" + REAL + b"\r\n", layout=Layout(REAL_COLUMNS))
    (sample,) = samples
    assert sample.device_ns == 1_996_551_000_000
    assert sample.linear_acceleration_m_s2 == pytest.approx((0.0980665, 1.176798, -9.80665))
    assert sample.angular_velocity_rad_s == pytest.approx(
        (math.radians(0.73), math.radians(0.38), math.radians(0.31))
    )
    # Printed in the AK8963's axes: x_acc = y_mag, y_acc = x_mag, z_acc = -z_mag.
    assert sample.magnetic_field_t == pytest.approx((-66.92e-6, 12.15e-6, 45.91e-6))
    assert sample.orientation_wxyz == pytest.approx((0.0369, -0.7548, -0.6537, -0.0402))


def test_the_real_line_is_told_apart_from_all_other_states() -> None:
    row = row_of(REAL)
    assert row is not None
    later = Row((row.values[0] + 10.0, *row.values[1:]), row.decimals)
    assert candidates([row, later])[0] == REAL_COLUMNS


def test_a_raw_line_at_the_boards_full_scales() -> None:
    data = b"x\r\n5, 2048, -4096, 0, 164, 0, -328, 100, 200, 300\r\n"
    samples, _ = decode(data, layout=Layout(WISHED, accel_range_g=16, gyro_range_deg_s=2000))
    (sample,) = samples
    assert sample.linear_acceleration_m_s2 == pytest.approx((9.80665, -19.6133, 0.0))
    assert sample.angular_velocity_rad_s == pytest.approx((math.radians(10), 0, -math.radians(20)))
    assert sample.magnetic_field_t == pytest.approx((30e-6, 15e-6, -45e-6))
    # The accelerometer is unfiltered, the gyro is at 92 Hz (reference protocols C.2).
    assert sample.acceleration_lag_ns == 750_000 - 3_900_000


def test_the_raw_quaternion_is_in_units_of_two_to_the_thirtieth() -> None:
    columns = replace(WISHED, mag=False, quaternion=True)
    data = b"\n5, 0, 0, 16384, 0, 0, 0, 1073741824, 0, -536870912, 0\r\n"
    samples, _ = decode(data, layout=Layout(columns))
    assert samples[0].orientation_wxyz == (1.0, 0.0, -0.5, 0.0)
    assert samples[0].magnetic_field_t is None


@pytest.mark.parametrize("text", [b"1,2", b"1, 2,", b"1, , 2", b"nan", b"1, 2 ", b"abc", b"1.2.3"])
def test_what_is_no_row(text: bytes) -> None:
    assert row_of(text) is None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (b"IMU rate set to 100 Hz", ("rate_hz", 100)),
        (b"Accel FSR set to +/-16 g", ("accel_range_g", 16)),
        (b"Gyro FSR set to +/-250 dps", ("gyro_range_deg_s", 250)),
        (b"1, 2, 3", None),
    ],
)
def test_replies(text: bytes, told: tuple[str, int] | None) -> None:
    assert reply_of(text) == told


def test_a_partial_first_line_is_no_fault() -> None:
    counters = Counters()
    reader = LineReader(counters)
    assert [line.text for line in reader.feed(b"5, 6\r\n1, 2\r\n")] == [b"1, 2"]
    assert counters.bad_bytes == 0


def test_a_line_that_never_ends_is_skipped_and_counted() -> None:
    counters = Counters()
    reader = LineReader(counters)
    got = []
    for data in (b"\n", b"x" * 700, b"x\n", b"1, 2\n"):
        got += [line.text for line in reader.feed(data)]
    assert got == [b"1, 2"]
    assert counters.bad_bytes == 702


def test_the_longest_line_of_a_razor_is_not_too_long() -> None:
    """Raw, everything on, every number at its longest."""
    numbers = ["4294967295"] + ["-32768"] * 9 + ["-1073741824"] * 4 + ["-179.99"] * 3 + ["359.99"]
    assert len(", ".join(numbers)) + 2 < MOST_LINE_BYTES


def test_bytes_that_follow_a_line_are_told() -> None:
    reader = LineReader(Counters(), cut_at_first=False)
    assert [line.following for line in reader.feed(b"1\r\n22\r\n333")] == [7, 3]


def test_bad_lines_are_counted_and_left_out() -> None:
    samples, counters = decode(
        b"\r\n" + raw_line(10) + b"20, 1, 2\r\n" + b"garbage\r\n" + raw_line(30) + b"Accel FSR"
        b" set to +/-4 g\r\n" + raw_line(40)
    )
    assert [s.device_ns // 1_000_000 for s in samples] == [10, 30, 40]
    assert counters.bad_frames == 2
    assert counters.lost_samples == 1


@pytest.mark.parametrize(
    ("millis", "lost"),
    [((10, 20, 30), 0), ((10, 20, 40), 1), ((10, 21, 29), 0), ((10, 109), 9), ((10, 30, 49), 2)],
)
def test_left_out_lines_are_told_by_the_clock(millis: tuple[int, ...], lost: int) -> None:
    _, counters = decode(b"\n" + b"".join(raw_line(t) for t in millis))
    assert counters.lost_samples == lost


def test_the_clock_goes_on_when_millis_wraps() -> None:
    samples, counters = decode(b"\n" + b"".join(raw_line(t) for t in (4294967290, 4, 14)))
    assert [s.device_ns // 1_000_000 for s in samples] == [4294967290, 4294967300, 4294967310]
    assert {s.epoch for s in samples} == {0}
    assert counters.lost_samples == 0


def test_a_restart_of_the_board_is_a_new_epoch() -> None:
    samples, _ = decode(b"\n" + b"".join(raw_line(t) for t in (90000, 90010, 500, 510, 520)))
    assert [(s.epoch, s.device_ns // 1_000_000) for s in samples] == [
        (0, 90000),
        (0, 90010),
        (1, 510),
        (1, 520),
    ]


def test_one_line_with_a_wrong_time_is_left_out() -> None:
    samples, counters = decode(b"\n" + b"".join(raw_line(t) for t in (90000, 10010, 90020, 90030)))
    assert [s.device_ns // 1_000_000 for s in samples] == [90000, 90020, 90030]
    assert {s.epoch for s in samples} == {0}
    assert counters.bad_frames == 1


def test_the_board_that_lost_its_sensor_says_so() -> None:
    with pytest.raises(DeviceFaultError, match="take its power away for ten seconds"):
        decode(b"\r\nError connecting to MPU-9250\r\n")


def test_without_a_clock_the_arrival_is_the_time() -> None:
    counters = Counters()
    layout = Layout(replace(WISHED, time=False))
    decoder = RazorDecoder(layout, counters, MillisClock())
    reading = decoder.feed(Chunk(777, b"\n0, 0, 16384, 1, -2, 3, 100, -20, 300\r\n"))
    assert reading.samples[0].device_ns == 777
    assert (reading.ticks[0].device_ns, reading.ticks[0].arrival_ns) == (777, 777)


def test_a_tick_takes_the_filter_and_half_a_millisecond_off() -> None:
    decoder = RazorDecoder(Layout(), Counters(), MillisClock())
    (tick,) = decoder.feed(Chunk(10**9, b"\n" + raw_line(123))).ticks
    assert (tick.device_ns, tick.arrival_ns) == (123_000_000, 10**9)
    # millis() is cut, so a sample is half a millisecond later than it says; 92 Hz: 3.9 ms.
    assert tick.delay_ns == 3_900_000 - 500_000


STREAM = b"17, 3\r\n" + b"".join(raw_line(1000 + 10 * k, k) for k in range(30))


@given(st.lists(st.integers(0, len(STREAM)), max_size=12))
def test_lines_may_be_cut_anywhere(cuts: list[int]) -> None:
    whole, _ = decode(STREAM)
    bounds = [0, *sorted(cuts), len(STREAM)]
    pieces = [STREAM[a:b] for a, b in itertools.pairwise(bounds)]
    parts, counters = decode(*pieces)
    assert parts == whole
    assert len(whole) == 30
    assert counters.bad_frames == 0


@given(st.lists(st.tuples(st.integers(0, len(STREAM) - 1), st.binary(max_size=6)), max_size=6))
def test_corrupted_bytes_are_never_an_error_and_cost_their_own_lines(
    faults: list[tuple[int, bytes]],
) -> None:
    data = bytearray(STREAM)
    for at, junk in faults:
        data[at : at + len(junk)] = junk
    samples, counters = decode(bytes(data))
    assert len(samples) <= 30 + sum(junk.count(b"\n") for _, junk in faults)
    # A fault touches at most two lines, and a wrong time can cost the next one as well.
    assert len(samples) >= 30 - 3 * len(faults)
    assert counters.samples == len(samples)


@given(st.binary(max_size=600))
def test_garbage_is_never_an_error(data: bytes) -> None:
    decode(b"\n" + data)
    AhrsDecoder(Counters()).feed(Chunk(0, b"\n" + data))


# How the board prints a car at rest, by state; noise as of a real chip.
AT_REST = {
    "accel": ((0.01, 0.12, -1.00), (164, 1966, -16384)),
    "gyro": ((0.73, 0.38, 0.31), (12, 6, 5)),
    "mag": ((12.15, -66.92, -45.91), (81, -446, -306)),
    "quaternion": (
        (0.0369, -0.7548, -0.6537, -0.0402),
        (39621073, -810459129, -701905030, -43164421),
    ),
    "euler": ((1.25, -173.1, 88.02), (1.25, -173.1, 88.02)),
    "heading": ((169.71,), (169.71,)),
}


def rows_at_rest(columns: Columns) -> list[Row]:
    rows = []
    for k in range(5):
        values = [1996551.0 + 10 * k] if columns.time else []
        for name in columns.places():
            if name != "time":
                values += AT_REST[name][columns.raw]
        rows.append(Row(tuple(float(value) for value in values), columns.decimals()))
    return rows


def test_the_state_of_a_board_is_always_among_the_candidates() -> None:
    for columns in EVERY:
        assert columns in candidates(rows_at_rest(columns)), columns


@pytest.mark.parametrize("raw", [False, True])
@pytest.mark.parametrize("off", ["", "q", "e", "h", "m", "g", "qh", "qe", "eh"])
def test_usual_states_are_recognised_at_once(off: str, raw: bool) -> None:
    columns = replace(FACTORY, raw=raw)
    for key in off:
        columns = columns.toggled(key)
    assert candidates(rows_at_rest(columns))[0] == columns


@pytest.mark.parametrize(
    ("count", "told"),
    [(16384, (2, True)), (8500, (4, True)), (4096, (8, True)), (1900, (16, True)), (11585, (2, 0))],
)
def test_the_full_scale_of_the_accelerometer_by_one_g(count: float, told: tuple[int, bool]) -> None:
    found = accel_range_g(count)
    assert found[1] == bool(told[1])
    assert found[0] == told[0] or not told[1]


def test_frames_of_the_ahrs_firmware() -> None:
    """The line of reference protocols C.3."""
    frame = frame_of(b"#YPR=-142.28,-5.38,33.52")
    assert frame is not None
    assert (frame.tag, frame.values) == ("YPR", (-142.28, -5.38, 33.52))
    assert frame_of(b"#YPR=1.0,,2.0") is None
    assert frame_of(b"#SYNCH12") is None


def test_yprag_in_our_axes() -> None:
    """Reference protocols C.3: acc = (-ax, ay, az) * 9.80665 / 256, gyro (gx, -gy, -gz)."""
    decoder = AhrsDecoder(Counters())
    line = b"\n#YPRAG=90.00,0.00,0.00,-128.00,64.00,256.00,0.10,0.20,0.30\r\n"
    (sample,) = decoder.feed(Chunk(5, line)).samples
    g = 9.80665
    assert sample.linear_acceleration_m_s2 == pytest.approx((0.5 * g, 0.25 * g, g))
    assert sample.angular_velocity_rad_s == pytest.approx((0.1, -0.2, -0.3))
    # Yaw to the right is negative for us: a quarter turn about -z.
    half = math.sqrt(0.5)
    assert sample.orientation_wxyz == pytest.approx((half, 0.0, 0.0, -half))


def test_pitch_is_turned_and_roll_kept() -> None:
    decoder = AhrsDecoder(Counters())
    for line, at, sign in ((b"0.00,90.00,0.00", 2, -1.0), (b"0.00,0.00,90.00", 1, 1.0)):
        data = b"\n#YPRAG=" + line + b",0.00,0.00,256.00,0.00,0.00,0.00\r\n"
        found = decoder.feed(Chunk(5, data)).samples[0].orientation_wxyz
        assert found is not None
        assert found[at] == pytest.approx(sign * math.sqrt(0.5))


def test_the_original_ahrs_firmware_gives_counts() -> None:
    counters = Counters()
    decoder = AhrsDecoder(counters)
    data = (
        b"\n#A-C=0.00,0.00,256.00\r\n#M-C=1.00,2.00,3.00\r\n#G-C=100.00,10.00,-20.00\r\n"
        b"!ERR: reading gyroscope\r\n#G-C=1.00,1.00,1.00\r\n"
    )
    samples = decoder.feed(Chunk(5, data)).samples
    unit = math.radians(0.06957)
    assert [s.angular_velocity_rad_s for s in samples] == [
        pytest.approx((100 * unit, -10 * unit, 20 * unit))
    ]
    assert counters.details == {"sensor_errors": 1}
    assert counters.bad_frames == 0


def test_an_ahrs_line_is_dated_back_by_what_follows_it() -> None:
    decoder = AhrsDecoder(Counters(), line_baud=57600)
    line = b"#YPRAG=0.00,0.00,0.00,0.00,0.00,256.00,0.00,0.00,0.00\r\n"
    reading = decoder.feed(Chunk(10**9, b"\n" + line + line))
    byte_ns = 10 * 10**9 // 57600
    assert [t.arrival_ns for t in reading.ticks] == [10**9 - len(line) * byte_ns, 10**9]
    assert reading.ticks[0].delay_ns == len(line) * byte_ns
    assert [s.device_ns for s in reading.samples] == [t.device_ns for t in reading.ticks]
