from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dialogue import UsageError
from drivers import (
    Chunk,
    DeviceFaultError,
    DeviceLostError,
    DeviceModel,
    DriverError,
    ModelPort,
    NoAnswerError,
    ProtocolError,
    PtyEmulator,
    Reading,
)
from drivers.imu import ImuSample, Motion, Source, at_rest
from drivers.imu.razor import (
    AhrsDecoder,
    AhrsModel,
    Columns,
    Layout,
    MillisClock,
    Razor,
    RazorConfig,
    RazorDecoder,
    RazorModel,
    ReplayModel,
    razor_model,
    setting,
)
from drivers.imu.razor.columns import EVERY, FACTORY, WISHED


class SpeedPort(ModelPort):
    """Tells an AHRS model at which speed the host listens."""

    def set_baud(self, baud: int) -> None:
        super().set_baud(baud)
        assert isinstance(self.model, AhrsModel)
        self.model.host_baud = baud


def device(model: DeviceModel, config: RazorConfig | None = None) -> tuple[Razor, ModelPort]:
    kind = SpeedPort if isinstance(model, AhrsModel) else ModelPort
    port = kind(model, name="/dev/ttyACM0")

    def open_port(path: str, baud: int) -> ModelPort:
        assert (path, baud) == ("/dev/ttyACM0", 115200)
        port.closed = False
        if isinstance(model, AhrsModel) and model.baud is not None:
            model.host_baud = baud
        return port

    return Razor(config, open_port), port


def collect(imu: Razor, port: ModelPort, seconds: float) -> list[Reading[ImuSample]]:
    end_ns = port.now_ns() + round(seconds * 1e9)
    readings = []
    while port.now_ns() < end_ns:
        reading = imu.read(0.1)
        if reading is not None:
            readings.append(reading)
    return readings


def samples_of(readings: list[Reading[ImuSample]]) -> list[ImuSample]:
    return [sample for reading in readings for sample in reading.samples]


def test_a_board_from_the_factory_needs_one_key() -> None:
    model = RazorModel()
    imu, port = device(model)
    imu.connect()
    assert port.written == b"c"
    assert (model.columns, model.flash_writes) == (WISHED, 1)
    identity = imu.identify()
    assert identity["keys_pressed"] == "c"
    assert identity["accel_range"] == "2 g"
    assert identity["gyro_range"] == "2000 deg/s (the factory's: not to be seen)"
    assert port.now_ns() < 5e8


def test_a_board_that_is_as_wished_is_not_touched() -> None:
    model = RazorModel(columns=WISHED)
    imu, port = device(model)
    imu.connect()
    assert not port.written
    assert model.flash_writes == 0
    assert imu.identify()["flash"] == "unchanged"


def keys_needed(columns: Columns) -> int:
    return sum(a != b for a, b in zip(vars(columns).values(), vars(WISHED).values(), strict=True))


def as_recorded(t_ns: int) -> Motion:
    """A real chip at rest: bias and size of 1 g of the recording in data/imu, tilted a little."""
    tremble = 2e-3 * math.sin(1e-7 * t_ns)
    return Motion(
        (0.0093 + tremble, -0.001, -0.0353),
        (0.65, 4.02, 9.45 + 10.0 * tremble),
        (-20e-6, 8e-6, 38e-6),
        yaw_pitch_roll_rad=(2.0, 0.4, -0.07),
    )


@pytest.mark.parametrize("source", [at_rest, as_recorded])
def test_every_state_is_brought_to_the_wish_with_the_fewest_keys(source: Source) -> None:
    for columns in EVERY:
        model = RazorModel(source, columns=columns)
        imu, port = device(model)
        imu.connect()
        assert model.columns == WISHED, columns
        assert len(port.written) == keys_needed(columns), columns
        assert port.now_ns() < 5e9
        assert samples_of(collect(imu, port, 0.05))


def test_a_car_that_moves_at_start_is_brought_to_the_wish_all_the_same() -> None:
    """Sizes mislead then; keys may be wasted, but what comes out is right."""

    def driving(_: int) -> Motion:
        return Motion((0.1, -0.4, 4.0), (6.0, 9.0, 12.0))

    for columns in EVERY:
        model = RazorModel(driving, columns=columns)
        imu, port = device(model)
        imu.connect()
        assert model.columns == WISHED
        assert len(port.written) <= keys_needed(columns) + 8


