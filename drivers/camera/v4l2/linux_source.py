"""A V4L2 device of this machine, through linuxpy (extra `v4l2`).

Only linuxpy's plain calls and structures are used: its control objects clip a value silently, its
readers wait without a deadline, and its streaming objects differ between versions.
"""

from __future__ import annotations

import contextlib
import errno
import mmap
import os
import select
import threading
import time
from pathlib import Path
from typing import Any

from drivers.camera.v4l2.source import (
    Control,
    ControlRange,
    DeviceFacts,
    Grab,
    StampClock,
    StampEdge,
    VideoMode,
)
from drivers.camera.v4l2.usb import usb_facts
from drivers.errors import DriverError


class LinuxSource:
    """An opened device node; raises `OSError`, and `DriverError` where linuxpy is not installed."""

    def __init__(self, path: str) -> None:
        try:
            from linuxpy.video import device as v4l2
        except ImportError as err:
            raise DriverError(
                f"{path}: reading a camera needs linuxpy, which is not installed here; "
                "pip install trackside[v4l2]"
            ) from err
        self._v4l2: Any = v4l2
        self._path = path
        self._type = v4l2.BufferType.VIDEO_CAPTURE
        self._device: Any = v4l2.Device(path)
        self._memory: list[mmap.mmap] = []
        # `close` may come from another thread while this one waits for a frame.
        self._guard, self._close_guard = threading.Lock(), threading.Lock()
        self._closing = False
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll = select.poll()
        self._poll.register(self._wake, select.POLLIN)
        try:
            self._device.open()
            self._poll.register(self._device.fileno(), select.POLLIN)
        except BaseException:
            self.close()
            raise

    def now_ns(self) -> int:
        """The machine's monotonic clock, which is also that of good stamps."""
        return time.monotonic_ns()

    def facts(self) -> DeviceFacts:
        """By QUERYCAP and sysfs."""
        capability = self._v4l2.read_capabilities(self._device)
        kind = self._v4l2.Capability
        # A node's own abilities, where the driver tells them apart from the whole device's.
        told_apart = capability.capabilities & kind.DEVICE_CAPS
        caps = capability.device_caps if told_apart else capability.capabilities
        node = Path(self._path).resolve()
        usb = usb_facts(node.name)
        return DeviceFacts(
            node=str(node),
            card=_text(capability.card),
            driver=_text(capability.driver),
            bus=_text(capability.bus_info),
            captures=bool(caps & kind.VIDEO_CAPTURE) and bool(caps & kind.STREAMING),
            serial=usb.serial,
            usb_id=usb.usb_id,
            usb_mbit_s=usb.mbit_s,
        )

    def modes(self) -> tuple[VideoMode, ...]:
        """By ENUM_FMT, ENUM_FRAMESIZES and ENUM_FRAMEINTERVALS."""
        v4l2, found = self._v4l2, []
        for offered in v4l2.iter_read_formats(self._device, self._type):
            size = v4l2.raw.v4l2_frmsizeenum(pixel_format=offered.pixel_format)
            for _ in v4l2.iter_read(self._device, v4l2.raw.IOC.ENUM_FRAMESIZES, size):
                free = size.type != v4l2.FrameSizeType.DISCRETE
                width = size.stepwise.max_width if free else size.discrete.width
                height = size.stepwise.max_height if free else size.discrete.height
                rates = self._rates(offered.pixel_format, width, height)
                fourcc = v4l2.human_pixel_format(offered.pixel_format)
                found.append(VideoMode(fourcc, width, height, rates, free))
                if free:
                    break  # one range holds every size
        return tuple(found)

    def set_mode(self, fourcc: str, width_px: int, height_px: int) -> tuple[str, int, int]:
        """By S_FMT, which writes what is in force into the answer."""
        got = self._v4l2.set_format(self._device, self._type, width_px, height_px, fourcc).fmt.pix
        return self._v4l2.human_pixel_format(got.pixelformat), got.width, got.height

    def set_rate(self, rate_hz: float) -> float | None:
        """By S_PARM and then G_PARM; a driver without them tells no rate."""
        try:
            self._v4l2.set_fps(self._device, self._type, rate_hz)
            return self._rate()
        except OSError as err:
            if err.errno in (errno.ENOTTY, errno.EINVAL):
                return None
            raise

    def control_range(self, control: Control) -> ControlRange | None:
        """By QUERY_EXT_CTRL."""
        raw = self._v4l2.raw
        asked = raw.v4l2_query_ext_ctrl()
        asked.id = int(control)
        try:
            self._v4l2.ioctl(self._device, raw.IOC.QUERY_EXT_CTRL, asked)
        except OSError as err:
            if err.errno in (errno.EINVAL, errno.ENOTTY):
                return None
            raise
        if asked.flags & self._v4l2.ControlFlag.DISABLED:
            return None
        return ControlRange(asked.minimum, asked.maximum, asked.step)

    def set_control(self, control: Control, value: int) -> None:
        """By S_CTRL."""
        self._v4l2.set_control(self._device, int(control), value)

    def get_control(self, control: Control) -> int:
        """By G_CTRL."""
        return int(self._v4l2.get_control(self._device, int(control)))

    def start(self, buffers: int) -> None:
        """By REQBUFS, mmap, QBUF and STREAMON; the driver may give another number of buffers."""
        v4l2, memory = self._v4l2, self._v4l2.Memory.MMAP
        granted = v4l2.request_buffers(self._device, self._type, memory, buffers).count
        for index in range(granted):
            buffer = v4l2.query_buffer(self._device, self._type, memory, index)
            mapped = mmap.mmap(self._device.fileno(), buffer.length, offset=buffer.m.offset)
            self._memory.append(mapped)
            v4l2.enqueue_buffer(self._device, self._type, memory, 0, index)
        v4l2.stream_on(self._device, self._type)

    def read(self, timeout_s: float) -> Grab | None:
        """By poll and DQBUF; the one copy of the bytes is the one out of the kernel's buffer."""
        with self._guard:
            if self._closing:
                return None
            ready = self._poll.poll(max(timeout_s, 0.0) * 1e3)
            arrival_ns = time.monotonic_ns()
            events = dict(ready).get(self._device.fileno(), 0)
            if self._closing or not events:
                return None
            try:
                return self._dequeue(arrival_ns)
            except BlockingIOError as err:
                if events & (select.POLLERR | select.POLLHUP):
                    raise OSError(errno.ENODEV, "the device hung up") from err
                return None

    def close(self) -> None:
        """Stop, unmap, close; wakes a `read` that waits in another thread."""
        with self._close_guard:
            if self._closing:
                return
            self._closing = True
            os.eventfd_write(self._wake, 1)
            with self._guard:
                self._release()

    def _release(self) -> None:
        with contextlib.suppress(OSError):
            if self._memory:
                self._v4l2.stream_off(self._device, self._type)
        for memory in self._memory:
            memory.close()
        self._memory.clear()
        # Closing the file gives the buffers back.
        with contextlib.suppress(OSError):
            self._device.close()
        os.close(self._wake)

    def _rate(self) -> float | None:
        told = self._v4l2.get_parm(self._device, self._type)
        interval = told.parm.capture.timeperframe  # codespell:ignore parm
        return interval.denominator / interval.numerator if interval.numerator else None

    def _rates(self, pixel_format: int, width: int, height: int) -> tuple[float, ...]:
        ask = self._v4l2.iter_read_frame_intervals
        try:
            offered = list(ask(self._device, pixel_format, width, height))
        except ZeroDivisionError:  # a driver that offers an interval of zero
            return ()
        rates = {float(rate) for one in offered for rate in (one.min_fps, one.max_fps)}
        return tuple(sorted(rate for rate in rates if rate > 0))

    def _dequeue(self, arrival_ns: int) -> Grab:
        """Copy the oldest filled buffer and give it back to the driver."""
        v4l2, memory = self._v4l2, self._v4l2.Memory.MMAP
        buffer = v4l2.dequeue_buffer(self._device, self._type, memory)
        data = self._memory[buffer.index][: buffer.bytesused]
        v4l2.enqueue_buffer(self._device, self._type, memory, 0, buffer.index)
        flag = v4l2.BufferFlag
        monotonic = buffer.flags & flag.TIMESTAMP_MASK == flag.TIMESTAMP_MONOTONIC
        starts = buffer.flags & flag.TSTAMP_SRC_MASK == flag.TSTAMP_SRC_SOE
        return Grab(
            data=data,
            sequence=buffer.sequence,
            stamp_ns=buffer.timestamp.secs * 1_000_000_000 + buffer.timestamp.usecs * 1000,
            clock=StampClock.MONOTONIC if monotonic else StampClock.OTHER,
            edge=StampEdge.EXPOSURE_START if starts else StampEdge.FRAME_END,
            damaged=bool(buffer.flags & flag.ERROR),
            arrival_ns=arrival_ns,
        )


def _text(field: bytes) -> str:
    return field.decode("utf-8", errors="replace")
