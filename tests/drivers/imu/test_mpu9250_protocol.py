from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Chunk, Counters
from drivers.imu import ImuSample
from drivers.imu.mpu9250 import Mpu9250Decoder
from drivers.imu.mpu9250.protocol import (
    Settings,
    accel_scale,
    accelerometer_axes,
    fifo_record,
    gyro_scale,
    magnetic_field_t,
    magnetometer_record,
    samples_from_frames,
    settings_record,
    temperature_c,
)

# +-2 g, +-2000 deg/s, 200 Hz, both filters at 41 Hz, with a magnetometer.
SETTINGS = Settings(0x71, 4, 0x43, 0x18, 0x00, 0x03, (128, 128, 128))
# Reference protocols C.1, "Vector [computed]".
FRAME = bytes.fromhex("0000 C000 4000 0BB8 0668 F998 0010")


def test_the_vector_of_the_reference() -> None:
    (sample,) = samples_from_frames(FRAME, 7, SETTINGS, epoch=2)
    assert sample.linear_acceleration_m_s2 == pytest.approx((0.0, -9.80665, 9.80665))
    assert sample.angular_velocity_rad_s == pytest.approx((1.745329, -1.745329, 0.017028), abs=5e-7)
    assert sample.temperature_c == pytest.approx(29.99, abs=0.005)
    assert (sample.device_ns, sample.epoch) == (7, 2)


@pytest.mark.parametrize(
    ("range_deg_s", "counts"), [(250, 131.0), (500, 65.5), (1000, 32.8), (2000, 16.4)]
)
def test_gyro_scales_of_the_data_sheet(range_deg_s: int, counts: float) -> None:
    assert gyro_scale(range_deg_s) * counts == pytest.approx(math.pi / 180.0)


@pytest.mark.parametrize(("range_g", "counts"), [(2, 16384), (4, 8192), (8, 4096), (16, 2048)])
def test_accelerometer_scales_of_the_data_sheet(range_g: int, counts: int) -> None:
    assert accel_scale(range_g) * counts == pytest.approx(9.80665)


def test_the_temperature_is_not_that_of_the_mpu_6050() -> None:
    assert temperature_c(0) == 21.0
    assert temperature_c(3339) == pytest.approx(31.0, abs=0.001)


@pytest.mark.parametrize(
    ("gyro_filter", "accel_filter", "delay_ms", "lag_ms"),
    [(3, 3, 5.9, 5.9), (2, 2, 3.9, 3.9), (1, 6, 2.9, 64.06), (2, 8, 3.9, -3.15)],
)
def test_the_filters_delay_gyro_and_accelerometer_differently(
    gyro_filter: int, accel_filter: int, delay_ms: float, lag_ms: float
) -> None:
    """PS-MPU-9250A-01 tables of DLPF_CFG and A_DLPF_CFG; bit 3 of ACCEL_CONFIG2: no filter."""
    settings = Settings(0x71, 4, gyro_filter, 0, 0, accel_filter)
    assert settings.gyro_delay_ns == round(delay_ms * 1e6)
    assert settings.acceleration_lag_ns == round(lag_ms * 1e6)


def field(x: int, y: int, z: int, *, first: int = 0x01, last: int = 0x10) -> bytes:
    return bytes([first]) + struct.pack("<3h", x, y, z) + bytes([last])


def test_the_field_is_little_endian_adjusted_and_turned_once() -> None:
    """H = raw * 0.15 uT * ((ASA - 128) / 256 + 1); x_acc = y_mag, y_acc = x_mag, z_acc = -z_mag."""
    found = magnetic_field_t(field(100, 200, -300), (128, 192, 64))
    assert found == pytest.approx((200 * 0.15e-6 * 1.25, 100 * 0.15e-6, 300 * 0.15e-6 * 0.75))


def test_the_field_at_14_bits() -> None:
    found = magnetic_field_t(field(100, 200, 300, last=0x00), (128, 128, 128))
    assert found == pytest.approx((120e-6, 60e-6, -180e-6))


def test_a_field_that_is_old_or_too_strong_is_none() -> None:
    assert magnetic_field_t(field(1, 2, 3, first=0x00), (128, 128, 128)) is None
    assert magnetic_field_t(field(1, 2, 3, last=0x18), (128, 128, 128)) is None
    # A skipped sample (DOR) is still a good one.
    assert magnetic_field_t(field(1, 2, 3, first=0x03), (128, 128, 128)) is not None


