"""Conversations in simulated time: every firmware and every fault."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from vesc_talk import MS, S, Stranger, connected, made, model_of, readings, samples

from drivers import (
    Chunk,
    Device,
    DeviceFaultError,
    DeviceLostError,
    NoAnswerError,
)
from drivers.vesc import (
    ASK_SETUP,
    ODOMETRY_MASK,
    DrivenMotor,
    Firmware,
    FrameReceiver,
    ReadId,
    ReadRequest,
    SourceMotor,
    VescConfig,
    VescModel,
    VescValues,
    decode_imu,
    decode_setup,
    emulated_vesc,
    encode_command,
    encode_frame,
)
from drivers.vesc.emulator import FIRMWARES


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


# --- faults while it is read


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
