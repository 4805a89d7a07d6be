"""Who is on the port is told within five seconds, whoever it is."""

from __future__ import annotations

import pytest
from vesc_talk import S, Stranger, made, readings, samples

from drivers import (
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    NoAnswerError,
    ProtocolError,
)
from drivers.vesc import (
    Firmware,
    VescModel,
    emulated_vesc,
    encode_frame,
)


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
