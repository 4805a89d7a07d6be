"""A VESC as its line shows it, of any firmware from 2.10 on, with the faults that real ones have.

It shares with the driver the frames and the order of the fields, which the byte vectors pin down;
its packet ids are a table of its own, so that a mistake in the driver's shows here.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from drivers.emulation import Line
from drivers.port import Chunk
from drivers.vesc.commands import Kind
from drivers.vesc.emulated_motor import DrivenMotor, Motor, RecordedReplies
from drivers.vesc.emulated_replies import (
    encode_imu,
    encode_selected,
    encode_setup,
    encode_values,
    encode_version,
)
from drivers.vesc.firmware import Firmware
from drivers.vesc.framing import FrameReceiver, encode_frame
from drivers.vesc.setup_values import VescImu
from drivers.vesc.values import decode_values

FIRMWARES = ("2.18", "3.40", "5.02", "5.03", "6.02")
UUID = "0102030405060708090a0b0c"
REBOOT_NS = 1_000_000_000
PIECE_GAP_NS = 500_000
PRINT = b"noise\n"

_SAME: dict[int, tuple[Kind, float]] = {
    5: ("duty", 1e5),
    6: ("current", 1e3),
    7: ("brake", 1e3),
    8: ("rpm", 1.0),
}
_OLD: dict[int, tuple[Kind, float]] = {**_SAME, 11: ("servo", 1e3), 29: ("alive", 1.0)}
_NEW: dict[int, tuple[Kind, float]] = {
    **_SAME,
    10: ("handbrake", 1e3),
    12: ("servo", 1e3),
    30: ("alive", 1.0),
}
_FLASHING = {1: "JUMP_TO_BOOTLOADER", 2: "ERASE_NEW_APP", 3: "WRITE_NEW_APP_DATA"}
_OLD_DANGERS = {
    **_FLASHING,
    10: "SET_DETECT",
    12: "SET_MCCONF",
    15: "SET_APPCONF",
    28: "REBOOT",
}
_NEW_DANGERS = {
    **_FLASHING,
    11: "SET_DETECT",
    13: "SET_MCCONF",
    16: "SET_APPCONF",
    29: "REBOOT",
}


@dataclass(frozen=True)
class Danger:
    """A packet that would have done harm: it stores, detects, reboots or erases."""

    t_ns: int
    packet_id: int
    name: str


@dataclass(frozen=True)
class Obeyed:
    """A command that was understood."""

    t_ns: int
    kind: Kind
    value: float


@dataclass
class VescFaults:
    """What goes wrong; change it at any time.

    silent : no replies; reply_delay_ns : from question to answer; fault_code : reported in every
    state; prints : text before and after each reply, in one piece with it; piece_bytes : replies
    come in pieces of so many, 0.5 ms apart (0: whole); lose_every, flip_every : of so many replies
    one is lost, or has one bit wrong (0: none); noise : bytes before each reply.
    """

    silent: bool = False
    reply_delay_ns: int = 500_000
    fault_code: int = 0
    prints: bool = False
    piece_bytes: int = 0
    lose_every: int = 0
    flip_every: int = 0
    noise: bytes = b""


class VescModel:
    """A VESC as a `drivers.emulation.DeviceModel`.

    firmware : one whose ids are known; motor : what it turns; recorded : answers instead of the
    motor's state; baud : the UART's, None for USB; timeout_ms : of the watchdog, 0 for never.
    `obeyed`, `dangers` and `unknown` (packet ids) keep what was received; `timeouts` counts how
    often the watchdog let the motor go.
    """

    def __init__(
        self,
        firmware: Firmware,
        motor: Motor | None = None,
        *,
        recorded: RecordedReplies | None = None,
        baud: int | None = None,
        timeout_ms: int = 1000,
    ) -> None:
        firmware.command_ids()  # refuses what nobody knows
        self.firmware = firmware
        self.faults = VescFaults()
        self.motor: Motor = DrivenMotor() if motor is None else motor
        self.imu = VescImu(*(0.0,) * 5, 9.80665, *(0.0,) * 6, 1.0, 0.0, 0.0, 0.0, 0)
        self.servo = 0.5
        self.timed_out = False
        self.timeouts = 0
        self.obeyed: list[Obeyed] = []
        self.dangers: list[Danger] = []
        self.unknown: list[int] = []
        self._recorded, self._baud, self._timeout_ns = recorded, baud, timeout_ms * 1_000_000
        self._commands, self._harmful = (
            (_OLD, _OLD_DANGERS) if firmware.is_old else (_NEW, _NEW_DANGERS)
        )
        self._receiver, self._line = FrameReceiver(), Line(baud)
        self._fed_ns: int | None = None
        self._heard_ns = self._awake_ns = self._replies = 0
        self._random = random.Random(0)

    def receive(self, data: bytes, now_ns: int) -> None:
        """Take bytes that the host sent; each takes its time on the wire."""
        wire_ns = 0 if self._baud is None else len(data) * 10_000_000_000 // self._baud
        self._heard_ns = max(self._heard_ns, now_ns) + wire_ns
        for frame in self._receiver.feed(data):
            if self._heard_ns >= self._awake_ns:
                self._serve(frame.payload, self._heard_ns)

    def transmit(self, now_ns: int) -> bytes:
        """Every byte whose time has come."""
        self._watchdog(now_ns)
        return self._line.due(now_ns)

    def next_ns(self) -> int | None:
        """When there will next be something to transmit."""
        return self._line.next_ns()

    def reboot(self, now_ns: int) -> None:
        """Fall silent for a second and begin anew, as after a short loss of power."""
        self._line.clear()
        self._awake_ns, self._fed_ns, self.timed_out = now_ns + REBOOT_NS, None, False
        self.motor.restart(now_ns)
        self.servo = 0.5

    def _serve(self, payload: bytes, t_ns: int) -> None:
        self._watchdog(t_ns)
        number, data = payload[0], payload[1:]
        if number in self._commands:
            self._obey(*self._commands[number], data, t_ns)
        elif number in self._harmful:
            self.dangers.append(Danger(t_ns, number, self._harmful[number]))
            if self._harmful[number] == "REBOOT":
                self.reboot(t_ns)
        else:
            reply = self._reply(number, data, t_ns)
            if reply is None:
                self.unknown.append(number)
            elif reply:
                self._send(reply, t_ns + self.faults.reply_delay_ns)

    def _obey(self, kind: Kind, scale: float, data: bytes, t_ns: int) -> None:
        code = {"servo": ">h", "alive": ""}.get(kind, ">i")
        if len(data) < struct.calcsize(code):
            return
        numbers: tuple[int, ...] = struct.unpack_from(code, data)
        value = numbers[0] / scale if numbers else 0.0
        self.obeyed.append(Obeyed(t_ns, kind, value))
        if kind == "servo":
            self.servo = value  # and does not feed the watchdog
            return
        self._fed_ns, self.timed_out = t_ns, False
        self.motor.command(kind, value, t_ns)

    def _watchdog(self, t_ns: int) -> None:
        """Let the motor go at the very moment when it was not fed for too long."""
        if self._fed_ns is None or not self._timeout_ns:
            return
        end_ns = self._fed_ns + self._timeout_ns
        if t_ns >= end_ns:
            self._fed_ns, self.timed_out = None, True
            self.timeouts += 1
            self.motor.command("current", 0.0, end_ns)

    def _reply(self, number: int, data: bytes, t_ns: int) -> bytes | None:
        """The payload of an answer; None for a question this firmware does not know."""
        version = self.firmware.version
        if number == 0:
            return encode_version(self.firmware)
        if self._recorded is not None and number in (4, 50):
            recorded = self._recorded.payload(t_ns) or b""
            return recorded if recorded[:1] == bytes((number,)) else b""
        values = replace(self.motor.values(t_ns), status=int(self.timed_out))
        if self.faults.fault_code:
            values = replace(values, fault=self.faults.fault_code)
        if number == 4:
            return encode_values(values, self.firmware)
        mask = int.from_bytes(data, "big")
        if number in (47, 50, 51) and version >= (3, 48):
            if number == 50:
                return encode_selected(values, mask)
            return encode_setup(values, None if number == 47 else mask)
        if number == 65 and version >= (3, 52):
            return encode_imu(self.imu, mask)
        return None

    def _send(self, payload: bytes, at_ns: int) -> None:
        faults = self.faults
        self._replies += 1
        if faults.silent or (faults.lose_every and self._replies % faults.lose_every == 0):
            return
        frame = bytearray(encode_frame(payload))
        if faults.flip_every and self._replies % faults.flip_every == 0:
            frame[self._random.randrange(len(frame))] ^= 1 << self._random.randrange(8)
        print_id = 20 if self.firmware.is_old else 21
        text = encode_frame(bytes((print_id,)) + PRINT) if faults.prints else b""
        data = faults.noise + text + bytes(frame) + text
        size = faults.piece_bytes or len(data)
        for count, start in enumerate(range(0, len(data), size)):
            self._line.send(data[start : start + size], at_ns + count * PIECE_GAP_NS)


def emulated_vesc(
    firmware: str = "5.02", replay: Sequence[Chunk] | None = None, *, baud: int | None = None
) -> VescModel:
    """A VESC of a firmware such as `5.02`, with a motor that obeys or with recorded replies.

    replay : the raw bytes of a recorded VESC (`/raw/vesc`) with their times; at their end it falls
    silent. Raises `ValueError` for words that are no version, `DeviceFaultError` for a version that
    is not known, `ProtocolError` for replies that such a firmware does not send.
    """
    major, dot, minor = firmware.partition(".")
    if not (dot and major.isdecimal() and minor.isdecimal()):
        raise ValueError(f"firmware {firmware!r} is no version; expected one such as 5.02")
    there = Firmware(int(major), int(minor), "410", UUID, paired=False, beta=0)
    recorded = None if replay is None else RecordedReplies(replay)
    if recorded is not None:
        decode_values(recorded.first, there)
    return VescModel(there, recorded=recorded, baud=baud)
