"""What a frame costs between the kernel's buffer and the recorder: processor time and copies.

    uv run python benchmarks/camera_stream.py

The emulated camera hands out each frame as the kernel does: as a copy out of mapped memory, which
is the one copy that is allowed. Copies are the peak of Python's own memory during one read, in
frames, to a hundredth. The share of a core is measured at real pace, thread and emulator included.
"""

from __future__ import annotations

import mmap
import time
import tracemalloc
from collections.abc import Callable
from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from dialogue import Table
from drivers import Device, DeviceReader
from drivers.camera import (
    CameraEmulator,
    Clock,
    Frame,
    FreeClock,
    RealClock,
    V4l2Camera,
    V4l2Config,
    ZedCamera,
    ZedConfig,
    read_jpeg_header,
)
from drivers.camera.v4l2 import VideoMode

PATH = "/dev/v4l/by-id/emulated"
RATE_HZ = 30.0
FRAMES, COPY_FRAMES, REAL_S = 600, 20, 5.0
JPEG_LIMIT_US = 333.0
"""A hundredth of a core at 30 frames a second."""
COPY_LIMIT = 1.0

Image: TypeAlias = npt.NDArray[np.uint8]
Maker: TypeAlias = Callable[[CameraEmulator], Device[Frame]]


def main() -> None:
    """Print the tables."""
    jpeg = _jpeg()
    rows = [
        _row("V4L2 1920 x 1080 JPEG", _camera(jpeg), _v4l2, JPEG_LIMIT_US, COPY_LIMIT),
        _row("ZED HD720, luma", _zed_camera(), _zed("luma"), None, None),
        _row("ZED HD720, JPEG of luma", _zed_camera(), _zed("jpeg"), None, None),
    ]
    columns = (
        "stream", "frame [MB]", "median [us]", "p99 [us]", "limit [us]", "limit / median",
        "copies", "limit of copies",
    )  # fmt: skip
    print(Table(columns, tuple(rows), "One frame, simulated pace").render("md"))
    print()
    header_us = 1e6 * min(_timed(lambda: read_jpeg_header(jpeg)) for _ in range(1000))
    print(f"of it: judging a JPEG of {len(jpeg) / 1e6:.2f} MB by its header: {header_us:.1f} us")
    share, frames, lost = _real_pace(jpeg)
    print(
        f"at real pace in a DeviceReader: {frames} frames in {REAL_S:g} s, {lost} lost, "
        f"{100 * share:.2f} % of a core (limit 1 %)"
    )


def _row(
    name: str,
    camera: CameraEmulator,
    make: Maker,
    limit_us: float | None,
    limit_copies: float | None,
) -> tuple[str | float | None, ...]:
    device = make(camera)
    device.connect()
    size = len(_read(device).data)
    times_us = np.array([1e6 * _timed(lambda: _read(device)) for _ in range(FRAMES)])
    copies = _copies(device)
    device.close()
    median = float(np.median(times_us))
    ratio = None if limit_us is None else limit_us / median
    p99 = float(np.percentile(times_us, 99))
    return (name, size / 1e6, median, p99, limit_us, ratio, copies, limit_copies)


def _timed(action: Callable[[], object]) -> float:
    """Processor seconds of this thread."""
    start = time.thread_time_ns()
    action()
    return (time.thread_time_ns() - start) * 1e-9


def _read(device: Device[Frame]) -> Frame:
    reading = device.read(1.0)
    if reading is None or reading.samples[0].fault is not None:
        raise RuntimeError("the emulated camera gave no good frame")
    return reading.samples[0]


def _copies(device: Device[Frame]) -> float:
    """Peak of Python's memory during a read, in frames as they come out of the kernel."""
    peaks = []
    tracemalloc.start()
    for _ in range(COPY_FRAMES):
        tracemalloc.reset_peak()
        before, _ = tracemalloc.get_traced_memory()
        frame = _read(device)
        _, peak = tracemalloc.get_traced_memory()
        zed = isinstance(device, ZedCamera)
        taken = frame.width_px * frame.height_px * 2 if zed else len(frame.data)
        peaks.append((peak - before) / taken)
        del frame
    tracemalloc.stop()
    return round(float(np.median(peaks)), 2)


def _mapped(data: bytes) -> Callable[[int], bytes]:
    """A scene that is copied out of mapped memory at each frame."""
    memory = mmap.mmap(-1, len(data))
    memory[:] = data
    return lambda _: memory[: len(data)]


def _camera(jpeg: bytes, clock: Clock | None = None) -> CameraEmulator:
    return CameraEmulator(_mapped(jpeg), clock=clock or FreeClock())


def _v4l2(camera: CameraEmulator) -> V4l2Camera:
    return V4l2Camera(V4l2Config(PATH, rate_hz=RATE_HZ, exposure_s=0.005), camera.open)


def _zed_camera() -> CameraEmulator:
    pixels = np.empty((720, 2560, 2), np.uint8)
    pixels[:, :, 0] = _scene(720, 2560)
    pixels[:, :, 1] = 128
    camera = CameraEmulator(_mapped(pixels.tobytes()))
    camera.modes = (VideoMode("YUYV", 2560, 720, (RATE_HZ,)),)
    camera.facts = type(camera.facts)("/dev/video0", "ZED", "uvcvideo", "usb", True)
    return camera


def _zed(encode: str) -> Maker:
    if encode == "luma":
        return lambda camera: ZedCamera(ZedConfig(PATH, encode="luma"), camera.open)
    return lambda camera: ZedCamera(ZedConfig(PATH, encode="jpeg"), camera.open)


def _scene(height: int, width: int) -> Image:
    """Floor with light falling off, edges, and the noise of a sensor."""
    generator = np.random.default_rng(1)
    row, column = np.mgrid[0:height, 0:width]
    clean = 90 + 60 * np.sin(column / 190) * np.cos(row / 130) + 40 * ((row // 60) % 2)
    noisy = clean + generator.normal(0, 6, (height, width))
    image: Image = np.clip(noisy, 0, 255).astype(np.uint8)
    return image


def _jpeg() -> bytes:
    """A 1080p frame of about half a megabyte."""
    _, data = cv2.imencode(".jpg", _scene(1080, 1920), [cv2.IMWRITE_JPEG_QUALITY, 90])
    return data.tobytes()


def _real_pace(jpeg: bytes) -> tuple[float, int, int]:
    """Share of a core, frames, lost frames."""
    device = _v4l2(_camera(jpeg, RealClock()))
    reader = DeviceReader(device, lambda _: None)
    device.connect()
    start_s, start_cpu_s = time.monotonic(), time.process_time()
    reader.start()
    time.sleep(REAL_S)
    share = (time.process_time() - start_cpu_s) / (time.monotonic() - start_s)
    reader.stop()
    return share, device.counters.samples, device.counters.lost_samples


if __name__ == "__main__":
    main()
