"""Our use of linuxpy against a kernel that is emulated ioctl by ioctl."""

from __future__ import annotations

import errno
import os
import select
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from camera_pictures import jpeg
from linuxpy.video import raw
from v4l2_kernel import GRANTED, SOE_MONOTONIC, Kernel

from drivers import DeviceLostError, DriverError, PortMissingError
from drivers.camera import Stamp, V4l2Camera, V4l2Config, list_cameras
from drivers.camera.v4l2 import Control, StampClock, StampEdge, VideoMode
from drivers.camera.v4l2.linux_source import LinuxSource


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Kernel:
    device = Kernel(tmp_path / "video0")
    monkeypatch.setattr("linuxpy.ioctl.fcntl.ioctl", device.ioctl)
    return device


@pytest.fixture
def source(kernel: Kernel) -> Iterator[LinuxSource]:
    opened = LinuxSource(str(kernel.file))
    yield opened
    opened.close()


def open_descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_our_control_numbers_are_the_kernels() -> None:
    assert {control.name: int(control) for control in Control} == {
        control.name: int(raw.ControlID[control.name]) for control in Control
    }


def test_facts(source: LinuxSource, kernel: Kernel) -> None:
    facts = source.facts()
    assert (facts.node, facts.driver, facts.bus) == (str(kernel.file), "uvcvideo", "usb-1")
    assert facts.card == "Kamera \N{REPLACEMENT CHARACTER}"
    assert facts.captures
    assert facts.usb_id is None


def test_a_node_is_judged_by_its_own_abilities(source: LinuxSource, kernel: Kernel) -> None:
    kernel.capabilities = raw.Capability.META_CAPTURE | raw.Capability.STREAMING
    assert not source.facts().captures


def test_modes(source: LinuxSource) -> None:
    assert source.modes() == (
        VideoMode("MJPG", 1920, 1080, (15.0, 30.0)),
        VideoMode("MJPG", 640, 480, (30.0,)),
        VideoMode("YUYV", 640, 480, (30.0,)),
    )