def test_turning_the_axes_twice_changes_nothing() -> None:
    assert accelerometer_axes(accelerometer_axes((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)


def decode(*records: bytes, t_ns: int = 10**9) -> tuple[tuple[ImuSample, ...], Counters]:
    decoder = Mpu9250Decoder()
    return decoder.feed(Chunk(t_ns, b"".join(records))).samples, decoder.counters


def test_the_bytes_of_the_records() -> None:
    """As the module describes them: what is in a log today must be readable for ever."""
    assert settings_record(SETTINGS).hex(" ") == "53 0a 00 01 71 04 43 18 00 03 80 80 80"
    assert magnetometer_record(field(1, -2, 3)).hex(" ") == "4d 08 00 01 01 00 fe ff 03 00 10"
    assert fifo_record(500, FRAME).hex(" ") == "46 12 00 f4 01 00 00 " + FRAME.hex(" ")


def test_a_chunk_gives_samples_at_their_periods_and_one_tick() -> None:
    decoder = Mpu9250Decoder()
    record = settings_record(SETTINGS) + magnetometer_record(field(100, 0, 0))
    reading = decoder.feed(Chunk(10**9, record + fifo_record(700, FRAME * 3)))
    assert [sample.device_ns for sample in reading.samples] == [0, 5_000_000, 10_000_000]
    assert [sample.magnetic_field_t for sample in reading.samples[:2]] == [None, None]
    assert reading.samples[2].magnetic_field_t == pytest.approx((0.0, 15e-6, 0.0))
    (tick,) = reading.ticks
    assert (tick.device_ns, tick.arrival_ns, tick.epoch) == (10_000_000, 10**9 - 700_000, 0)
    # The gyro's delay at 41 Hz, and the two bytes of the count at 400 kHz.
    assert tick.delay_ns == 5_900_000 + 45_000
    later = decoder.feed(Chunk(2 * 10**9, fifo_record(0, FRAME)))
    assert later.samples[0].device_ns == 15_000_000
    assert decoder.counters.samples == 4


def test_settings_start_the_clock_anew() -> None:
    samples, _ = decode(
        settings_record(SETTINGS),
        fifo_record(0, FRAME * 2),
        settings_record(SETTINGS),
        fifo_record(0, FRAME),
    )
    assert [(s.epoch, s.device_ns) for s in samples] == [(0, 0), (0, 5_000_000), (1, 0)]


def test_without_a_magnetometer_a_record_of_one_is_ignored() -> None:
    bare = Settings(0x70, 4, 0x43, 0x18, 0x00, 0x03)
    samples, counters = decode(
        settings_record(bare), magnetometer_record(field(1, 2, 3)), fifo_record(0, FRAME)
    )
    assert samples[0].magnetic_field_t is None
    assert counters.bad_frames == 0


def test_frames_before_the_settings_cannot_be_read_and_are_counted() -> None:
    samples, counters = decode(fifo_record(0, FRAME))
    assert samples == ()
    assert counters.bad_frames == 1


def test_an_overflow_of_the_magnetometer_is_counted() -> None:
    _, counters = decode(settings_record(SETTINGS), magnetometer_record(field(1, 2, 3, last=0x18)))
    assert counters.details == {"magnetometer_overflows": 1}


def test_a_cut_chunk_loses_its_last_record_only() -> None:
    whole = settings_record(SETTINGS) + fifo_record(0, FRAME) + fifo_record(0, FRAME)
    samples, counters = decode(whole[:-1])
    assert len(samples) == 1
    assert (counters.bad_frames, counters.bad_bytes) == (1, 3 + 4 + 14 - 1)


def test_a_later_version_of_the_records_is_not_misread() -> None:
    record = bytearray(settings_record(SETTINGS))
    record[3] = 2
    _, counters = decode(bytes(record))
    assert counters.bad_frames == 1


@given(st.binary(max_size=200))
def test_whatever_a_log_holds_is_never_an_error(data: bytes) -> None:
    decoder = Mpu9250Decoder()
    decoder.feed(Chunk(0, settings_record(SETTINGS)))
    before = decoder.counters.bad_frames
    reading = decoder.feed(Chunk(0, data))
    assert reading.raw == (Chunk(0, data),)
    if data and data[:1] not in (b"S", b"M", b"F"):
        assert decoder.counters.bad_frames == before + 1


@given(
    counts=st.lists(st.integers(-32768, 32767), min_size=7, max_size=7),
    fs=st.integers(0, 3),
)
def test_counts_scale_without_loss(counts: list[int], fs: int) -> None:
    settings = Settings(0x71, 4, 3, fs << 3, fs << 3, 3)
    (sample,) = samples_from_frames(struct.pack(">7h", *counts), 0, settings)
    gyro = [value / settings.gyro_scale for value in sample.angular_velocity_rad_s]
    accel = [value / settings.accel_scale for value in sample.linear_acceleration_m_s2]
    assert [round(value) for value in (*accel, *gyro)] == counts[:3] + counts[4:]
