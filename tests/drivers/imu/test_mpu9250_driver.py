from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from imu_readings import collect, samples_of

from dialogue import UsageError
from drivers import (
    DeviceFaultError,
    DeviceLostError,
    NoAnswerError,
    Reading,
    Tick,
)
from drivers.imu import ImuSample, Motion
from drivers.imu.mpu9250 import FakeMpu9250Bus, Mpu9250, Mpu9250Config, Mpu9250Decoder
from drivers.imu.mpu9250 import registers as reg


class HookedBus(FakeMpu9250Bus):
    """Lets something happen at the k-th transfer from now on."""

    def __init__(self) -> None:
        self._left = 0
        self._action: Callable[[], None] = self.unplug
        super().__init__()

    def at_transfer(self, k: int, action: Callable[[], None]) -> None:
        self._left, self._action = k, action

    def unplug(self) -> None:
        self.unplugged = True

    def _check(self, address: int) -> None:
        self._left -= 1
        if self._left == 0:
            self._action()
        super()._check(address)


def device(bus: FakeMpu9250Bus, config: Mpu9250Config | None = None) -> Mpu9250:
    def open_bus(path: str) -> FakeMpu9250Bus:
        assert path == "/dev/i2c-1"
        bus.closed = False
        return bus

    return Mpu9250(config, open_bus)


def ticks_of(readings: list[Reading[ImuSample]]) -> list[Tick]:
    return [tick for reading in readings for tick in reading.ticks]


def lower_line(ticks: list[Tick]) -> tuple[float, float]:
    """The line below all ticks that supports their middle: (arrival at device 0, slope)."""
    points = [(float(t.device_ns), float(t.arrival_ns)) for t in ticks]
    hull: list[tuple[float, float]] = []
    for p in points:
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (by - ay) * (p[0] - ax) < (p[1] - ay) * (bx - ax):
                break
            hull.pop()
        hull.append(p)
    middle = 0.5 * (points[0][0] + points[-1][0])
    (ax, ay), (bx, by) = next(pair for pair in itertools.pairwise(hull) if pair[1][0] >= middle)
    slope = (by - ay) / (bx - ax)
    return ay - slope * ax, slope


@pytest.mark.parametrize("rate_hz", [100, 200, 500, 1000])
def test_every_sample_comes_once_and_in_order(rate_hz: int) -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus, Mpu9250Config(rate_hz=rate_hz))
    imu.connect()
    before = bus.samples_taken
    samples = samples_of(collect(imu, bus, 3.0))
    assert [s.device_ns * rate_hz for s in samples] == [k * 10**9 for k in range(len(samples))]
    assert bus.samples_taken - before - len(samples) < 20  # what still waits in the FIFO
    assert imu.counters.samples == len(samples) >= 3 * rate_hz - 20
    assert imu.counters.lost_samples == 0
    assert imu.counters.details == {}


def test_values_arrive_in_si_units_in_the_accelerometers_frame() -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.0), (20e-6, -5e-6, -40e-6), 31.0)
    bus = FakeMpu9250Bus(lambda _: motion)
    imu = device(bus)
    imu.connect()
    samples = samples_of(collect(imu, bus, 0.5))
    last = samples[-1]
    assert last.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=3e-4)
    assert last.linear_acceleration_m_s2 == pytest.approx((1.0, -2.0, 9.0), abs=1.3e-3)
    assert last.temperature_c == pytest.approx(31.0, abs=2e-3)
    fields = [s.magnetic_field_t for s in samples if s.magnetic_field_t is not None]
    assert len(fields) > 20
    assert fields[-1] == pytest.approx((20e-6, -5e-6, -40e-6), abs=0.1e-6)


def test_what_clips_stays_at_the_end_of_the_scale() -> None:
    bus = FakeMpu9250Bus(lambda _: Motion((100.0, -100.0, 0.0)))
    imu = device(bus, Mpu9250Config(gyro_range_deg_s=250))
    imu.connect()
    x, y, _ = samples_of(collect(imu, bus, 0.1))[-1].angular_velocity_rad_s
    assert (x, y) == pytest.approx((math.radians(32767 / 131), math.radians(-32768 / 131)))


