"""Conversations in simulated time: every firmware, every fault, and what a logger may say."""

from __future__ import annotations

import ast
import inspect
import math
import threading
from collections.abc import Sequence
from itertools import pairwise

import pytest

from drivers import (
    Chunk,
    Device,
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    ModelPort,
    NoAnswerError,
    ProtocolError,
)
from drivers.device import Reading
from drivers.emulation import DeviceModel
from drivers.vesc import (
    ASK_SETUP,
    ODOMETRY_MASK,
    DrivenMotor,
    Firmware,
    FrameReceiver,
    ReadId,
    ReadRequest,
    SourceMotor,
    Vesc,
    VescConfig,
    VescModel,
    VescValues,
    channel,
    decode_imu,
    decode_setup,
    driver,
    emulated_vesc,
    encode_command,
    encode_frame,
    handshake,
)
from drivers.vesc.channel import ReadChannel
from drivers.vesc.emulator import FIRMWARES

MS, S = 1_000_000, 1_000_000_000
CONFIG = VescConfig(port="/dev/ttyACM0")


def made(model: DeviceModel, config: VescConfig = CONFIG) -> tuple[Vesc, ModelPort]:
    port = ModelPort(model, name=config.port)

    def open_port(path: str, baud: int) -> ModelPort:
        assert (path, baud) == (config.port, config.baud)
        port.plug()
        return port

    return Vesc(config, open_port), port


def readings(vesc: Vesc, port: ModelPort, seconds: float) -> list[Reading[VescValues]]:
    end_ns, all_of_them = port.now_ns() + round(seconds * 1e9), []
    while port.now_ns() < end_ns:
        reading = vesc.read(min((end_ns - port.now_ns()) * 1e-9, 0.1))
        if reading is not None:
            all_of_them.append(reading)
    return all_of_them


def samples(all_of_them: Sequence[Reading[VescValues]]) -> list[VescValues]:
    return [values for reading in all_of_them for values in reading.samples]


class Stranger:
    """Another device, or none: says one thing every `period_ns`, whatever it hears."""

    def __init__(self, data: bytes = b"", period_ns: int = 10 * MS) -> None:
        self.data, self.period_ns, self.at_ns = data, period_ns, 0

    def receive(self, data: bytes, now_ns: int) -> None:
        pass

    def transmit(self, now_ns: int) -> bytes:
        said = b""
        while self.data and self.at_ns <= now_ns:
            said, self.at_ns = said + self.data, self.at_ns + self.period_ns
        return said

    def next_ns(self) -> int | None:
        return self.at_ns if self.data else None


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_every_firmware_is_read_at_the_asked_rate(firmware: str) -> None:
    model = emulated_vesc(firmware)
    vesc, port = made(model)
    device: Device[VescValues] = vesc
    device.connect()
    got = readings(vesc, port, 10.0)
    assert len(samples(got)) == 500
    assert vesc.counters.samples == 500
    assert (vesc.counters.timeouts, vesc.counters.bad_frames, vesc.counters.bad_bytes) == (0, 0, 0)
    assert all(reading.ticks == () for reading in got)
    lengths = {"2.18": 56, "3.40": 59, "5.02": 73}
    identity = dict(vesc.identify())
    assert identity == {
        "model": "VESC",
        "firmware": firmware,
        "hardware": "not told" if firmware == "2.18" else "410",
        "serial": "not told" if firmware == "2.18" else "0102030405060708090a0b0c",
        "link": "usb",
        "rate_hz": 50.0,
        "request": "VALUES",
        "mask": None,
        "layout_bytes": lengths.get(firmware, 74),
    }
    assert model.dangers == []
    assert model.unknown == []
    device.close()
    device.close()
    assert port.closed


def test_raw_is_every_byte_with_its_time() -> None:
    vesc, port = made(emulated_vesc("5.02"))
    vesc.connect()
    raw = [chunk for reading in readings(vesc, port, 1.0) for chunk in reading.raw]
    payloads = [
        frame.payload
        for receiver in [FrameReceiver()]
        for chunk in raw
        for frame in receiver.feed(chunk.data)
    ]
    assert len(payloads) == 50
    assert {payload[0] for payload in payloads} == {4}
    assert [chunk.t_ns for chunk in raw] == sorted({chunk.t_ns for chunk in raw})


