"""Cameras in the thread that records them, and their faults over a whole recording."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from camera_pictures import jpeg

from drivers import Device, DeviceBack, DeviceLost, DeviceReader, Reading
from drivers.camera import (
    CameraEmulator,
    Frame,
    ImageFolder,
    ImageFolderConfig,
    RealClock,
    V4l2Camera,
    V4l2Config,
    VideoFile,
    VideoFileConfig,
    ZedCamera,
    ZedConfig,
)

Event = DeviceLost | DeviceBack


class Recorder:
    """Keeps what a reader hands on; `wait` until something is true of it."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.events: list[Event] = []
        self._changed = threading.Condition()

    def take(self, got: Reading[Frame] | Event) -> None:
        with self._changed:
            if isinstance(got, Reading):
                self.frames += got.samples
            else:
                self.events.append(got)
            self._changed.notify_all()

    def wait(self, true: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(true, timeout=30.0)


def test_every_camera_is_a_device() -> None:
    devices: list[Device[Frame]] = [
        V4l2Camera(V4l2Config("/dev/video0")),
        ZedCamera(ZedConfig("/dev/video0")),
        ImageFolder(ImageFolderConfig(Path("folder"))),
        VideoFile(VideoFileConfig(Path("film.avi"))),
    ]
    for device in devices:
        assert device.name
        assert device.counters.samples == 0
        assert dict(device.identify()) == {}
        device.close()


def test_a_pulled_cable_in_the_middle_of_a_recording_at_real_pace() -> None:
    camera = CameraEmulator(lambda _: jpeg(), clock=RealClock())
    # Fast, so that the test is: the emulator films at any rate.
    device = V4l2Camera(V4l2Config("/dev/video0", rate_hz=200.0, rate_tolerance=0.9), camera.open)
    recorder = Recorder()
    reader = DeviceReader(device, recorder.take, read_timeout_s=0.02, retry_s=(0.001,))
    device.connect()
    reader.start()
    recorder.wait(lambda: len(recorder.frames) >= 5)
    camera.unplugged = True
    recorder.wait(lambda: len(recorder.events) == 1)
    seen = len(recorder.frames)
    camera.unplugged = False
    recorder.wait(lambda: len(recorder.frames) >= seen + 5)
    assert reader.stop()
    assert [type(event) for event in recorder.events] == [DeviceLost, DeviceBack]
    assert camera.opened == camera.closed
    times = [frame.t_ns for frame in recorder.frames]
    assert times == sorted(times)
    assert all(0 < frame.arrival_ns - frame.t_ns < 2_000_000_000 for frame in recorder.frames)


def test_a_folder_in_a_reader_ends_without_an_event(tmp_path: Path) -> None:
    for k in range(6):
        (tmp_path / f"{k}.jpg").write_bytes(jpeg(64, 48, k))
    device = ImageFolder(ImageFolderConfig(tmp_path, rate_hz=30.0, real_time=False))
    recorder = Recorder()
    reader = DeviceReader(device, recorder.take, read_timeout_s=0.05)
    device.connect()
    reader.start()
    recorder.wait(lambda: len(recorder.frames) == 6)
    assert reader.stop()
    assert recorder.events == []


def test_an_hour_with_every_fault_now_and_then() -> None:
    """108 000 frames: each is given, or lost and counted; damaged ones are flagged."""
    whole = jpeg(64, 48)
    frames = 108_000
    camera = CameraEmulator(
        lambda _: whole,
        lost=set(range(100, frames, 997)),
        cut=set(range(200, frames, 1009)) - set(range(100, frames, 997)),
    )
    config = V4l2Config("/dev/video0", 64, 48, exposure_s=0.001)
    camera.mode_in_force = ("MJPG", 64, 48)
    device = V4l2Camera(config, camera.open)
    device.connect()
    first = last = -1
    while last < frames - 2:
        reading = device.read(0.2)
        assert reading is not None
        last = reading.samples[0].sequence
        first = last if first < 0 else first
    counters = device.counters
    assert counters.samples + counters.lost_samples == last - first + 1
    assert counters.lost_samples == len([k for k in camera.lost if first < k < last])
    assert counters.bad_frames == len([k for k in camera.cut if first <= k <= last])
    assert counters.timeouts == 0


def test_cameras_open_without_heavy_imports() -> None:
    program = "import drivers.camera, sys; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert loaded & {"cv2", "linuxpy", "serial", "scipy"} == set()