@pytest.mark.parametrize("rate_error", [-0.008, 0.0, 0.011])
@pytest.mark.parametrize("rate_hz", [200, 1000])
def test_ticks_and_delays_give_the_time_of_the_gyro(rate_error: float, rate_hz: int) -> None:
    """An oscillator 1 % off, and polls that know nothing of it: the stamp is good to 10 us."""
    bus = FakeMpu9250Bus(lambda t_ns: Motion((math.sin(2e-9 * t_ns), 0.0, 0.0)))
    bus.rate_error = rate_error
    imu = device(bus, Mpu9250Config(rate_hz=rate_hz, gyro_range_deg_s=250))
    imu.connect()
    readings = collect(imu, bus, 30.0)
    ticks = ticks_of(readings)
    offset_ns, slope = lower_line(ticks)
    assert slope == pytest.approx(1.0 / (1.0 + rate_error), abs=2e-6)
    samples = samples_of(readings)
    t_s = np.array([(offset_ns + slope * s.device_ns - ticks[0].delay_ns) * 1e-9 for s in samples])
    rate = np.array([s.angular_velocity_rad_s[0] for s in samples])
    # Residual of the sine at these times, as a shift in time.
    shift_s = np.linalg.lstsq(np.c_[np.sin(2.0 * t_s), 2.0 * np.cos(2.0 * t_s)], rate, rcond=None)[
        0
    ][1]
    assert abs(shift_s) < 1e-5


def test_the_acceleration_is_older_than_the_stamp_by_its_lag() -> None:
    """Both feel one jerk; the accelerometer shows it 5.9 ms later, as its lag says."""
    begin_ns = 1_500_000_000

    def jerk(t_ns: int) -> Motion:
        felt = 1.0 if t_ns >= begin_ns else 0.0
        return Motion((felt, 0.0, 0.0), (5.0 * felt, 0.0, 9.8))

    bus = FakeMpu9250Bus(jerk)
    imu = device(bus, Mpu9250Config(rate_hz=1000))
    imu.connect()
    samples = samples_of(collect(imu, bus, 1.0))
    turned = next(s for s in samples if s.angular_velocity_rad_s[0] > 0.5)
    pulled = next(s for s in samples if s.linear_acceleration_m_s2[0] > 2.5)
    assert turned.acceleration_lag_ns == 5_900_000
    assert pulled.device_ns - turned.device_ns == pytest.approx(5_900_000, abs=1_000_000)
    assert imu.identify()["acceleration_lag_ns"] == 5_900_000


def test_the_raw_log_decodes_to_the_same_samples_later() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    readings = collect(imu, bus, 1.0)
    bus.pause(0.5)  # an overflow in between
    readings += collect(imu, bus, 0.5)
    later = Mpu9250Decoder()
    again = [later.feed(chunk) for reading in readings for chunk in reading.raw]
    assert samples_of(again) == samples_of(readings)
    assert ticks_of(again) == ticks_of(readings)
    assert later.epoch == 1


def test_an_overflow_is_counted_and_starts_the_clock_anew() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    collect(imu, bus, 0.2)
    taken, received = bus.samples_taken, imu.counters.samples
    bus.pause(1.0)
    full = imu.read(0.1)
    assert full is not None
    assert len(full.samples) == 36  # 512 bytes hold 36 frames of 14
    after = imu.read(0.1)
    assert after is not None
    assert [(s.epoch, s.device_ns) for s in after.samples[:2]] == [(1, 0), (1, 5_000_000)]
    assert imu.counters.details == {"fifo_overflows": 1}
    waiting = bus.samples_taken - taken - (imu.counters.samples - received)
    assert imu.counters.lost_samples == pytest.approx(waiting, abs=2)


@pytest.mark.parametrize("transfer", range(1, 6))
def test_a_stall_within_a_poll_puts_no_sample_out_of_step(transfer: int) -> None:
    """Found by ten minutes of the whole rig: the FIFO ran over between its count and its data."""
    bus = HookedBus()
    imu = device(bus)
    imu.connect()
    for _ in range(5):
        imu.read(0.1)
    bus.at_transfer(transfer, lambda: bus.pause(0.3))
    samples = [sample for _ in range(100) for r in [imu.read(0.1)] if r for sample in r.samples]
    assert len(samples) > 200
    for sample in samples:
        assert sample.linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.1)
    assert imu.counters.details.get("fifo_overflows", 0) + imu.counters.lost_samples > 0


def test_samples_are_whole_after_an_overflow() -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.0))
    bus = FakeMpu9250Bus(lambda _: motion)
    imu = device(bus)
    imu.connect()
    for _ in range(5):
        bus.pause(0.3)
        for sample in samples_of(collect(imu, bus, 0.1)):
            assert sample.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=3e-4)


