"""The words of an RPLidar: requests, answer descriptors, single answers, the banner after a reset.

Bytes to frozen values and back, without a port. Everything is little endian. Sources: Slamtec's
interface protocol manuals (A1/A2 rev 1.1, A2/A3 v2.x) and SDK 2.1.0; reference/protocols.md A.2 to
A.5.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from operator import xor

from drivers.errors import ProtocolError

SYNC = 0xA5
DESCRIPTOR_SYNC = b"\xa5\x5a"
DESCRIPTOR_BYTES = 7
PWM_MAX = 1023
CONF_FIRMWARE = (1, 24)
"""The first firmware that answers GET_LIDAR_CONF; older ones stay silent."""
SAMPLERATE_FIRMWARE = (1, 17)
OLD_STANDARD_US = 476
"""Microseconds a sample takes where the firmware cannot be asked."""


class Command(IntEnum):
    """What the host may ask; with bit 7 set a payload and a checksum follow."""

    SCAN = 0x20
    FORCE_SCAN = 0x21
    STOP = 0x25
    RESET = 0x40
    GET_INFO = 0x50
    GET_HEALTH = 0x52
    GET_SAMPLERATE = 0x59
    EXPRESS_SCAN = 0x82
    GET_LIDAR_CONF = 0x84
    HQ_MOTOR_SPEED = 0xA8
    SET_MOTOR_PWM = 0xF0
    GET_ACC_BOARD_FLAG = 0xFF


class Answer(IntEnum):
    """Types of answers, as their descriptors name them."""

    INFO = 0x04
    HEALTH = 0x06
    SAMPLERATE = 0x15
    LIDAR_CONF = 0x20
    STANDARD = 0x81
    LEGACY = 0x82
    ULTRA = 0x84
    DENSE = 0x85
    ACC_BOARD_FLAG = 0xFF


ANSWER_BYTES = {
    Answer.INFO: 20,
    Answer.HEALTH: 3,
    Answer.SAMPLERATE: 4,
    Answer.STANDARD: 5,
    Answer.LEGACY: 84,
    Answer.ULTRA: 132,
    Answer.DENSE: 84,
    Answer.ACC_BOARD_FLAG: 4,
}
"""Bytes of one packet of each type; LIDAR_CONF alone has no length of its own."""
SCAN_ANSWERS = (Answer.STANDARD, Answer.LEGACY, Answer.ULTRA, Answer.DENSE)


class Conf(IntEnum):
    """What GET_LIDAR_CONF can be asked; those after MODE_COUNT but TYPICAL_MODE want a mode."""

    MODE_COUNT = 0x70
    US_PER_SAMPLE = 0x71
    MAX_DISTANCE = 0x74
    ANSWER_TYPE = 0x75
    TYPICAL_MODE = 0x7C
    MODE_NAME = 0x7F


@dataclass(frozen=True)
class Descriptor:
    """What announces an answer: its type, the bytes of one packet, and whether many follow."""

    kind: int
    length: int
    many: bool

    def encode(self) -> bytes:
        """The seven bytes."""
        word = self.length | (0x4000_0000 if self.many else 0)
        return DESCRIPTOR_SYNC + struct.pack("<IB", word, self.kind)


@dataclass(frozen=True)
class Info:
    """GET_INFO: model = series << 4 | number (A2M8: 0x28); serial as Slamtec prints it."""

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial: str

    @property
    def series(self) -> int:
        """1 for the A1, 2 for the A2, 3 for the A3, 6 and more for S, T and C."""
        return self.model >> 4

    @property
    def model_name(self) -> str:
        """`A2M8` for 0x28; the series that are not of the A family by their number alone."""
        if 1 <= self.series <= 3:
            return f"A{self.series}M{self.model & 0x0F}"
        return f"model 0x{self.model:02X}"

    def encode(self) -> bytes:
        """The 20 bytes."""
        major, minor = self.firmware
        return bytes((self.model, minor, major, self.hardware)) + bytes.fromhex(self.serial)


@dataclass(frozen=True)
class Health:
    """GET_HEALTH: 0 good, 1 warning, 2 protection stop; the meaning of codes is not published."""

    status: int
    code: int

    @property
    def protection_stop(self) -> bool:
        """Whether the device refuses to scan."""
        return self.status >= 2

    def __str__(self) -> str:
        name = ("good", "warning", "protection stop")[min(self.status, 2)]
        return name if self.status == 0 else f"{name} (code 0x{self.code:04X})"

    def encode(self) -> bytes:
        """The 3 bytes."""
        return struct.pack("<BH", self.status, self.code)


@dataclass(frozen=True)
class ScanMode:
    """A way to scan: its number on the wire, name, answer type, and period in 1/256 us a sample."""

    number: int
    name: str
    answer: int
    us_q8: int
    max_distance_m: float

    @property
    def us_per_sample(self) -> float:
        """Microseconds from one sample to the next."""
        return self.us_q8 / 256.0


def checksum(data: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, data, 0)


def request(command: Command, payload: bytes = b"") -> bytes:
    """The bytes that ask for something."""
    if not command & 0x80:
        return bytes((SYNC, command))
    body = bytes((SYNC, command, len(payload))) + payload
    return body + bytes((checksum(body),))


def scan_request(mode: ScanMode) -> bytes:
    """SCAN for the standard nodes, EXPRESS_SCAN with the mode's number for capsules."""
    if mode.answer == Answer.STANDARD:
        return request(Command.SCAN)
    return request(Command.EXPRESS_SCAN, struct.pack("<BHH", mode.number, 0, 0))


