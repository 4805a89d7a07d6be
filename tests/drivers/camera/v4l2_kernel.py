"""The kernel's side of V4L2, ioctl by ioctl, behind a file that linuxpy takes for a device.

The file's content is the buffers' memory. A file is always ready to be read, so a queue without
frames answers EAGAIN.
"""

from __future__ import annotations

import errno
import mmap
from collections import deque
from pathlib import Path
from typing import Any

from linuxpy.video import raw

IOC = raw.IOC
SIZE = 1 << 16
GRANTED = 6
MODES: dict[str, dict[tuple[int, int], tuple[int, ...]]] = {
    "MJPG": {(1920, 1080): (30, 15), (640, 480): (30,)},
    "YUYV": {(640, 480): (30,)},
}
SOE_MONOTONIC = raw.BufferFlag.TIMESTAMP_MONOTONIC | raw.BufferFlag.TSTAMP_SRC_SOE


def fourcc(text: str) -> int:
    return int.from_bytes(text.encode(), "little")


class Kernel:
    """One device. `frames` waits to be taken: data, sequence, stamp in nanoseconds, flags."""

    def __init__(self, file: Path) -> None:
        file.write_bytes(bytes(SIZE * 8))
        self.file = file
        self.capabilities = raw.Capability.VIDEO_CAPTURE | raw.Capability.STREAMING
        self.frames: deque[tuple[bytes, int, int, int]] = deque()
        self.controls = {
            int(raw.ControlID.EXPOSURE_AUTO): [3, 0, 3, 1],
            int(raw.ControlID.EXPOSURE_ABSOLUTE): [156, 3, 2047, 1],
            int(raw.ControlID.GAIN): [0, 0, 255, 1],
        }
        self.flags: dict[int, int] = {}
        self.format = ("MJPG", 640, 480)
        self.interval = (1, 15)
        self.queued: deque[int] = deque()
        self.streaming = False
        self.fails: dict[int, int] = {}
        self.no_rates = False
        self.calls: list[str] = []

    def ioctl(self, fd: Any, request: int, arg: Any) -> int:
        assert isinstance(fd.fileno(), int)
        name = IOC(request).name
        self.calls.append(name)
        if request in self.fails:
            raise OSError(self.fails[request], "refused by the test")
        answer = getattr(self, f"_{name.lower()}", None)
        if answer is None:
            raise OSError(errno.ENOTTY, f"{name} is not emulated")
        answer(arg)
        return 0

    def _querycap(self, arg: Any) -> None:
        arg.driver, arg.card, arg.bus_info = b"uvcvideo", "Kamera ä".encode("latin-1"), b"usb-1"
        arg.capabilities = raw.Capability.DEVICE_CAPS | raw.Capability.VIDEO_CAPTURE
        arg.device_caps = self.capabilities

    def _enum_fmt(self, arg: Any) -> None:
        arg.pixelformat = fourcc(indexed(list(MODES), arg.index))

    def _enum_framesizes(self, arg: Any) -> None:
        sizes = MODES[arg.pixel_format.to_bytes(4, "little").decode()]
        arg.type = raw.Frmsizetypes.DISCRETE
        arg.m1.discrete.width, arg.m1.discrete.height = indexed(list(sizes), arg.index)

    def _enum_frameintervals(self, arg: Any) -> None:
        rates = MODES[arg.pixel_format.to_bytes(4, "little").decode()][arg.width, arg.height]
        arg.type = raw.Frmivaltypes.DISCRETE
        arg.discrete.numerator, arg.discrete.denominator = 1, indexed(list(rates), arg.index)

    def _s_fmt(self, arg: Any) -> None:
        pix = arg.fmt.pix
        asked = (pix.pixelformat.to_bytes(4, "little").decode(), pix.width, pix.height)
        if asked[1:] in MODES[asked[0]]:
            self.format = asked
        self._g_fmt(arg)

    def _g_fmt(self, arg: Any) -> None:
        arg.fmt.pix.pixelformat = fourcc(self.format[0])
        arg.fmt.pix.width, arg.fmt.pix.height = self.format[1:]
        arg.fmt.pix.sizeimage = SIZE

    def _s_parm(self, arg: Any) -> None:
        if self.no_rates:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        asked = arg.parm.capture.timeperframe  # codespell:ignore parm
        self.interval = (asked.numerator, asked.denominator)

    def _g_parm(self, arg: Any) -> None:
        told = arg.parm.capture.timeperframe  # codespell:ignore parm
        told.numerator, told.denominator = self.interval

    def _query_ext_ctrl(self, arg: Any) -> None:
        if arg.id not in self.controls:
            raise OSError(errno.EINVAL, "Invalid argument")
        _, arg.minimum, arg.maximum, arg.step = self.controls[arg.id]
        arg.flags = self.flags.get(arg.id, 0)

    def _s_ctrl(self, arg: Any) -> None:
        self.controls[arg.id][0] = arg.value

    def _g_ctrl(self, arg: Any) -> None:
        arg.value = self.controls[arg.id][0]

    def _reqbufs(self, arg: Any) -> None:
        arg.count = min(arg.count, GRANTED)
        self.queued.clear()

    def _querybuf(self, arg: Any) -> None:
        arg.length, arg.m.offset = SIZE, arg.index * SIZE

    def _qbuf(self, arg: Any) -> None:
        assert arg.index not in self.queued
        self.queued.append(arg.index)

    def _dqbuf(self, arg: Any) -> None:
        if not self.frames:
            raise OSError(errno.EAGAIN, "Resource temporarily unavailable")
        data, sequence, stamp_ns, flags = self.frames.popleft()
        arg.index = self.queued.popleft()
        with self.file.open("r+b") as file, mmap.mmap(file.fileno(), 0) as memory:
            memory[arg.index * SIZE : arg.index * SIZE + len(data)] = data
        arg.bytesused, arg.sequence, arg.flags = len(data), sequence, flags
        arg.timestamp.secs, rest_ns = divmod(stamp_ns, 10**9)
        arg.timestamp.usecs = rest_ns // 1000

    def _streamon(self, _: Any) -> None:
        self.streaming = True

    def _streamoff(self, _: Any) -> None:
        self.streaming = False
        self.queued.clear()


def indexed(values: list[Any], index: int) -> Any:
    if index >= len(values):
        raise OSError(errno.EINVAL, "Invalid argument")
    return values[index]
