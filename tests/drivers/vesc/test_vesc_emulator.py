from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Chunk, DeviceFaultError, ProtocolError
from drivers.vesc import (
    DrivenMotor,
    Firmware,
    FrameReceiver,
    SourceMotor,
    VescModel,
    VescValues,
    decode_values,
    emulated_vesc,
    encode_command,
    encode_frame,
)
from drivers.vesc.commands import Kind
from drivers.vesc.emulator import FIRMWARES

MS, S = 1_000_000, 1_000_000_000


def ask(model: VescModel, payload: bytes, t_ns: int = 0) -> list[bytes]:
    model.receive(encode_frame(payload), t_ns)
    frames = FrameReceiver().feed(model.transmit(t_ns + S))
    return [frame.payload for frame in frames]


def command(model: VescModel, kind: Kind, value: float, t_ns: int) -> None:
    model.receive(encode_command(model.firmware, kind, value).frame, t_ns)


@pytest.mark.parametrize(
    ("firmware", "version_bytes", "values_bytes"),
    [("2.18", 3, 56), ("3.40", 19, 59), ("5.02", 21, 73), ("5.03", 21, 74), ("6.02", 35, 74)],
)
def test_replies_have_the_lengths_of_the_firmware(
    firmware: str, version_bytes: int, values_bytes: int
) -> None:
    assert firmware in FIRMWARES
    model = emulated_vesc(firmware)
    (version,) = ask(model, b"\0")
    (values,) = ask(model, b"\4")
    assert (len(version), len(values)) == (version_bytes, values_bytes)
    assert decode_values(values, model.firmware).input_voltage_v == 11.7


def test_the_version_replies_are_those_of_the_reference() -> None:
    """reference/protocols.md B.5."""
    model = emulated_vesc("5.02")
    model.receive(bytes.fromhex("02 01 00 00 00 03"), 0)
    expected = "02 15 00 05 02 34 31 30 00 01 02 03 04 05 06 07 08 09 0A 0B 0C 00 00 E3 18 03"
    assert model.transmit(S) == bytes.fromhex(expected)


@pytest.mark.parametrize(
    ("firmware", "payload", "name"),
    [
        ("5.02", "0B 01 F4", "SET_DETECT"),  # the servo of old firmware
        ("5.02", "1D", "REBOOT"),  # the ALIVE of old firmware
        ("2.18", "0C 01 F4", "SET_MCCONF"),  # the servo of new firmware
        ("2.18", "0A 00 00 13 88", "SET_DETECT"),  # the handbrake of new firmware
        ("2.18", "1C", "REBOOT"),
        ("6.02", "0D 00", "SET_MCCONF"),
        ("3.40", "01", "JUMP_TO_BOOTLOADER"),
    ],
)
def test_what_would_do_harm_is_recorded(firmware: str, payload: str, name: str) -> None:
    model = emulated_vesc(firmware)
    assert ask(model, bytes.fromhex(payload), 5) == []
    assert [(danger.t_ns, danger.name) for danger in model.dangers] == [(5, name)]
    assert model.obeyed == []
    assert model.servo == 0.5