def test_a_wrong_first_guess_is_found_out_by_the_next_key() -> None:
    """One degree of yaw alone looks like 1 g; the key c shows that it is none."""
    columns = Columns(True, False, False, False, False, True, False, raw=False)
    imu, port = device(
        RazorModel(lambda _: Motion(yaw_pitch_roll_rad=(math.radians(1), 0, 0)), columns=columns)
    )
    imu.connect()
    assert isinstance(port.model, RazorModel)
    assert port.model.columns == WISHED
    assert port.written == b"cagme"


def test_a_board_whose_keys_do_something_else_is_given_up_at_the_first() -> None:
    class Odd(RazorModel):
        def _press(self, key: str, now_ns: int) -> None:  # noqa: ARG002  its signature
            super()._press("e", now_ns)

    model = Odd()
    imu, _ = device(model)
    with pytest.raises(DeviceFaultError, match="does not do as the key 'c' says"):
        imu.connect()
    assert model.flash_writes == 1


def test_the_flash_is_not_worn_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setting, "MOST_KEYS", 7)
    model = RazorModel()
    model.rate_hz = 1
    imu, _ = device(model)
    with pytest.raises(DeviceFaultError, match=r"100 Hz with 7 keys \(rrrrrrr\)"):
        imu.connect()
    assert model.flash_writes == 7


def test_a_rate_that_cannot_be_had() -> None:
    class Slow(RazorModel):
        def _press(self, key: str, now_ns: int) -> None:
            super()._press(key, now_ns)
            self.rate_hz = min(self.rate_hz, 50)

    model = Slow(columns=WISHED)
    model.rate_hz = 50
    imu, _ = device(model)
    with pytest.raises(DeviceFaultError, match=r"does not answer the key 'r' with 100 \(it said"):
        imu.connect()


@pytest.mark.parametrize("rate_hz", [1, 10, 50, 60])
def test_the_rate_is_stepped_up_until_the_board_says_100(rate_hz: int) -> None:
    model = RazorModel()
    model.rate_hz = rate_hz
    imu, port = device(model)
    imu.connect()
    assert model.rate_hz == 100
    assert port.written.count(b"r") == (100 - rate_hz + 9) // 10
    assert port.now_ns() < 5e9


@pytest.mark.parametrize("rate_hz", [70, 80, 90])
def test_what_the_dmp_rounds_to_100_hz_needs_no_key(rate_hz: int) -> None:
    model = RazorModel(columns=WISHED)
    model.rate_hz = rate_hz
    imu, port = device(model)
    imu.connect()
    assert not port.written


@pytest.mark.parametrize("columns", [FACTORY, replace(FACTORY, time=False, heading=True)])
def test_one_line_a_second_is_sped_up_before_anything_else(columns: Columns) -> None:
    model = RazorModel(columns=columns)
    model.rate_hz = 1
    imu, port = device(model)
    imu.connect()
    assert (model.columns, model.rate_hz) == (WISHED, 100)
    assert port.written.startswith(b"r" * 10)
    assert port.now_ns() < 5e9


def test_values_arrive_in_si_units_in_the_accelerometers_frame() -> None:
    motion = Motion((0.5, -1.0, 2.0), (1.0, -2.0, 9.5), (20e-6, -5e-6, -40e-6))
    model = RazorModel(lambda t_ns: at_rest(t_ns) if t_ns < 10**9 else motion)
    imu, port = device(model)
    imu.connect()
    last = samples_of(collect(imu, port, 1.5))[-1]
    assert last.angular_velocity_rad_s == pytest.approx((0.5, -1.0, 2.0), abs=6e-4)
    assert last.linear_acceleration_m_s2 == pytest.approx((1.0, -2.0, 9.5), abs=4e-4)
    assert last.magnetic_field_t == pytest.approx((20e-6, -5e-6, -40e-6), abs=0.1e-6)


@pytest.mark.parametrize("range_g", [2, 4, 8, 16])
def test_the_accelerometers_full_scale_is_seen_at_rest(range_g: int) -> None:
    model = RazorModel(columns=WISHED)
    model.accel_range_g = range_g
    imu, port = device(model)
    imu.connect()
    assert imu.identify()["accel_range_g"] == range_g
    z = samples_of(collect(imu, port, 0.1))[-1].linear_acceleration_m_s2[2]
    assert z == pytest.approx(9.80665, abs=0.01)
    assert port.written == b""