def test_the_schedule_does_not_drift_and_skips_what_it_missed() -> None:
    vesc, port = made(emulated_vesc("5.02"), VescConfig(port="/dev/ttyACM0", rate_hz=30.0))
    vesc.connect()
    times = [values.t_ns for values in samples(readings(vesc, port, 20.0))]
    period_ns = round(1e9 / 30)
    assert {(t_ns - times[0]) % period_ns for t_ns in times} == {0}
    assert len(times) == 600
    port.pause(1.0)  # the reader's thread was held up
    late = [values.t_ns for values in samples(readings(vesc, port, 1.0))]
    assert vesc.counters.details["skipped_polls"] in (29, 30)
    assert {(t_ns - times[0]) % period_ns for t_ns in late[1:]} == {0}


def test_a_state_is_of_the_moment_midway() -> None:
    model = VescModel(
        Firmware(5, 3), SourceMotor(lambda t_ns: VescValues(t_ns, 0, tachometer=t_ns // 1000))
    )
    model.faults.reply_delay_ns = 3 * MS
    vesc, port = made(model)
    vesc.connect()
    for values in samples(readings(vesc, port, 1.0)):
        assert values.tachometer is not None
        assert values.uncertainty_ns == 1.5 * MS
        assert abs(values.tachometer * 1000 - values.t_ns) <= values.uncertainty_ns


def test_over_a_uart_the_time_on_the_wire_is_taken_off() -> None:
    """79 bytes back and 6 there: the bare midpoint would be 3.2 ms late."""
    model = VescModel(
        Firmware(5, 3),
        SourceMotor(lambda t_ns: VescValues(t_ns, 0, tachometer=t_ns // 1000)),
        baud=115200,
    )
    model.faults.reply_delay_ns = 100_000
    model.faults.prints = True
    config = VescConfig(port="/dev/ttyS0", link="uart")
    vesc, port = made(model, config)
    vesc.connect()
    got = samples(readings(vesc, port, 1.0))
    assert len(got) == 50
    for values in got:
        assert values.tachometer is not None
        # The text before the reply cannot be known to have held it up.
        assert values.uncertainty_ns < 0.8 * MS
        error_ns = values.tachometer * 1000 - values.t_ns
        assert abs(error_ns) <= values.uncertainty_ns + 1000  # counts of microseconds


@pytest.mark.parametrize("firmware", ["5.02", "6.02"])
def test_selected_fields_only(firmware: str) -> None:
    config = VescConfig(port="/dev/ttyACM0", mask=ODOMETRY_MASK, rate_hz=200)
    vesc, port = made(emulated_vesc(firmware), config)
    vesc.connect()
    got = samples(readings(vesc, port, 1.0))
    assert len(got) == 200
    assert (got[0].input_voltage_v, got[0].tachometer, got[0].fault) == (11.7, 0, 0)
    assert math.isnan(got[0].duty)
    assert vesc.identify()["layout_bytes"] == 20


def test_old_firmware_cannot_select() -> None:
    vesc, port = made(emulated_vesc("3.40"), VescConfig(port="/dev/ttyACM0", mask=ODOMETRY_MASK))
    with pytest.raises(DeviceFaultError, match=r"3\.40 does not answer VALUES_SELECTIVE"):
        vesc.connect()
    assert port.closed


def test_the_rarer_questions() -> None:
    vesc, port = made(emulated_vesc("6.02"))
    vesc.connect()
    assert decode_setup(vesc.ask(ASK_SETUP)).input_voltage_v == 11.7
    imu = decode_imu(vesc.ask(ReadRequest(ReadId.IMU, 0xFFFF)))
    assert imu.acceleration_z_m_s2 == pytest.approx(9.80665)
    assert (imu.quaternion_w, imu.controller_id) == (1.0, 0)
    assert len(samples(readings(vesc, port, 1.0))) >= 49
    old, _ = made(emulated_vesc("2.18"))
    old.connect()
    with pytest.raises(DeviceFaultError, match=r"2\.18 does not answer SETUP"):
        old.ask(ASK_SETUP)


# --- what is no VESC, and what is one that cannot be read


@pytest.mark.parametrize(
    ("said", "error", "told"),
    [
        (b"", NoAnswerError, r'silent for 2\.4 s.*"App to use" set to UART'),
        (b"AT\r\nAT\r\n", ProtocolError, r"no VESC's frame: b'AT"),
        (b"#YPR=1.00,2.00,3.00\r\n", ProtocolError, r"#YPR=1.00.*trackside devices"),
        (b"\xa5\x5a\x05\0\0\x40\x81" + bytes(50), ProtocolError, r"RPLidar answers"),
        (b"\x03\x04\x00" + b"\x7e" * 5, ProtocolError, r"no VESC's frame"),
        (encode_frame(b"\x15text"), NoAnswerError, r"good frames and no FW_VERSION"),
        (encode_frame(b"\0\2\7"), DeviceFaultError, r"firmware 2\.07.*update it"),
        (encode_frame(b"\0\5"), ProtocolError, r"no FW_VERSION reply of a VESC: 00 05"),
        (encode_frame(b"\0\5\2"), NoAnswerError, r"did not answer VALUES within 0\.9 s"),
    ],
)
def test_what_else_may_be_there_is_told_within_five_seconds(
    said: bytes, error: type[DriverError], told: str
) -> None:
    vesc, port = made(Stranger(said))
    with pytest.raises(error, match=told) as caught:
        vesc.connect()
    assert "/dev/ttyACM0" in str(caught.value) or "reply of a VESC" in str(caught.value)
    assert port.now_ns() < 5 * S
    assert port.closed
    with pytest.raises(DeviceLostError, match="connect it first"):
        vesc.read(0.1)


def test_a_scanning_lidar_is_no_vesc() -> None:
    """A flood without a pause: 2000 nodes of 5 bytes a second."""
    vesc, port = made(Stranger(bytes.fromhex("3E 01 02 03 00"), 500_000))
    with pytest.raises(ProtocolError, match=r"no VESC's frame: b'>"):
        vesc.connect()
    assert port.now_ns() < 5 * S


def test_what_modem_manager_wrote_is_drained() -> None:
    model = emulated_vesc("5.02")
    vesc, port = made(model)
    port.write(b"AT\rAT+GCAP\r" + encode_frame(b"\4")[:3])  # and half a question of another program
    model.faults.noise = b"AT\x02\x03\xff"
    vesc.connect()
    assert len(samples(readings(vesc, port, 1.0))) == 50
    assert vesc.counters.bad_bytes >= 50


def test_noise_that_promises_a_long_frame_does_not_hide_the_vesc() -> None:
    model = emulated_vesc("5.02")
    model.faults.noise = b"\x03\x04\x00"
    vesc, port = made(model)
    vesc.connect()
    assert port.now_ns() < S


def test_a_vesc_that_starts_late_is_waited_for() -> None:
    model = emulated_vesc("5.02")
    model.reboot(0)
    vesc, port = made(model)
    vesc.connect()
    assert S < port.now_ns() < 2 * S


def test_a_reply_longer_than_this_firmware_sends_is_told_at_once() -> None:
    class Odd(VescModel):
        def _reply(self, number: int, data: bytes, t_ns: int) -> bytes | None:
            reply = super()._reply(number, data, t_ns)
            return reply + b"\0" if reply and number == 4 else reply

    vesc, _ = made(Odd(Firmware(2, 18)))
    with pytest.raises(ProtocolError, match=r"57 bytes are no state.*expected 56 bytes"):
        vesc.connect()


# --- faults while it is read


def connected(firmware: str = "5.02", config: VescConfig = CONFIG) -> tuple[Vesc, ModelPort]:
    vesc, port = made(emulated_vesc(firmware), config)
    vesc.connect()
    return vesc, port


def model_of(port: ModelPort) -> VescModel:
    assert isinstance(port.model, VescModel)
    return port.model


@pytest.mark.parametrize("firmware", ["2.18", "5.02"])
def test_text_between_the_replies(firmware: str) -> None:
    vesc, port = connected(firmware)
    model_of(port).faults.prints = True
    assert len(samples(readings(vesc, port, 1.0))) == 50
    assert vesc.counters.details["prints"] == 100
    assert vesc.counters.bad_bytes == 0


@pytest.mark.parametrize(("piece_bytes", "replies"), [(1, 50), (7, 100), (64, 100)])
def test_replies_in_pieces(piece_bytes: int, replies: int) -> None:
    vesc, port = connected()
    model_of(port).faults.piece_bytes = piece_bytes
    got = readings(vesc, port, 2.0)
    # Byte by byte, one takes 39 ms: every other turn is missed.
    assert len(samples(got)) == pytest.approx(replies, abs=1)
    assert len(got) >= replies * math.ceil(78 / piece_bytes)
    assert (vesc.counters.timeouts, vesc.counters.bad_bytes) == (0, 0)


def test_lost_replies_are_counted_and_the_next_one_is_right() -> None:
    vesc, port = connected()
    model_of(port).faults.lose_every = 10
    got = samples(readings(vesc, port, 10.0))
    lost = vesc.counters.timeouts
    assert lost == pytest.approx(len(got) / 9, abs=1)
    # A lost one costs twice the time-out: 5 periods of 20 ms.
    assert len(got) == pytest.approx(500 - 5 * lost, abs=5)
    sure = [values for values in got if values.uncertainty_ns == 250_000]
    assert len(got) - len(sure) == pytest.approx(lost, abs=1)  # might be late ones: they say so


def test_bits_that_flip_cost_a_frame_and_no_more() -> None:
    vesc, port = connected()
    model_of(port).faults.flip_every = 7
    got = samples(readings(vesc, port, 20.0))
    assert vesc.counters.bad_frames >= vesc.counters.timeouts > 10
    assert len(got) > 500
    assert {values.input_voltage_v for values in got} == {11.7}
    assert {values.fault for values in got} == {0}


def test_a_late_answer_gets_its_own_time() -> None:
    model = VescModel(
        Firmware(5, 3), SourceMotor(lambda t_ns: VescValues(t_ns, 0, tachometer=t_ns // 1000))
    )
    vesc, port = made(model)
    vesc.connect()
    model.faults.reply_delay_ns = 80 * MS
    got = samples(readings(vesc, port, 2.0))
    assert len(got) >= 19
    assert vesc.counters.timeouts >= len(got)
    for values in got:
        assert values.tachometer is not None
        assert abs(values.tachometer * 1000 - values.t_ns) <= values.uncertainty_ns


def test_an_answer_after_the_next_question_says_how_unsure_it_is() -> None:
    model = VescModel(
        Firmware(5, 3), SourceMotor(lambda t_ns: VescValues(t_ns, 0, tachometer=t_ns // 1000))
    )
    vesc, port = made(model)
    vesc.connect()
    model.faults.reply_delay_ns = 105 * MS
    readings(vesc, port, 0.01)
    model.faults.reply_delay_ns = 30 * MS
    got = samples(readings(vesc, port, 0.14))
    assert got[0].tachometer is not None
    assert 40 * MS < abs(got[0].tachometer * 1000 - got[0].t_ns) <= got[0].uncertainty_ns


def test_fault_codes_come_through() -> None:
    vesc, port = connected()
    model_of(port).faults.fault_code = 4
    assert {values.fault for values in samples(readings(vesc, port, 0.5))} == {4}


def test_silence_is_a_lost_device_and_connecting_again_mends_it() -> None:
    vesc, port = connected()
    readings(vesc, port, 1.0)
    model_of(port).faults.silent = True
    start_ns = port.now_ns()
    with pytest.raises(DeviceLostError, match=r"10 questions in a row .*battery"):
        readings(vesc, port, 10.0)
    assert port.now_ns() - start_ns == pytest.approx(S, abs=0.1 * S)
    assert vesc.counters.timeouts == 10
    vesc.close()
    with pytest.raises(NoAnswerError):
        vesc.connect()
    model_of(port).faults.silent = False
    vesc.connect()
    assert len(samples(readings(vesc, port, 1.0))) == 50


def test_a_pulled_cable_is_a_lost_device() -> None:
    vesc, port = connected()
    port.unplug()
    with pytest.raises(DeviceLostError, match="plug it in again"):
        vesc.read(0.1)
    vesc.close()
    vesc.connect()  # the port of these tests mends itself when it is opened
    assert len(samples(readings(vesc, port, 1.0))) == 50


def test_what_the_receiver_threw_away_is_counted_even_when_nothing_follows() -> None:
    vesc, port = connected()
    port.model = Stranger(b"\x03\x04\x00", 10 * S)
    with pytest.raises(DeviceLostError):
        readings(vesc, port, 10.0)
    assert vesc.counters.bad_bytes == 3
    assert vesc.counters.bad_frames == 1


def test_a_reply_of_the_wrong_length_is_counted_and_not_believed() -> None:
    vesc, port = connected()
    port.model = Stranger(encode_frame(b"\4" + bytes(59)))
    with pytest.raises(DeviceLostError):
        readings(vesc, port, 10.0)
    assert vesc.counters.details["undecodable_frames"] > 10
    assert vesc.counters.samples == 0


def test_closing_from_elsewhere_ends_an_attempt_to_connect() -> None:
    class Closing(Stranger):
        def transmit(self, now_ns: int) -> bytes:
            if now_ns > S:
                vesc.close()
            return super().transmit(now_ns)

    vesc, port = made(Closing())
    with pytest.raises(DeviceLostError):
        vesc.connect()
    assert port.closed
    with pytest.raises(DeviceLostError, match="connect it first"):
        vesc.read(0.1)


def test_what_was_not_asked_is_counted() -> None:
    vesc, port = connected()
    port.write(ASK_SETUP.frame)
    readings(vesc, port, 0.1)
    assert vesc.counters.details["unexpected_frames"] == 1


def test_nothing_in_time_is_none() -> None:
    vesc, port = connected(config=VescConfig(port="/dev/ttyACM0", rate_hz=1.0))
    assert vesc.read(0.1) is not None
    start_ns = port.now_ns()
    assert vesc.read(0.25) is None
    assert port.now_ns() - start_ns == 250 * MS


def test_a_recording_comes_back_as_it_was() -> None:
    model = VescModel(Firmware(5, 2), DrivenMotor())
    vesc, port = made(model)
    vesc.connect()
    model.receive(encode_command(model.firmware, "rpm", 3000).frame, port.now_ns())
    recorded = readings(vesc, port, 2.0)
    chunks: list[Chunk] = [chunk for reading in recorded for chunk in reading.raw]
    again, port = made(emulated_vesc("5.02", chunks))
    again.connect()
    replayed = samples(readings(again, port, 1.9))
    counts = [values.tachometer for values in samples(recorded)]
    at = [counts.index(values.tachometer) for values in replayed[5:]]
    assert {b - a for a, b in pairwise(at)} == {1}
    with pytest.raises(DeviceLostError, match="unanswered"):
        readings(again, port, 3.0)


# --- what a logger may say


def test_every_byte_that_a_logger_writes_is_a_question() -> None:
    """Through every firmware, every fault, lost devices, and other devices on the port."""
    allowed = {0, 4, 47, 50, 51, 65}
    for firmware in FIRMWARES:
        model = emulated_vesc(firmware)
        mask = ODOMETRY_MASK if model.firmware.version >= (3, 48) else None
        vesc, port = made(model, VescConfig(port="/dev/ttyACM0", mask=mask))
        vesc.connect()
        faults = model.faults
        faults.prints, faults.flip_every, faults.piece_bytes = True, 3, 20
        readings(vesc, port, 2.0)
        faults.fault_code, faults.lose_every, faults.noise = 1, 2, b"\x02\x03\x0c"
        readings(vesc, port, 2.0)
        if mask:
            vesc.ask(ASK_SETUP)
        faults.silent = True
        with pytest.raises(DriverError):
            readings(vesc, port, 5.0)
        with pytest.raises(DriverError):
            vesc.connect()
        vesc.close()
        receiver = FrameReceiver()
        frames = receiver.feed(bytes(port.written))
        assert {frame.payload[0] for frame in frames} <= allowed
        assert receiver.expire() == []
        assert receiver.bad_bytes == 0  # every byte is part of such a frame
        assert (model.dangers, model.obeyed) == ([], [])
    vesc, port = made(Stranger(b"\x0c\x01\xf4" * 5))
    with pytest.raises(DriverError):
        vesc.connect()
    frames = FrameReceiver().feed(bytes(port.written))
    assert {frame.payload for frame in frames} == {b"\0"}


def test_of_two_threads_that_write_one_waits() -> None:
    """Else a question could fall in the middle of a command."""
    writes: list[str] = []

    class Slow(ModelPort):
        def write(self, data: bytes) -> None:
            writes.append("begin")
            if len(writes) == 1:
                other.start()
                other.join(0.1)
            super().write(data)
            writes.append("end")

    shared = ReadChannel(Slow(Stranger()))
    other = threading.Thread(target=shared.ask, args=(ASK_SETUP,))
    shared.ask(ASK_SETUP)
    other.join(10)
    assert writes == ["begin", "end"] * 2


def test_a_logger_has_no_way_to_say_anything_else() -> None:
    """By construction: one place writes to the port, and a read channel hands it questions only."""
    writers = [
        module.__name__
        for module in (channel, driver, handshake)
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        if isinstance(node, ast.Attribute) and node.attr == "write"
    ]
    assert writers == [channel.__name__]
    public = {name for name in vars(ReadChannel) if not name.startswith("_")}
    assert public == {"now_ns", "ask", "read", "drain", "close"}
    assert inspect.signature(ReadChannel.ask).parameters["request"].annotation == "ReadRequest"
    private = {"_send"}
    users = [
        node.attr
        for module in (driver, handshake)
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        if isinstance(node, ast.Attribute) and node.attr in private | {"command"}
    ]
    assert users == []


@pytest.mark.parametrize(
    "change",
    [
        {"rate_hz": 0.0},
        {"rate_hz": 501.0},
        {"rate_hz": math.nan},
        {"reply_timeout_s": 0.0},
        {"lost_after": 0},
        {"mask": 0},
        {"mask": 1 << 32},
        {"baud": 0},
    ],
)
def test_configurations_that_cannot_be(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"rate_hz|reply_timeout_s|mask"):
        VescConfig(port="/dev/ttyACM0", **change)  # type: ignore[arg-type]  # the point of the test