def test_a_reboot_is_a_second_of_silence_and_new_counters() -> None:
    model = VescModel(Firmware(5, 2), DrivenMotor(tachometer=1000))
    assert ask(model, b"\x1d") == []
    assert ask(model, b"\4", S // 2) == []
    (values,) = ask(model, b"\4", S)
    assert decode_values(values, model.firmware).tachometer == 0


def test_unknown_packets_are_skipped() -> None:
    model = emulated_vesc("2.18")
    for payload in (b"\xde\4\0", b"\x32\0\0\1\0", b"\x2f"):
        assert ask(model, payload) == []
    assert model.unknown == [0xDE, 0x32, 0x2F]
    assert ask(model, b"\x08\0\0") == []  # too short
    assert model.obeyed == []


def test_the_watchdog_lets_the_motor_go_at_its_very_moment() -> None:
    motor = DrivenMotor()
    model = VescModel(Firmware(5, 3), motor)
    command(model, "rpm", 4614, 0)
    command(model, "servo", 0.7, 900 * MS)  # does not feed it
    (values,) = ask(model, b"\4", 999 * MS)
    assert decode_values(values, model.firmware).erpm == pytest.approx(4614, abs=1)
    (values,) = ask(model, b"\4", 1800 * MS)
    state = decode_values(values, model.firmware)
    assert state.erpm == pytest.approx(4614 / math.e, rel=1e-3)  # coasting for its 0.8 s
    assert state.timed_out
    assert (model.timeouts, model.servo) == (1, 0.7)
    command(model, "alive", 0, 1900 * MS)
    assert not model.timed_out


def test_alive_and_motor_commands_feed_the_watchdog() -> None:
    model = emulated_vesc("3.40")
    for count in range(5):
        command(model, "rpm" if count % 2 else "alive", 1000, count * 900 * MS)
    model.transmit(4 * 900 * MS + 999 * MS)
    assert model.timeouts == 0
    model.transmit(4 * 900 * MS + 1000 * MS)
    assert model.timeouts == 1


@given(st.lists(st.tuples(st.sampled_from(["rpm", "duty", "current", "brake"]), st.floats(-1, 1))))
def test_the_counts_are_the_integral_of_the_speed(steps: list[tuple[Kind, float]]) -> None:
    """Against the trapezoidal rule at 1 kHz; also that the unsigned count is that of |speed|."""
    scales = {"rpm": 20_000.0, "duty": 0.4, "current": 15.0, "brake": 10.0}
    motor, net, total, t_ns = DrivenMotor(), 0.0, 0.0, 0
    for kind, share in steps[:4]:
        motor.command(kind, scales[kind] * share, t_ns)
        for _ in range(300):
            before, t_ns = motor.erpm, t_ns + MS
            motor.values(t_ns)
            net += (before + motor.erpm) / 2 * 1e-3 / 10
            total += abs(before + motor.erpm) / 2 * 1e-3 / 10
    values = motor.values(t_ns)
    assert values.tachometer == pytest.approx(net, abs=1.1)
    assert values.tachometer_abs == pytest.approx(total, abs=3)


def test_one_step_that_turns_round_counts_both_ways() -> None:
    motor = DrivenMotor()
    motor.command("rpm", 10_000, 0)
    motor.values(2 * S)
    motor.command("rpm", -10_000, 2 * S)
    values, fine = motor.values(4 * S), DrivenMotor()
    fine.command("rpm", 10_000, 0)
    fine.values(2 * S)
    fine.command("rpm", -10_000, 2 * S)
    for t_ms in range(2000, 4000):
        fine.values(t_ms * MS)
    assert values.tachometer == fine.values(4 * S).tachometer
    assert values.tachometer_abs == fine.values(4 * S).tachometer_abs
    assert values.tachometer_abs is not None
    assert values.tachometer_abs > 3000


def test_the_counter_wraps() -> None:
    motor = DrivenMotor(tachometer=2**31 - 1)
    motor.command("rpm", 1000, 0)
    values = motor.values(S)
    assert values.tachometer_abs == 90  # 1000 ERPM for 0.9 s: the lag takes 0.1 s
    assert values.tachometer == -(2**31) + 89


def test_a_function_of_time_can_stand_for_the_motor() -> None:
    model = VescModel(
        Firmware(5, 3), SourceMotor(lambda t_ns: VescValues(t_ns, 0, tachometer=t_ns // MS))
    )
    (values,) = ask(model, b"\4", 77 * MS)
    assert decode_values(values, model.firmware).tachometer == 77


def test_over_a_uart_bytes_take_their_time() -> None:
    model = VescModel(Firmware(5, 2), baud=115200)
    model.faults.reply_delay_ns = 0
    model.receive(encode_frame(b"\4"), 0)
    byte_ns = 10 * S // 115200
    assert model.next_ns() == pytest.approx((6 + 78) * byte_ns, abs=100)


def test_recorded_replies_come_at_their_time_and_end() -> None:
    there = emulated_vesc("5.02")
    replies = [encode_frame(ask(there, b"\4", t * 20 * MS)[0]) for t in range(3)]
    line = b"".join(replies)
    chunks = [Chunk(7 * S + t * 20 * MS, reply) for t, reply in enumerate(replies)]
    model = emulated_vesc("5.02", chunks)
    played = [ask(model, b"\4", S + t * MS) for t in (0, 1, 20, 21, 40, 41)]
    payloads = [frame.payload for frame in FrameReceiver().feed(line)]
    assert played == [[payloads[n]] for n in (0, 1, 1, 2, 2)] + [[]]
    assert ask(model, b"\x32\0\0\1\0") == []


def test_a_recording_must_fit_the_firmware() -> None:
    reply = encode_frame(ask(emulated_vesc("2.18"), b"\4")[0])
    with pytest.raises(ProtocolError, match=r"56 bytes are no state .* firmware 5\.02"):
        emulated_vesc("5.02", [Chunk(0, reply)])
    with pytest.raises(ValueError, match="no reply of a VESC"):
        emulated_vesc("2.18", [Chunk(0, reply[1:])])


@pytest.mark.parametrize("firmware", ["", "5", "five.2", "5.x", "-5.2"])
def test_versions_that_are_none(firmware: str) -> None:
    with pytest.raises(ValueError, match=r"expected one such as 5\.02"):
        emulated_vesc(firmware)


def test_versions_that_nobody_knows() -> None:
    with pytest.raises(DeviceFaultError, match=r"1\.13"):
        emulated_vesc("1.13")