def test_sizes_that_may_be_chosen_freely_are_one_mode(
    source: LinuxSource, kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stepwise(arg: raw.v4l2_frmsizeenum) -> None:
        arg.type = raw.Frmsizetypes.STEPWISE
        arg.stepwise.max_width, arg.stepwise.max_height = 1280, 720

    monkeypatch.setattr(kernel, "_enum_framesizes", stepwise)
    monkeypatch.setitem(kernel.fails, raw.IOC.ENUM_FRAMEINTERVALS, errno.ENOTTY)
    assert source.modes() == (
        VideoMode("MJPG", 1280, 720, (), free=True),
        VideoMode("YUYV", 1280, 720, (), free=True),
    )


def test_a_control_that_is_switched_off_is_none(source: LinuxSource, kernel: Kernel) -> None:
    kernel.flags[int(Control.GAIN)] = raw.ControlFlag.DISABLED
    assert source.control_range(Control.GAIN) is None
    kernel.fails[raw.IOC.QUERY_EXT_CTRL] = errno.EIO
    with pytest.raises(OSError, match="refused"):
        source.control_range(Control.GAIN)
    kernel.fails[raw.IOC.S_PARM] = errno.EIO
    with pytest.raises(OSError, match="refused"):
        source.set_rate(30.0)


def test_mode_and_rate_are_what_is_in_force(source: LinuxSource, kernel: Kernel) -> None:
    assert source.set_mode("MJPG", 1920, 1080) == ("MJPG", 1920, 1080)
    assert source.set_mode("MJPG", 1000, 1000) == ("MJPG", 1920, 1080)
    assert source.set_rate(30.0) == 30.0
    assert kernel.interval == (1, 30)
    kernel.interval = (0, 0)
    kernel.no_rates = True
    assert source.set_rate(30.0) is None


def test_controls(source: LinuxSource, kernel: Kernel) -> None:
    limits = source.control_range(Control.EXPOSURE_ABSOLUTE)
    assert limits is not None
    assert (limits.minimum, limits.maximum, limits.step) == (3, 2047, 1)
    assert source.control_range(Control.FOCUS_AUTO) is None
    source.set_control(Control.GAIN, 400)  # the driver compares, this passes on
    assert source.get_control(Control.GAIN) == 400
    assert kernel.calls[-2:] == ["S_CTRL", "G_CTRL"]


def test_frames_with_stamps_and_flags(source: LinuxSource, kernel: Kernel) -> None:
    source.start(3)
    assert kernel.streaming
    assert len(kernel.queued) == 3
    kernel.frames.append((b"first", 7, 12_345_678_901_000, SOE_MONOTONIC))
    kernel.frames.append((b"2nd", 9, 1000, raw.BufferFlag.TIMESTAMP_COPY | raw.BufferFlag.ERROR))
    before_ns = time.monotonic_ns()
    first, second = source.read(1.0), source.read(1.0)
    assert first is not None
    assert second is not None
    assert (first.data, first.sequence, first.stamp_ns) == (b"first", 7, 12_345_678_901_000)
    assert (first.clock, first.edge) == (StampClock.MONOTONIC, StampEdge.EXPOSURE_START)
    assert not first.damaged
    assert (second.data, second.sequence, second.stamp_ns) == (b"2nd", 9, 1000)
    assert (second.clock, second.edge) == (StampClock.OTHER, StampEdge.FRAME_END)
    assert second.damaged
    assert before_ns <= first.arrival_ns <= second.arrival_ns <= time.monotonic_ns()
    assert len(kernel.queued) == 3  # every buffer is given back


def test_the_driver_may_give_fewer_buffers(source: LinuxSource, kernel: Kernel) -> None:
    source.start(20)
    assert len(kernel.queued) == GRANTED


def test_data_outlives_its_buffer(source: LinuxSource, kernel: Kernel) -> None:
    source.start(2)
    grabs = []
    for k in range(5):
        kernel.frames.append((bytes([k]) * 100, k, 0, 0))
        grabs.append(source.read(1.0))
    assert [grab and grab.data for grab in grabs] == [bytes([k]) * 100 for k in range(5)]


def test_nothing_yet_is_none(source: LinuxSource) -> None:
    source.start(2)
    assert source.read(0.0) is None


def test_a_device_that_went_is_an_error(source: LinuxSource, kernel: Kernel) -> None:
    source.start(2)
    kernel.fails[raw.IOC.DQBUF] = errno.ENODEV
    with pytest.raises(OSError, match="refused by the test"):
        source.read(1.0)


def test_a_device_that_hangs_up_without_a_word_is_an_error_and_no_endless_loop(
    source: LinuxSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    source.start(2)

    class HungUp:
        def poll(self, _: float) -> list[tuple[int, int]]:
            return [(source._device.fileno(), select.POLLERR)]

    monkeypatch.setattr(source, "_poll", HungUp())
    with pytest.raises(OSError, match="the device hung up"):
        source.read(1.0)


def test_all_is_given_back(kernel: Kernel) -> None:
    before = open_descriptors()
    source = LinuxSource(str(kernel.file))
    source.start(2)
    kernel.fails[raw.IOC.STREAMOFF] = errno.ENODEV  # unplugged
    source.close()
    source.close()
    assert open_descriptors() == before
    assert source.read(1.0) is None


def test_a_stream_that_does_not_start_gives_all_back(kernel: Kernel) -> None:
    before = open_descriptors()
    kernel.fails[raw.IOC.STREAMON] = errno.ENOSPC
    source = LinuxSource(str(kernel.file))
    with pytest.raises(OSError, match="refused"):
        source.start(2)
    source.close()
    assert open_descriptors() == before


def test_a_path_that_is_not_there_leaves_nothing_open(tmp_path: Path) -> None:
    before = open_descriptors()
    with pytest.raises(FileNotFoundError):
        LinuxSource(str(tmp_path / "video9"))
    assert open_descriptors() == before


def test_closing_wakes_a_read_that_waits_in_another_thread(tmp_path: Path) -> None:
    fifo = tmp_path / "video0"  # silent, where a file would always be ready
    os.mkfifo(fifo)
    source = LinuxSource(str(fifo))
    got: list[object] = []
    thread = threading.Thread(target=lambda: got.append(source.read(60.0)))
    thread.start()
    while not source._guard.locked():
        time.sleep(0)
    source.close()
    thread.join(10.0)
    assert got == [None]


def test_a_camera_on_this_machine_from_path_to_frame(kernel: Kernel) -> None:
    for k in range(40):
        stamp_ns = time.monotonic_ns() - (40 - k) * 33_333_333
        kernel.frames.append((jpeg(1920, 1080), k, stamp_ns, SOE_MONOTONIC))
    device = V4l2Camera(V4l2Config(str(kernel.file), exposure_s=0.01))
    device.connect()
    reading = device.read(1.0)
    assert reading is not None
    frame = reading.samples[0]
    assert (frame.sequence, frame.fault, frame.stamp) == (14, None, Stamp.EXPOSURE_START)
    assert frame.data == jpeg(1920, 1080)
    assert frame.exposure_ns == 10_000_000
    assert 5_000_000 <= frame.arrival_ns - frame.t_ns <= 2_000_000_000
    kernel.fails[raw.IOC.DQBUF] = errno.ENODEV
    with pytest.raises(DeviceLostError, match="the camera is gone"):
        device.read(1.0)
    device.close()
    assert not kernel.streaming


def test_the_list_of_cameras_through_the_real_road(kernel: Kernel, tmp_path: Path) -> None:
    before = open_descriptors()
    (camera,) = list_cameras(devices=tmp_path, sysfs=tmp_path)
    assert (camera.path, camera.driver, camera.problem) == (str(kernel.file), "uvcvideo", None)
    assert VideoMode("MJPG", 1920, 1080, (15.0, 30.0)) in camera.modes
    kernel.fails[raw.IOC.QUERYCAP] = errno.ENOTTY
    (camera,) = list_cameras(devices=tmp_path, sysfs=tmp_path)
    assert (
        camera.problem
        == f"{kernel.file}: is no video device; see trackside devices for the cameras"
    )
    assert open_descriptors() == before


def test_a_missing_camera_and_a_missing_library(monkeypatch: pytest.MonkeyPatch) -> None:
    device = V4l2Camera(V4l2Config("/dev/v4l/by-id/none"))
    with pytest.raises(PortMissingError, match="no camera is plugged in"):
        device.connect()
    monkeypatch.setitem(sys.modules, "linuxpy.video", None)
    with pytest.raises(DriverError, match=r"pip install trackside\[v4l2\]"):
        device.connect()
