"""VESC frames: `start | length | payload | CRC | 03`, the same on USB and on UART.

Start 02 has one byte of length, 03 two (big endian). The CRC is CRC-16/XMODEM over the payload
alone. There is nothing between frames, and nothing in them is escaped: only a good CRC tells a
frame from bytes that look like one. (vedderb/bldc `packet.c`; reference B.2)
"""

from __future__ import annotations

import re
from binascii import crc_hqx
from typing import NamedTuple

SHORT, LONG, STOP = 0x02, 0x03, 0x03
MAX_PAYLOAD_BYTES = 1024
"""Of firmware up to 3.40; later ones stop at 512."""
LONG_FROM_BYTES = 256
"""The length from which start 03 is used; firmware from 3.48 refuses shorter ones but for 255."""
LEAST_LONG_BYTES = 255

_START = re.compile(b"[\x02\x03]")


class Frame(NamedTuple):
    """A payload whose CRC was right; `following` counts the bytes of the same chunk after it."""

    payload: bytes
    following: int


def encode_frame(payload: bytes) -> bytes:
    """The bytes on the line. Raises `ValueError` for lengths that no VESC takes."""
    size = len(payload)
    if not 1 <= size <= MAX_PAYLOAD_BYTES:
        raise ValueError(f"a VESC frame holds 1 to {MAX_PAYLOAD_BYTES} bytes, not {size}")
    short = size < LONG_FROM_BYTES
    start = bytes((SHORT, size)) if short else bytes((LONG,)) + size.to_bytes(2, "big")
    return start + payload + crc_hqx(payload, 0).to_bytes(2, "big") + bytes((STOP,))


class FrameReceiver:
    """Finds the frames in bytes that come in pieces of any size.

    After a bad length, stop or CRC one byte is dropped and the search goes on, as in the firmware.
    bad_frames : starts that turned out to be none; bad_bytes : bytes that were part of no frame.
    """

    def __init__(self) -> None:
        self.bad_frames = 0
        self.bad_bytes = 0
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that these bytes complete."""
        self._buffer += data
        return self._scan()

    def expire(self) -> list[Frame]:
        """Take what is still incomplete for no frame; the frames that stood behind its start.

        For when nothing has come for long: a start that noise made may promise 1024 bytes, and
        every good frame would wait behind it.
        """
        frames: list[Frame] = []
        while self._buffer:
            self.bad_frames += 1
            self._drop(1)
            frames += self._scan()
        return frames

    def _scan(self) -> list[Frame]:
        frames, buffer = [], self._buffer
        while buffer:
            found = _START.search(buffer)
            self._drop(found.start() if found else len(buffer))
            size = _frame_size(buffer)
            if size is None or len(buffer) < size:
                break
            payload = _checked_payload(buffer, size)
            if payload is None:
                self.bad_frames += 1
                self._drop(1)
            else:
                frames.append(Frame(payload, len(buffer) - size))
                del buffer[:size]
        return frames

    def _drop(self, count: int) -> None:
        self.bad_bytes += count
        del self._buffer[:count]


def _frame_size(buffer: bytearray) -> int | None:
    """Of the frame that starts the buffer, 1 where its length is none; None: not yet known."""
    if len(buffer) < 2 or (buffer[0] == LONG and len(buffer) < 3):
        return None
    if buffer[0] == SHORT:
        return buffer[1] + 5 if buffer[1] else 1
    length = buffer[1] << 8 | buffer[2]
    return length + 6 if LEAST_LONG_BYTES <= length <= MAX_PAYLOAD_BYTES else 1


def _checked_payload(buffer: bytearray, size: int) -> bytes | None:
    """The payload of the whole frame that starts the buffer; None if it is not one."""
    if size == 1 or buffer[size - 1] != STOP:
        return None
    payload = bytes(buffer[2 if buffer[0] == SHORT else 3 : size - 3])
    return payload if crc_hqx(payload, 0) == buffer[size - 3] << 8 | buffer[size - 2] else None
