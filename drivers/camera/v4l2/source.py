"""A V4L2 device as its driver sees it: what linuxpy offers on Linux, or the emulator in tests.

Names and numbers are those of the kernel's `linux/videodev2.h` and `linux/v4l2-controls.h`.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Protocol


class Control(enum.IntEnum):
    """The controls that matter here; the values are the kernel's."""

    AUTOGAIN = 0x00980912
    GAIN = 0x00980913
    POWER_LINE_FREQUENCY = 0x00980918
    EXPOSURE_AUTO = 0x009A0901
    EXPOSURE_ABSOLUTE = 0x009A0902
    EXPOSURE_AUTO_PRIORITY = 0x009A0903
    FOCUS_ABSOLUTE = 0x009A090A
    FOCUS_AUTO = 0x009A090C


EXPOSURE_AUTOMATIC, EXPOSURE_MANUAL, EXPOSURE_APERTURE_PRIORITY = 0, 1, 3
EXPOSURE_UNIT_NS = 100_000
"""Of `EXPOSURE_ABSOLUTE`."""


class StampClock(enum.Enum):
    """What a buffer's stamp was read from, by its flags."""

    MONOTONIC = "monotonic"
    OTHER = "another clock"


class StampEdge(enum.Enum):
    """Which moment of a frame its stamp means, by its flags."""

    EXPOSURE_START = "start of exposure"
    FRAME_END = "end of frame"


@dataclass(frozen=True)
class DeviceFacts:
    """Who a V4L2 device is.

    node : /dev/videoN behind the path; serial, usb_id (`2b03:f582`) and usb_mbit_s from sysfs, None
    where that does not say; captures : whether it gives video at all (a camera's second node
    gives metadata only).
    """

    node: str
    card: str
    driver: str
    bus: str
    captures: bool
    serial: str | None = None
    usb_id: str | None = None
    usb_mbit_s: float | None = None


@dataclass(frozen=True)
class VideoMode:
    """A format by its four-character code, a size, and the rates at which it is offered.

    A size or rates that can be set freely are told as the largest, with `free` true.
    """

    fourcc: str
    width_px: int
    height_px: int
    rates_hz: tuple[float, ...] = ()
    free: bool = False


@dataclass(frozen=True)
class ControlRange:
    """What a control may be set to."""

    minimum: int
    maximum: int
    step: int


@dataclass(frozen=True)
class Grab:
    """One buffer: its bytes, the driver's count and stamp, and when it was here.

    stamp_ns : 0 where the driver gives none; damaged : the driver's own flag for lost data.
    """

    data: bytes
    sequence: int
    stamp_ns: int
    clock: StampClock
    edge: StampEdge
    damaged: bool
    arrival_ns: int


class VideoSource(Protocol):
    """An opened V4L2 device. Every member may raise `OSError` with the system's number."""

    def now_ns(self) -> int:
        """The monotonic clock of the arrival stamps."""

    def facts(self) -> DeviceFacts:
        """Who it is."""

    def modes(self) -> tuple[VideoMode, ...]:
        """What it offers, in its own order."""

    def set_mode(self, fourcc: str, width_px: int, height_px: int) -> tuple[str, int, int]:
        """Ask for a format; format and size in force thereafter, which may be others."""

    def set_rate(self, rate_hz: float) -> float | None:
        """Ask for a frame rate; the one in force thereafter, None where it is not told."""

    def control_range(self, control: Control) -> ControlRange | None:
        """What a control may be set to; None if the device has no such control."""

    def set_control(self, control: Control, value: int) -> None:
        """Ask for a value."""

    def get_control(self, control: Control) -> int:
        """The value in force."""

    def start(self, buffers: int) -> None:
        """Begin to stream into so many buffers."""

    def read(self, timeout_s: float) -> Grab | None:
        """The next frame; None if none came in time, or the source was closed meanwhile."""

    def close(self) -> None:
        """Stop and give the device back; any thread, twice, raises nothing."""
