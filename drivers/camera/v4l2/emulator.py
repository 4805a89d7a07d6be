"""A V4L2 camera that is not there: what a driver and a USB camera do together, faults included.

Time passes on the clock that it is given: at once (`FreeClock`) or at real pace (`RealClock`).
"""

from __future__ import annotations

import errno
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.camera.clock import Clock, FreeClock
from drivers.camera.v4l2.source import (
    EXPOSURE_APERTURE_PRIORITY,
    EXPOSURE_MANUAL,
    Control,
    ControlRange,
    DeviceFacts,
    Grab,
    StampClock,
    StampEdge,
    VideoMode,
)

FACTS = DeviceFacts(
    node="/dev/video0",
    card="Emulated camera",
    driver="uvcvideo",
    bus="usb-emulated-1",
    captures=True,
    serial="8C2D5B7F",
    usb_id="046d:082d",
    usb_mbit_s=480.0,
)
MODES = (
    VideoMode("MJPG", 1920, 1080, (15.0, 30.0)),
    VideoMode("MJPG", 1280, 720, (15.0, 30.0, 60.0)),
    VideoMode("MJPG", 640, 480, (15.0, 30.0)),
    VideoMode("YUYV", 640, 480, (15.0, 30.0)),
)
RANGES = {
    Control.AUTOGAIN: ControlRange(0, 1, 1),
    Control.GAIN: ControlRange(0, 255, 1),
    Control.POWER_LINE_FREQUENCY: ControlRange(0, 2, 1),
    Control.EXPOSURE_AUTO: ControlRange(0, 3, 1),
    Control.EXPOSURE_ABSOLUTE: ControlRange(3, 2047, 1),
    Control.EXPOSURE_AUTO_PRIORITY: ControlRange(0, 1, 1),
    Control.FOCUS_ABSOLUTE: ControlRange(0, 250, 5),
    Control.FOCUS_AUTO: ControlRange(0, 1, 1),
}
AUTO_EXPOSURE_NS = 10_000_000
TRANSFER_NS = 8_000_000


@dataclass
class CameraEmulator:
    """The camera: `open` is what a driver is given to open it with.

    scene : the bytes of the frame whose exposure's middle is at that monotonic time.
    exposure_modes : the values of `EXPOSURE_AUTO` that it knows; those of UVC cameras are the
    default.
    Faults, each a field that may change at any time: open_errno, mode_errno, start_errno (a number
    of `errno`); mode_in_force, rate_in_force_hz (what is read back), true_rate_hz (what really
    comes, whatever is told); stuck (controls that keep a value); unreadable (controls that fail
    when read); late_s (until the first frame); lost (sequence numbers that never come); damaged
    (those with the driver's error flag); cut (those whose last half is missing); frozen (nothing
    comes); unplugged.
    Stamps: stamp_offset_ns is added to our clock for the camera's; claims and edge are what the
    flags say; stampless drivers leave the stamp at zero.
    """

    scene: Callable[[int], bytes]
    clock: Clock = field(default_factory=FreeClock)
    facts: DeviceFacts = FACTS
    modes: tuple[VideoMode, ...] = MODES
    ranges: dict[Control, ControlRange] = field(default_factory=lambda: dict(RANGES))
    exposure_modes: tuple[int, ...] = (EXPOSURE_MANUAL, EXPOSURE_APERTURE_PRIORITY)
    open_errno: int | None = None
    mode_errno: int | None = None
    start_errno: int | None = None
    mode_in_force: tuple[str, int, int] | None = None
    rate_in_force_hz: float | None = None
    true_rate_hz: float | None = None
    stuck: dict[Control, int] = field(default_factory=dict)
    unreadable: set[Control] = field(default_factory=set)
    late_s: float = 0.0
    lost: set[int] = field(default_factory=set)
    damaged: set[int] = field(default_factory=set)
    cut: set[int] = field(default_factory=set)
    frozen: bool = False
    unplugged: bool = False
    stamp_offset_ns: int = 0
    claims: StampClock = StampClock.MONOTONIC
    edge: StampEdge = StampEdge.EXPOSURE_START
    stampless: bool = False
    opened: int = 0
    closed: int = 0

    def open(self, path: str) -> EmulatedSource:  # noqa: ARG002  the signature of a driver's opener
        """Plug in by path; raises `OSError` as the system would."""
        if self.unplugged:
            raise OSError(errno.ENOENT, "No such file or directory")
        if self.open_errno is not None:
            raise OSError(self.open_errno, "refused by the emulator")
        self.opened += 1
        return EmulatedSource(self)


