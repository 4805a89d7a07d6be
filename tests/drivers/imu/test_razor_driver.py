from __future__ import annotations

import itertools

import pytest
from imu_readings import collect, samples_of
from razor_talk import device

from drivers import (
    DeviceFaultError,
    DeviceLostError,
    NoAnswerError,
    ProtocolError,
    PtyEmulator,
)
from drivers.imu import ImuSample, Motion, at_rest
from drivers.imu.razor import (
    Columns,
    Layout,
    MillisClock,
    Razor,
    RazorConfig,
    RazorDecoder,
    RazorModel,
    razor_model,
)
from drivers.imu.razor.columns import FACTORY, WISHED


def test_values_arrive_in_si_units_in_the_accelerometers_frame() -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.5), (20e-6, -5e-6, -40e-6))
    model = RazorModel(lambda t_ns: at_rest(t_ns) if t_ns < 10**9 else motion)
    imu, port = device(model)
    imu.connect()
    last = samples_of(collect(imu, port, 1.5))[-1]
    assert last.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=6e-4)
    assert last.linear_acceleration_m_s2 == pytest.approx((1.0, -2.0, 9.5), abs=4e-4)
    assert last.magnetic_field_t == pytest.approx((20e-6, -5e-6, -40e-6), abs=0.1e-6)


def test_a_paused_board_goes_on() -> None:
    model = RazorModel(columns=WISHED)
    model.paused = True
    imu, port = device(model)
    imu.connect()
    assert not model.paused
    assert bytes(port.written) == b" #o1"
    assert samples_of(collect(imu, port, 0.1))


def test_a_board_that_is_silent_for_another_reason_is_left_as_it_was() -> None:
    model = RazorModel()
    model.hung = True
    imu, port = device(model)
    with pytest.raises(NoAnswerError, match=r"nothing came.*115200 and 57600.*check the cable"):
        imu.connect()
    assert not model.paused
    assert port.closed
    assert port.now_ns() < 5e9


def test_a_board_without_its_sensor_says_so() -> None:
    model = RazorModel()
    model.no_sensor = True
    imu, port = device(model)
    with pytest.raises(DeviceFaultError, match="does not find its sensor"):
        imu.connect()
    assert port.closed


def test_a_board_that_takes_no_keys() -> None:
    model = RazorModel()
    model.deaf = True
    imu, port = device(model)
    with pytest.raises(DeviceFaultError, match="does not do as the key 'c' says"):
        imu.connect()
    assert port.now_ns() < 5e9


def test_a_board_that_loses_its_sensor_in_the_middle_says_so() -> None:
    model = RazorModel()
    imu, port = device(model)
    imu.connect()
    collect(imu, port, 0.1)
    model.no_sensor = True
    model.reset(port.now_ns())
    with pytest.raises(DeviceFaultError, match="Razor IMU on /dev/ttyACM0: the Razor says"):
        collect(imu, port, 0.1)


class Speaker:
    """Says one thing every 10 ms."""

    def __init__(self, text: bytes) -> None:
        self.text, self._next_ns = text, 0

    def receive(self, data: bytes, now_ns: int) -> None:
        pass

    def transmit(self, now_ns: int) -> bytes:
        if now_ns < self._next_ns:
            return b""
        self._next_ns = now_ns + 10_000_000
        return self.text

    def next_ns(self) -> int | None:
        return self._next_ns


@pytest.mark.parametrize("text", [b"\xa5\x5a\x05\x00", b"AT+GCAP\r", b"hello world\r\n"])
def test_another_device_is_no_razor(text: bytes) -> None:
    imu, port = device(Speaker(text))
    with pytest.raises(ProtocolError, match=r"no Razor's.*is this its port"):
        imu.connect()
    assert port.now_ns() < 5e9
    assert port.written == b"#o1"  # no key of the default firmware


def test_numbers_that_no_razor_prints() -> None:
    imu, _ = device(Speaker(b"1.5, 2.5\r\n"))
    with pytest.raises(DeviceFaultError, match="lines of 2 numbers"):
        imu.connect()