def pwm_request(pwm: int) -> bytes:
    """SET_MOTOR_PWM, 0 (stop) to 1023."""
    if not 0 <= pwm <= PWM_MAX:
        raise ValueError(f"motor PWM {pwm} is not within 0 .. {PWM_MAX}")
    return request(Command.SET_MOTOR_PWM, struct.pack("<H", pwm))


def rpm_request(rpm: int) -> bytes:
    """HQ_MOTOR_SPEED of the S, T and C series; 0 stops."""
    return request(Command.HQ_MOTOR_SPEED, struct.pack("<H", rpm))


def acc_board_request() -> bytes:
    """GET_ACC_BOARD_FLAG: whether an accessory board drives the motor."""
    return request(Command.GET_ACC_BOARD_FLAG, bytes(4))


def conf_request(conf: Conf, mode: int | None = None) -> bytes:
    """GET_LIDAR_CONF, of a mode where the question wants one."""
    argument = b"" if mode is None else struct.pack("<H", mode)
    return request(Command.GET_LIDAR_CONF, struct.pack("<I", conf) + argument)


def find_descriptor(data: bytes, kinds: tuple[int, ...]) -> tuple[int, Descriptor] | None:
    """The first descriptor of one of these types with its right length, and where it begins.

    Bytes of a scan that still runs may come before it, and may look like its first two bytes.
    """
    at = data.find(DESCRIPTOR_SYNC)
    while 0 <= at <= len(data) - DESCRIPTOR_BYTES:
        word, kind = struct.unpack_from("<IB", data, at + 2)
        found = Descriptor(kind, word & 0x3FFF_FFFF, many=word >> 30 == 1)
        if kind in kinds and _is_sound(found, word >> 30):
            return at, found
        at = data.find(DESCRIPTOR_SYNC, at + 1)
    return None


def _is_sound(found: Descriptor, send_mode: int) -> bool:
    """Whether length and send mode are those of the type."""
    if found.kind == Answer.LIDAR_CONF:
        return send_mode == 0 and 4 <= found.length <= 255
    many = int(found.kind in SCAN_ANSWERS)
    return send_mode == many and found.length == ANSWER_BYTES.get(Answer(found.kind))


def decode_info(data: bytes) -> Info:
    """GET_INFO's 20 bytes."""
    model, minor, major, hardware = data[:4]
    return Info(model, (major, minor), hardware, data[4:20].hex().upper())


def decode_health(data: bytes) -> Health:
    """GET_HEALTH's 3 bytes; the code is little endian (manual and SDK)."""
    return Health(*struct.unpack("<BH", data))


def decode_samplerate(data: bytes) -> tuple[int, int]:
    """Microseconds a sample takes in standard and in express mode."""
    standard_us, express_us = struct.unpack("<HH", data)
    return standard_us, express_us


def decode_conf(data: bytes, conf: Conf) -> bytes:
    """The value in an answer to GET_LIDAR_CONF; raises `ProtocolError` if it answers another."""
    if len(data) < 4 or struct.unpack_from("<I", data)[0] != conf:
        raise ProtocolError(
            f"an answer to GET_LIDAR_CONF 0x{conf:02X} repeats another question: {data.hex(' ')}"
        )
    return data[4:]


def decode_number(value: bytes) -> int:
    """A configuration value that is a number, whatever its width."""
    return int.from_bytes(value, "little")


def decode_acc_board(data: bytes) -> bool:
    """Whether the accessory board can drive the motor by PWM."""
    return bool(data[0] & 1)


def banner_of(info: Info) -> bytes:
    """What the device prints after a reset, by a firmware 1.27 (wording varies)."""
    major, minor = info.firmware
    return (
        f"RP LIDAR System.\r\nFirmware Ver {major}.{minor} - rc9, HW Ver {info.hardware}\r\n"
        f"Model: {info.model:02X}\r\n"
    ).encode()


def is_banner(data: bytes) -> bool:
    """Whether these bytes hold the banner of a device that has just restarted."""
    return re.search(rb"RP ?LIDAR", data) is not None