@pytest.mark.parametrize("failures", [1, 2])
def test_a_disturbance_of_the_wires_costs_a_few_samples_only(failures: int) -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.0))
    bus = FakeMpu9250Bus(lambda _: motion)
    imu = device(bus)
    imu.connect()
    collect(imu, bus, 0.2)
    bus.failing_transfers = failures
    samples = samples_of(collect(imu, bus, 0.3))
    assert imu.counters.details == {"bus_errors": failures}
    assert 1 <= imu.counters.lost_samples < 20
    assert {s.epoch for s in samples} == {1}
    assert all(
        s.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=3e-4) for s in samples
    )


def test_a_pulled_wire_is_a_lost_device_and_it_comes_back() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    collect(imu, bus, 0.1)
    bus.unplugged = True
    began_ns = bus.now_ns()
    with pytest.raises(DeviceLostError, match=r"0x68 does not answer any more.*wires and power"):
        collect(imu, bus, 1.0)
    assert bus.now_ns() - began_ns < 2e8
    imu.close()
    with pytest.raises(NoAnswerError):
        imu.connect()
    bus.unplugged = False
    bus.reset_chip()
    imu.connect()
    samples = samples_of(collect(imu, bus, 0.1))
    assert (samples[0].device_ns, samples[0].epoch) == (0, 1)


def test_a_chip_that_was_reset_by_a_dip_of_power_is_lost_at_once() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    collect(imu, bus, 0.1)
    bus.reset_chip()
    began_ns = bus.now_ns()
    with pytest.raises(DeviceLostError, match="it was reset"):
        collect(imu, bus, 2.0)
    assert bus.now_ns() - began_ns < 7e8


def test_time_that_is_too_short_is_none_and_passes() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus, Mpu9250Config(rate_hz=100))
    imu.connect()
    began_ns = bus.now_ns()
    assert imu.read(0.002) is None
    assert bus.now_ns() - began_ns == 2_000_000


@pytest.mark.parametrize(("who", "model"), [(0x71, "MPU-9250"), (0x73, "MPU-9255")])
def test_it_says_who_it_is(who: int, model: str) -> None:
    bus = FakeMpu9250Bus(who_am_i=who, address=0x69)
    imu = device(bus)
    imu.connect()
    identity = imu.identify()
    assert identity["model"] == model
    assert identity["address"] == "0x69"
    assert identity["magnetometer"] == "AK8963, 16 bit"
    assert identity["rate_hz"] == 200.0
    assert imu.name == "MPU-9250 on /dev/i2c-1"


def test_an_mpu_6500_is_taken_without_magnetometer_and_says_so() -> None:
    bus = FakeMpu9250Bus(who_am_i=0x70, has_magnetometer=False)
    imu = device(bus)
    imu.connect()
    assert imu.identify()["magnetometer"] == (
        "none: the chip is an MPU-6500 (WHO_AM_I 0x70), which has none"
    )
    assert all(s.magnetic_field_t is None for s in samples_of(collect(imu, bus, 0.2)))


def test_a_dead_magnetometer_does_not_stop_the_gyro() -> None:
    bus = FakeMpu9250Bus(has_magnetometer=False)
    imu = device(bus)
    imu.connect()
    assert imu.identify()["magnetometer"] == "none: no AK8963 answers at 0x0c"
    assert samples_of(collect(imu, bus, 0.2))


def test_a_field_that_is_too_strong_is_discarded_and_counted() -> None:
    bus = FakeMpu9250Bus()
    bus.magnetometer_overflow = True
    imu = device(bus)
    imu.connect()
    assert all(s.magnetic_field_t is None for s in samples_of(collect(imu, bus, 0.2)))
    assert imu.counters.details["magnetometer_overflows"] > 5


@pytest.mark.parametrize(
    ("who", "word"), [(0x68, "MPU-6050"), (0x00, "wires are bad"), (0xEA, "another chip")]
)
def test_another_chip_is_told_and_not_written_to(who: int, word: str) -> None:
    bus = FakeMpu9250Bus(who_am_i=who)
    with pytest.raises(DeviceFaultError, match=word):
        device(bus).connect()
    assert bus.closed
    assert bus._registers[reg.PWR_MGMT_1] == reg.SLEEP


def test_nobody_on_the_bus() -> None:
    bus = FakeMpu9250Bus()
    bus.unplugged = True
    with pytest.raises(NoAnswerError, match=r"no chip answers at 0x68 or 0x69; check 3\.3 V.*NCS"):
        device(bus).connect()
    assert bus.closed