def test_full_scales_that_are_wished_are_set_once() -> None:
    model = RazorModel()
    imu, port = device(model, RazorConfig(accel_range_g=8, gyro_range_deg_s=1000))
    imu.connect()
    assert (model.accel_range_g, model.gyro_range_deg_s) == (8, 1000)
    assert port.written == b"cAAGGG"
    assert imu.identify()["gyro_range"] == "1000 deg/s"
    imu.close()
    imu.connect()
    assert port.written == b"cAAGGG"  # it is in flash: not again
    sample = samples_of(collect(imu, port, 0.1))[-1]
    assert sample.linear_acceleration_m_s2[2] == pytest.approx(9.80665, abs=0.01)


def test_a_moving_car_does_not_unlearn_its_full_scale() -> None:
    hard = False

    def source(t_ns: int) -> Motion:
        motion = at_rest(t_ns)
        return replace(motion, linear_acceleration_m_s2=(7.0, 7.0, 9.8)) if hard else motion

    model = RazorModel(source)
    imu, port = device(model)
    imu.connect()
    imu.close()
    hard = True
    imu.connect()
    assert imu.identify()["accel_range_g"] == 2
    fresh, _ = device(model)
    fresh.connect()
    assert fresh.identify()["accel_range"] == "2 g (likely: it moved at start)"
    assert port.written == b"c"


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


@settings(max_examples=25)
@given(st.sampled_from(EVERY), st.integers(0, 2**32 - 1), st.integers(0, 5))
def test_whatever_the_board_does_connect_ends_in_time(
    columns: Columns, boot_ms: int, skip_every: int
) -> None:
    model = RazorModel(columns=columns, boot_ms=boot_ms)
    model.skip_every = skip_every
    imu, port = device(model)
    try:
        imu.connect()
    except DriverError:
        assert port.closed
        assert skip_every == 1
    else:
        assert model.columns == WISHED
    assert port.now_ns() < 5e9


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


def test_a_recording_can_be_played_to_the_driver() -> None:
    imu, port = device(RazorModel())
    imu.connect()
    readings = collect(imu, port, 3.0)
    chunks = [chunk for reading in readings for chunk in reading.raw]
    again, port = device(razor_model(chunks))
    again.connect()
    replayed = samples_of(collect(again, port, 1.0))
    recorded = {s.device_ns: s.angular_velocity_rad_s for s in samples_of(readings)}
    assert len(replayed) > 95
    assert all(recorded[s.device_ns] == s.angular_velocity_rad_s for s in replayed)


def test_a_recording_keeps_its_pace_and_ends_or_begins_again() -> None:
    chunks = [Chunk(5_000_000_000, b"a"), Chunk(5_010_000_000, b"b"), Chunk(5_500_000_000, b"c")]
    port = ModelPort(ReplayModel(chunks), start_ns=10**9)
    times = []
    while (chunk := port.read(1.0)) is not None:
        times.append((chunk.t_ns // 1_000_000, chunk.data))
    assert times == [(1000, b"a"), (1010, b"b"), (1500, b"c")]
    port = ModelPort(ReplayModel(chunks, repeat=True), start_ns=10**9)
    data = b""
    for _ in range(7):
        chunk = port.read(1.0)
        assert chunk is not None
        data += chunk.data
    assert data == b"abcabca"


def test_nothing_recorded_is_silence() -> None:
    assert ModelPort(ReplayModel([])).read(1.0) is None


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


@pytest.mark.parametrize(("g", "deg_s"), [(3, None), (None, 300)])
def test_a_full_scale_that_there_is_not(g: int | None, deg_s: int | None) -> None:
    with pytest.raises(UsageError, match="the board knows"):
        RazorConfig(accel_range_g=g, gyro_range_deg_s=deg_s)


def test_the_ahrs_decoder_reads_a_raw_log_later() -> None:
    imu, port = device(AhrsModel())
    imu.connect()
    readings = collect(imu, port, 0.5)
    decoder = AhrsDecoder(imu.counters, 57600)
    again = [decoder.feed(chunk) for reading in readings for chunk in reading.raw]
    assert samples_of(again)[1:] == samples_of(readings)[1:]
