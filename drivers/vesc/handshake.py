"""The first words with what may be a VESC, and what to tell a person when it is none."""

from __future__ import annotations

from drivers.errors import DeviceFaultError, DriverError, NoAnswerError, ProtocolError
from drivers.vesc.channel import ReadChannel
from drivers.vesc.firmware import FIRST_KNOWN, Firmware, parse_firmware
from drivers.vesc.requests import ASK_VERSION, ReadRequest

VERSION_TRIES, ANSWER_TRIES = 8, 3
TRY_S = 0.3
KEPT_BYTES, SHOWN_BYTES = 4096, 24
LIDAR_ANSWER = b"\xa5\x5a"


class Heard:
    """What came while an answer was waited for: the first bytes, and how many good frames."""

    def __init__(self) -> None:
        self.start = b""
        self.frames = 0


def hear_version(channel: ReadChannel, name: str) -> Firmware:
    """The firmware of what is connected.

    Raises `NoAnswerError`, `ProtocolError` or `DeviceFaultError` within 2.7 s, saying what is
    there instead of a VESC that can be read.
    """
    # ModemManager may have filled it with AT commands, another program with half a frame.
    channel.drain(quiet_s=0.02, limit_s=0.3)
    heard = Heard()
    for _ in range(VERSION_TRIES):
        payload = _one_answer(channel, ASK_VERSION, heard)
        if payload is not None:
            firmware = parse_firmware(payload)
            if firmware.version >= FIRST_KNOWN:
                return firmware
            raise DeviceFaultError(
                f"{name} has firmware {firmware}, whose replies nobody here knows (2.10 and "
                "later); update it with VESC Tool"
            )
    raise _no_version(name, heard)


def answer(channel: ReadChannel, request: ReadRequest, name: str) -> bytes:
    """The payload of the answer to a question. Raises `NoAnswerError` after 0.9 s."""
    heard = Heard()
    for _ in range(ANSWER_TRIES):
        payload = _one_answer(channel, request, heard)
        if payload is not None:
            return payload
    raise NoAnswerError(
        f"{name} told its firmware but did not answer {request.id.name} within "
        f"{ANSWER_TRIES * TRY_S:.1f} s; restart it, or update its firmware"
    )


def _one_answer(channel: ReadChannel, request: ReadRequest, heard: Heard) -> bytes | None:
    end_ns = channel.ask(request) + round(TRY_S * 1e9)
    while (left_ns := end_ns - channel.now_ns()) > 0:
        received = channel.read(left_ns * 1e-9)
        if received is None:
            # A start made by noise may hold the answer back; it shows here.
            frames = channel.receiver.expire()
        else:
            heard.start = (heard.start + received.chunk.data)[:KEPT_BYTES]
            frames = received.frames
        heard.frames += len(frames)
        for frame in frames:
            if frame.payload[0] == request.id:
                return frame.payload
    return None


def _no_version(name: str, heard: Heard) -> DriverError:
    seconds = VERSION_TRIES * TRY_S
    if not heard.start:
        return NoAnswerError(
            f"{name} stayed silent for {seconds:.1f} s; is it powered by the battery, is this its "
            'port (trackside devices), and over UART: is "App to use" set to UART in VESC Tool, '
            "at this baud?"
        )
    if heard.frames:
        return NoAnswerError(
            f"{name} sent {heard.frames} good frames and no FW_VERSION reply for {seconds:.1f} s; "
            "restart it, and stop other programs that use it"
        )
    if LIDAR_ANSWER in heard.start:
        return ProtocolError(
            f"{name}: an RPLidar answers there (A5 5A); give the VESC's port (trackside devices)"
        )
    return ProtocolError(
        f"{name}: what comes is no VESC's frame: {heard.start[:SHOWN_BYTES]!r}; is this its port "
        "(trackside devices), and over UART: is the baud that of VESC Tool?"
    )