def test_the_clock_counts_on_and_left_out_lines_are_lost_samples() -> None:
    model = RazorModel()
    model.skip_every = 7
    imu, port = device(model)
    imu.connect()
    samples = samples_of(collect(imu, port, 7.0))
    assert imu.counters.lost_samples == pytest.approx(100, abs=2)
    assert len(samples) == pytest.approx(600, abs=4)
    steps = {(b.device_ns - a.device_ns) // 1_000_000 for a, b in itertools.pairwise(samples)}
    assert steps == {10, 20}
    assert imu.counters.bad_frames == 0


def test_a_wrap_of_the_clock_in_the_middle() -> None:
    model = RazorModel(boot_ms=(1 << 32) - 2000)
    imu, port = device(model)
    imu.connect()
    samples = samples_of(collect(imu, port, 4.0))
    times = [s.device_ns for s in samples]
    assert times == sorted(times)
    assert times[-1] > (1 << 32) * 1_000_000
    assert {s.epoch for s in samples} == {0}
    assert imu.counters.lost_samples == 0


def test_a_reset_in_the_middle_is_a_new_epoch() -> None:
    model = RazorModel(boot_ms=100_000)
    imu, port = device(model)
    imu.connect()
    collect(imu, port, 0.5)
    model.reset(port.now_ns())
    samples = samples_of(collect(imu, port, 0.5))
    assert samples[-1].epoch == 1
    assert samples[-1].device_ns < 10**9


def test_the_first_line_may_be_cut() -> None:
    model = RazorModel()
    assert model.starts_cut
    imu, port = device(model)
    imu.connect()
    collect(imu, port, 0.5)
    assert imu.counters.bad_frames == 0
    assert imu.counters.bad_bytes == 0


def test_a_paused_stream_is_a_lost_device_and_comes_back() -> None:
    model = RazorModel()
    imu, port = device(model)
    imu.connect()
    collect(imu, port, 0.1)
    model.paused = True
    with pytest.raises(DeviceLostError, match="nothing came for 1 s"):
        collect(imu, port, 3.0)
    imu.close()
    imu.connect()
    assert samples_of(collect(imu, port, 0.1))[0].epoch == 1


def test_a_stream_that_was_set_otherwise_is_a_lost_device_and_comes_back() -> None:
    model = RazorModel()
    imu, port = device(model)
    imu.connect()
    model.columns = FACTORY
    with pytest.raises(DeviceLostError, match="no line that can be read"):
        collect(imu, port, 3.0)
    assert imu.counters.bad_frames > 90
    imu.close()
    imu.connect()
    assert samples_of(collect(imu, port, 0.1))


def test_a_pulled_cable() -> None:
    imu, port = device(RazorModel())
    imu.connect()
    port.unplug()
    with pytest.raises(DeviceLostError):
        imu.read(0.1)
    imu.close()
    with pytest.raises(DeviceLostError):
        imu.connect()
    port.plug()
    imu.connect()
    assert imu.read(0.1) is not None


def test_close_may_come_at_any_time() -> None:
    imu, port = device(RazorModel())
    imu.close()
    imu.connect()
    imu.close()
    imu.close()
    assert port.closed
    with pytest.raises(DeviceLostError, match="not connected"):
        imu.read(0.1)


def test_the_raw_log_decodes_to_the_same_samples_later() -> None:
    imu, port = device(RazorModel())
    imu.connect()
    readings = collect(imu, port, 1.0)
    identity = imu.identify()
    columns = identity["columns"]
    assert isinstance(columns, dict)
    layout = Layout(Columns(**columns), int(str(identity["accel_range_g"])))
    decoder = RazorDecoder(layout, imu.counters, MillisClock())
    again = [decoder.feed(chunk) for reading in readings for chunk in reading.raw]
    assert samples_of(again) == samples_of(readings)
    assert len(samples_of(again)) > 95


def test_a_razor_behind_a_real_pseudo_terminal() -> None:
    with PtyEmulator(razor_model()) as emulator:
        imu = Razor(RazorConfig(port=emulator.path))
        imu.connect()
        samples: list[ImuSample] = []
        while len(samples) < 20:
            reading = imu.read(1.0)
            assert reading is not None
            samples += reading.samples
        imu.close()
    assert samples[-1].linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.01)
    assert imu.name == f"Razor IMU on {emulator.path}"
