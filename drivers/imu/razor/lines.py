"""The text that a Razor sends, cut into lines, and what one line is. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.device import Counters

MOST_LINE_BYTES = 256

_ROW = re.compile(rb"-?\d+(?:\.\d+)?(?:, -?\d+(?:\.\d+)?)*")
_FRAME = re.compile(rb"#([A-Z]+(?:-[CR])?)=(-?\d+(?:\.\d+)?(?:,-?\d+(?:\.\d+)?)*)")
_REPLIES = {
    "rate_hz": re.compile(rb"IMU rate set to (\d+) Hz"),
    "accel_range_g": re.compile(rb"Accel FSR set to \+/-(\d+) g"),
    "gyro_range_deg_s": re.compile(rb"Gyro FSR set to \+/-(\d+) dps"),
}
NO_SENSOR = b"Error connecting to MPU-9250"


@dataclass(frozen=True)
class Line:
    """A line without its end, and how many bytes of the same chunk came after it."""

    text: bytes
    following: int


@dataclass(frozen=True)
class Row:
    """A line of numbers of the default firmware, and how many decimals each has."""

    values: tuple[float, ...]
    decimals: tuple[int, ...]


@dataclass(frozen=True)
class Frame:
    """A line of the AHRS firmware: `#YPR=1.0,2.0,3.0` has the tag YPR and three values."""

    tag: str
    values: tuple[float, ...]


class LineReader:
    """Bytes cut anywhere in, whole lines out.

    The first line is dropped where it may have begun before we listened. What is longer than any
    line of a Razor is skipped and counted.
    """

    def __init__(self, counters: Counters, *, cut_at_first: bool = True) -> None:
        self._counters = counters
        self._held = bytearray()
        self._skipping = cut_at_first
        self._counting = False  # what is cut off at the beginning is no fault

    def feed(self, data: bytes) -> Iterator[Line]:
        """The lines that these bytes complete."""
        start = 0
        while (end := data.find(b"\n", start)) >= 0:
            self._held += data[start:end]
            start = end + 1
            if self._skipping:
                self._skip(len(self._held) + 1)
                self._skipping, self._counting = False, True
            elif len(self._held) > MOST_LINE_BYTES:
                self._counting = True
                self._skip(len(self._held) + 1)
            else:
                yield Line(bytes(self._held).rstrip(b"\r"), len(data) - start)
            self._held.clear()
        self._held += data[start:]
        if len(self._held) > MOST_LINE_BYTES:
            self._counting |= not self._skipping
            self._skipping = True
            self._skip(len(self._held))
            self._held.clear()

    def _skip(self, count: int) -> None:
        if self._counting:
            self._counters.bad_bytes += count


def row_of(text: bytes) -> Row | None:
    """The numbers of a line `1, 2.00, -3.00`; no numbers for an empty line; None for other text."""
    if not text:
        return Row((), ())
    if not _ROW.fullmatch(text):
        return None
    words = text.split(b", ")
    decimals = tuple(len(word) - word.index(b".") - 1 if b"." in word else 0 for word in words)
    return Row(tuple(float(word) for word in words), decimals)


def frame_of(text: bytes) -> Frame | None:
    """The tag and numbers of a line `#TAG=1.0,2.0`; None for other text."""
    found = _FRAME.fullmatch(text)
    if found is None:
        return None
    return Frame(found[1].decode(), tuple(float(word) for word in found[2].split(b",")))


def reply_of(text: bytes) -> tuple[str, int] | None:
    """What the default firmware says after r, A or G: (`rate_hz`, 100) and the like."""
    for name, pattern in _REPLIES.items():
        found = pattern.fullmatch(text)
        if found is not None:
            return name, int(found[1])
    return None