def test_the_other_address_is_named() -> None:
    bus = FakeMpu9250Bus(address=0x69)
    with pytest.raises(NoAnswerError, match=r"answers at 0x68 \(0x69 answers: set that address"):
        device(bus, Mpu9250Config(address=0x68)).connect()


def test_settings_are_read_back() -> None:
    bus = FakeMpu9250Bus()
    bus.stuck_register = reg.GYRO_CONFIG
    with pytest.raises(DeviceFaultError, match="register 0x1b was set to 0x10 and reads 0x00"):
        device(bus).connect()
    assert bus.closed


def test_a_connect_that_fails_half_way_can_be_tried_again() -> None:
    """Every single transfer of the conversation fails once; the second try always works."""

    def fail() -> None:
        raise OSError(121, "Remote I/O error")

    bus = FakeMpu9250Bus()
    device(bus).connect()
    failed = 0
    for at in range(1, bus.transfers + 1):
        trial = HookedBus()
        imu = device(trial)
        trial.at_transfer(at, fail)
        try:
            imu.connect()
        except NoAnswerError:
            failed += 1
            assert trial.closed
            imu.connect()
        assert samples_of(collect(imu, trial, 0.05))
    assert failed == bus.transfers - 5  # the questions who is there are asked again by themselves


def test_close_lets_the_chip_sleep_and_may_be_called_twice() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.close()
    imu.connect()
    imu.close()
    assert bus.closed
    assert bus._registers[reg.PWR_MGMT_1] == reg.SLEEP
    imu.close()
    with pytest.raises(DeviceLostError, match="not connected"):
        imu.read(0.1)


def test_closing_a_lost_device_raises_nothing() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    bus.unplugged = True
    imu.close()
    assert bus.closed


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("rate_hz", lambda: Mpu9250Config(rate_hz=300)),
        ("gyro_range_deg_s", lambda: Mpu9250Config(gyro_range_deg_s=360)),
        ("accel_range_g", lambda: Mpu9250Config(accel_range_g=3)),
        ("gyro_filter", lambda: Mpu9250Config(gyro_filter=0)),
        ("address", lambda: Mpu9250Config(address=0x0C)),
    ],
)
def test_what_the_chip_cannot_do_is_refused(name: str, wrong: Callable[[], Mpu9250Config]) -> None:
    with pytest.raises(UsageError, match=f"{name} is .*the chip knows"):
        wrong()


def test_the_self_test_passes_and_the_stream_goes_on() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    collect(imu, bus, 0.1)
    result = imu.self_test()
    assert result.passed
    assert result.gyro_ratio == pytest.approx((1.0, 1.0, 1.0), abs=0.01)
    assert result.accel_ratio == pytest.approx((1.0, 1.0, 1.0), abs=0.01)
    samples = samples_of(collect(imu, bus, 0.1))
    assert samples[0].epoch == 1
    assert samples[-1].linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.01)


def test_the_self_test_of_a_weak_sensor_says_what_is_wrong() -> None:
    bus = FakeMpu9250Bus(lambda _: Motion((0.5, 0.0, 0.0)))
    bus.self_test_strength = 0.3
    imu = device(bus)
    imu.connect()
    result = imu.self_test()
    assert not result.passed
    assert "gyro x reads 28.6 deg/s at rest" in result.faults
    assert sum("answers with" in fault for fault in result.faults) == 6


def test_a_wire_that_breaks_in_the_self_test() -> None:
    bus = FakeMpu9250Bus()
    imu = device(bus)
    imu.connect()
    bus.unplugged = True
    with pytest.raises(DeviceLostError, match="failed in its self test"):
        imu.self_test()


def test_something_else_at_the_magnetometers_address() -> None:
    class Other(FakeMpu9250Bus):
        def read_block(self, address: int, register: int, count: int) -> bytes:
            data = super().read_block(address, register, count)
            return b"\x10" if (address, register) == (reg.AK_ADDRESS, reg.AK_WHO_AM_I) else data

    imu = device(Other())
    imu.connect()
    assert imu.identify()["magnetometer"] == "none: 0x0c says 0x10, an AK8963 would say 0x48"


@pytest.mark.parametrize("at", range(1, 6))
def test_closing_in_the_middle_of_a_read_ends_it(at: int) -> None:
    """As another thread does it, at one transfer of the read or another."""
    bus = HookedBus()
    imu = device(bus)
    imu.connect()
    bus.at_transfer(at, imu.close)
    with pytest.raises(DeviceLostError):
        collect(imu, bus, 0.5)
    assert bus.closed
