"""Boards with the AHRS firmware, the original and the extended one."""

from __future__ import annotations

import math

import pytest
from imu_readings import collect, samples_of
from razor_talk import device

from drivers import (
    DeviceFaultError,
    ModelPort,
)
from drivers.imu import Motion
from drivers.imu.razor import (
    AhrsDecoder,
    AhrsModel,
)


@pytest.mark.parametrize("baud", [None, 57600])
def test_the_ahrs_firmware_is_found_and_set_to_give_sensors(baud: int | None) -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.0), yaw_pitch_roll_rad=(1.0, 0.2, -0.1))
    imu, port = device(AhrsModel(lambda _: motion, baud=baud))
    imu.connect()
    assert port.now_ns() < 5e9
    assert imu.identify()["firmware"] == "Razor AHRS"
    assert imu.identify()["line_baud"] == (baud or "USB")
    samples = samples_of(collect(imu, port, 1.0))
    assert 48 <= len(samples) <= 51
    last = samples[-1]
    assert last.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=5e-3)
    assert last.linear_acceleration_m_s2 == pytest.approx((1.0, -2.0, 9.0), abs=2e-4)
    w, x, y, z = last.orientation_wxyz or (0.0, 0.0, 0.0, 0.0)
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(1.0, abs=1e-3)
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(0.2, abs=1e-3)
    assert math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) == pytest.approx(-0.1, abs=1e-3)


def test_an_ahrs_line_at_57600_is_stamped_when_it_began() -> None:
    imu, port = device(AhrsModel())
    imu.connect()
    for reading in collect(imu, port, 1.0):
        for tick in reading.ticks:
            # The model sends each frame at a whole number of its intervals.
            late_ns = (tick.arrival_ns - tick.delay_ns) % 20_000_000
            assert min(late_ns, 20_000_000 - late_ns) < 50_000


def test_the_original_ahrs_firmware_gives_sensors_too() -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.0))
    imu, port = device(AhrsModel(lambda _: motion, extended=False))
    imu.connect()
    assert imu.identify()["lines"] == "G-C"
    last = samples_of(collect(imu, port, 0.5))[-1]
    assert last.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=1e-4)
    assert last.linear_acceleration_m_s2 == pytest.approx((1.0, -2.0, 9.0), abs=2e-4)


def test_a_stopped_ahrs_firmware_goes_on() -> None:
    model = AhrsModel()
    model.streams = False
    imu, port = device(model)
    imu.connect()
    assert samples_of(collect(imu, port, 0.2))
    assert port.bauds == [57600]


def test_an_ahrs_firmware_that_gives_angles_only() -> None:
    class Angles(AhrsModel):
        def _obey(self, command: bytes, now_ns: int) -> None:
            if command in (b"#o0", b"#o1"):
                super()._obey(command, now_ns)

    imu, port = device(Angles())
    with pytest.raises(DeviceFaultError, match="neither #YPRAG nor #G-C"):
        imu.connect()
    assert port.now_ns() < 5e9


def test_a_failing_sensor_of_the_ahrs_firmware_is_counted() -> None:
    model = AhrsModel()
    imu, port = device(model)
    imu.connect()
    model.errors = True
    collect(imu, port, 0.5)
    assert imu.counters.details["sensor_errors"] > 20
    assert imu.counters.bad_frames == 0


def test_the_sync_command_is_answered() -> None:
    model = AhrsModel(baud=None)
    model.streams = False
    port = ModelPort(model)
    port.write(b"#s4")
    port.write(b"2")
    chunk = port.read(0.1)
    assert chunk is not None
    assert chunk.data == b"#SYNCH42\r\n"


def test_the_ahrs_decoder_reads_a_raw_log_later() -> None:
    imu, port = device(AhrsModel())
    imu.connect()
    readings = collect(imu, port, 0.5)
    decoder = AhrsDecoder(imu.counters, 57600)
    again = [decoder.feed(chunk) for reading in readings for chunk in reading.raw]
    assert samples_of(again)[1:] == samples_of(readings)[1:]