class EmulatedSource:
    """An opened `CameraEmulator`; a `VideoSource`."""

    def __init__(self, camera: CameraEmulator) -> None:
        self._camera = camera
        self._controls = {control: limits.minimum for control, limits in camera.ranges.items()}
        self._rate_hz = 30.0
        self._buffers = 0
        self._start_ns: int | None = None
        self._next = 0
        self._filled: deque[tuple[int, int]] = deque()
        self._closed = False

    def now_ns(self) -> int:
        """The emulator's clock."""
        return self._camera.clock.now_ns()

    def facts(self) -> DeviceFacts:
        """As given."""
        self._check()
        return self._camera.facts

    def modes(self) -> tuple[VideoMode, ...]:
        """As given."""
        self._check()
        return self._camera.modes

    def set_mode(self, fourcc: str, width_px: int, height_px: int) -> tuple[str, int, int]:
        """The asked mode if it is offered, else the first of that format, as drivers do."""
        self._check()
        if self._camera.mode_errno is not None:
            raise OSError(self._camera.mode_errno, "refused by the emulator")
        asked = (fourcc, width_px, height_px)
        offered = [(mode.fourcc, mode.width_px, mode.height_px) for mode in self._camera.modes]
        if self._camera.mode_in_force is not None:
            return self._camera.mode_in_force
        return asked if asked in offered else next(one for one in offered if one[0] == fourcc)

    def set_rate(self, rate_hz: float) -> float | None:
        """The asked rate, or the one that the emulator insists on."""
        self._check()
        self._rate_hz = self._camera.rate_in_force_hz or rate_hz
        return self._rate_hz

    def control_range(self, control: Control) -> ControlRange | None:
        """As given."""
        self._check()
        return self._camera.ranges.get(control)

    def set_control(self, control: Control, value: int) -> None:
        """Keep a value."""
        self._check()
        if control is Control.EXPOSURE_AUTO and value not in self._camera.exposure_modes:
            raise OSError(errno.EINVAL, "Invalid argument")
        self._controls[control] = value

    def get_control(self, control: Control) -> int:
        """The value kept, or the one that is stuck."""
        self._check()
        if control in self._camera.unreadable:
            raise OSError(errno.EIO, "Input/output error")
        return self._camera.stuck.get(control, self._controls[control])

    def start(self, buffers: int) -> None:
        """Begin; the first exposure starts now."""
        self._check()
        if self._camera.start_errno is not None:
            raise OSError(self._camera.start_errno, "refused by the emulator")
        self._buffers = buffers
        self._start_ns = self.now_ns() + round(self._camera.late_s * 1e9)

    def read(self, timeout_s: float) -> Grab | None:
        """The next frame that found a free buffer, when it has come."""
        clock = self._camera.clock
        end_ns = clock.now_ns() + round(max(timeout_s, 0.0) * 1e9)
        while True:
            self._check()
            self._fill(clock.now_ns())
            if self._filled:
                return self._grab(*self._filled.popleft())
            wait_ns = min(self._arrival_ns(self._next), end_ns) - clock.now_ns()
            if self._camera.frozen:
                wait_ns = end_ns - clock.now_ns()
            if clock.now_ns() >= end_ns:
                return None
            # Rounded up: a pause that ends a nanosecond early would never end the loop.
            clock.pause(math.ceil(wait_ns / 1000) * 1e-6)

    def close(self) -> None:
        """Count it."""
        if not self._closed:
            self._camera.closed += 1
        self._closed = True

    def _check(self) -> None:
        if self._camera.unplugged:
            raise OSError(errno.ENODEV, "No such device")
        if self._closed:
            raise OSError(errno.EBADF, "Bad file descriptor")

    def _fill(self, now_ns: int) -> None:
        """Give frames that have come their buffers; those that find none free are lost."""
        while self._arrival_ns(self._next) <= now_ns:
            sequence, self._next = self._next, self._next + 1
            free = len(self._filled) < self._buffers
            if free and sequence not in self._camera.lost and not self._camera.frozen:
                self._filled.append((sequence, self._arrival_ns(sequence)))

    def _exposure_ns(self) -> int:
        manual = self._controls.get(Control.EXPOSURE_AUTO) == EXPOSURE_MANUAL
        return self._controls[Control.EXPOSURE_ABSOLUTE] * 100_000 if manual else AUTO_EXPOSURE_NS

    def _exposed_ns(self, sequence: int) -> int:
        """When the exposure of a frame starts."""
        if self._start_ns is None:
            raise OSError(errno.EINVAL, "Invalid argument")
        rate_hz = self._camera.true_rate_hz or self._rate_hz
        return self._start_ns + round(sequence / rate_hz * 1e9)

    def _arrival_ns(self, sequence: int) -> int:
        return self._exposed_ns(sequence) + self._exposure_ns() + TRANSFER_NS

    def _grab(self, sequence: int, arrival_ns: int) -> Grab:
        camera, exposed_ns = self._camera, self._exposed_ns(sequence)
        data = camera.scene(exposed_ns + self._exposure_ns() // 2)
        if sequence in camera.cut:
            data = data[: len(data) // 2]
        moment_ns = exposed_ns if camera.edge is StampEdge.EXPOSURE_START else arrival_ns
        return Grab(
            data=data,
            sequence=sequence,
            stamp_ns=0 if camera.stampless else moment_ns + camera.stamp_offset_ns,
            clock=camera.claims,
            edge=camera.edge,
            damaged=sequence in camera.damaged,
            arrival_ns=self.now_ns(),
        )
