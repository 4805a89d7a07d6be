"""What is asked of an emulated camera at connect, and everything that it may refuse."""

from __future__ import annotations

import dataclasses
import errno

import pytest
from camera_pictures import jpeg
from v4l2_talk import CONFIG, PATH, connected, elapsed_s, emulator, one

from drivers import (
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    NoAnswerError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
)
from drivers.camera import CameraEmulator, V4l2Camera, V4l2Config
from drivers.camera.v4l2 import Control, VideoMode
from drivers.camera.v4l2.emulator import FACTS, RANGES


def test_what_is_in_force_is_told() -> None:
    config = V4l2Config(PATH, exposure_s=0.005, gain=17, focus=30, power_line_hz=50)
    told = connected(emulator(), config).identify()
    assert told["model"] == "Emulated camera"
    assert (told["driver"], told["serial"], told["usb_id"]) == ("uvcvideo", "8C2D5B7F", "046d:082d")
    assert (told["fourcc"], told["width_px"], told["height_px"]) == ("MJPG", 1920, 1080)
    assert (told["rate_asked_hz"], told["rate_told_hz"]) == (30.0, 30.0)
    assert told["rate_measured_hz"] == pytest.approx(30.0, abs=0.01)
    assert told["stamps_by"] == "the kernel, monotonic"
    assert told["controls"] == {
        "autogain": 0,
        "gain": 17,
        "power_line_frequency": 1,
        "exposure_auto": 1,
        "exposure_absolute": 50,
        "exposure_auto_priority": 0,
        "focus_absolute": 30,
        "focus_auto": 0,
    }


def test_automatic_exposure_may_not_lower_the_rate() -> None:
    camera = emulator()
    controls = connected(camera, V4l2Config(PATH)).identify()["controls"]
    assert isinstance(controls, dict)
    assert (controls["exposure_auto"], controls["exposure_auto_priority"]) == (3, 0)


def test_a_camera_that_calls_its_automatic_exposure_otherwise() -> None:
    camera = emulator()
    camera.exposure_modes = (0, 1)
    controls = connected(camera, V4l2Config(PATH)).identify()["controls"]
    assert isinstance(controls, dict)
    assert controls["exposure_auto"] == 0


def test_a_control_that_cannot_be_read_is_not_told_and_harms_nothing() -> None:
    camera = emulator()
    camera.unreadable = {Control.FOCUS_AUTO}
    controls = connected(camera).identify()["controls"]
    assert isinstance(controls, dict)
    assert "focus_auto" not in controls
    assert len(controls) == len(RANGES) - 1


def refused(camera: CameraEmulator, config: V4l2Config = CONFIG) -> DriverError:
    """The error of connecting; all is given back and five seconds are not passed."""
    device = V4l2Camera(config, camera.open)
    with pytest.raises(DriverError) as caught:
        device.connect()
    assert elapsed_s(camera) < 5.0
    assert camera.opened == camera.closed
    with pytest.raises(DeviceLostError, match="not connected"):
        device.read(0.0)
    return caught.value


def told(error: DriverError, kind: type[DriverError], *parts: str) -> None:
    assert type(error) is kind
    for part in (PATH, *parts):
        assert part in str(error)


@pytest.mark.parametrize(
    ("number", "kind", "remedy"),
    [
        (errno.ENOENT, PortMissingError, "no camera is plugged in"),
        (errno.ENODEV, PortMissingError, "trackside devices"),
        (errno.EACCES, PortDeniedError, "sudo usermod -aG video $USER"),
        (errno.EBUSY, PortBusyError, f"fuser -v {PATH}"),
        (errno.ENOTTY, PortError, "is no video device"),
        (errno.EIO, PortError, "cannot be opened as a camera"),
    ],
)
def test_a_path_that_does_not_open(number: int, kind: type[DriverError], remedy: str) -> None:
    camera = emulator()
    camera.open_errno = number
    told(refused(camera), kind, remedy)


def test_a_node_for_metadata_is_no_camera() -> None:
    camera = emulator()
    camera.facts = dataclasses.replace(FACTS, captures=False)
    told(refused(camera), PortError, "gives no video", "-video-index0")


def test_a_camera_without_jpeg() -> None:
    camera = emulator()
    camera.modes = (VideoMode("YUYV", 640, 480), VideoMode("H264", 1920, 1080))
    told(refused(camera), DeviceFaultError, "offers no MJPG, only H264, YUYV", "ask for YUYV")
    camera.modes = (VideoMode("H264", 1920, 1080),)
    told(refused(camera), DeviceFaultError, "another camera is needed")


@pytest.mark.parametrize(
    ("number", "kind", "remedy"),
    [
        (errno.EBUSY, PortBusyError, "another program uses this camera"),
        (errno.ENODEV, DeviceLostError, "the camera is gone"),
        (errno.EINVAL, DeviceFaultError, "refuses 1920 x 1080 MJPG at 30 Hz"),
    ],
)
def test_a_mode_that_is_refused(number: int, kind: type[DriverError], remedy: str) -> None:
    camera = emulator()
    camera.mode_errno = number
    told(refused(camera), kind, remedy)


def test_a_setting_that_cannot_be_read_back_is_no_setting() -> None:
    camera = emulator()
    camera.unreadable = {Control.GAIN}
    told(refused(camera, V4l2Config(PATH, gain=3)), DeviceFaultError, "Input/output error")


def test_a_size_that_is_not_offered_names_asked_got_and_offered() -> None:
    told(
        refused(emulator(), V4l2Config(PATH, 1600, 1200)),
        DeviceFaultError,
        "asked Emulated camera for 1600 x 1200 MJPG, got 1920 x 1080 MJPG",
        "it offers 640 x 480, 1280 x 720, 1920 x 1080 (its port runs at 480 Mbit/s, USB 2)",
    )


def test_fifteen_for_thirty_as_the_camera_tells_it() -> None:
    camera = emulator()
    camera.rate_in_force_hz = 15.0
    told(refused(camera), DeviceFaultError, "at 30 Hz, got 15 Hz", "it offers 15 Hz, 30 Hz")
    assert elapsed_s(camera) == 0.0


def test_fifteen_for_thirty_whatever_the_camera_tells() -> None:
    camera = emulator()
    camera.true_rate_hz = 15.0
    told(refused(camera), DeviceFaultError, "asked Emulated camera for 30 frames", "got 15.0")
    assert elapsed_s(camera) < 1.5


def test_frames_lost_on_the_way_are_not_a_lower_rate() -> None:
    camera = emulator()
    camera.lost = set(range(1, 30, 2))
    assert connected(camera).identify()["rate_measured_hz"] == pytest.approx(30.0, abs=0.01)


def test_a_rate_of_29_97_is_one_of_30() -> None:
    camera = emulator()
    camera.rate_in_force_hz = 30000 / 1001
    connected(camera)


@pytest.mark.parametrize(
    ("control", "asked", "config"),
    [
        (Control.EXPOSURE_ABSOLUTE, "exposure_absolute 50", V4l2Config(PATH, exposure_s=0.005)),
        (Control.EXPOSURE_AUTO, "exposure_auto 1", V4l2Config(PATH, exposure_s=0.005)),
        (Control.GAIN, "gain 40", V4l2Config(PATH, gain=40)),
        (Control.FOCUS_ABSOLUTE, "focus_absolute 10", V4l2Config(PATH, focus=10)),
        (
            Control.POWER_LINE_FREQUENCY,
            "power_line_frequency 2",
            V4l2Config(PATH, power_line_hz=60),
        ),
    ],
)
def test_a_setting_that_does_not_hold(control: Control, asked: str, config: V4l2Config) -> None:
    camera = emulator()
    camera.stuck = {control: 0}
    told(refused(camera, config), DeviceFaultError, f"asked for {asked}, got 0")


def test_a_camera_that_stays_in_manual_exposure() -> None:
    camera = emulator()
    camera.stuck = {Control.EXPOSURE_AUTO: 1}
    told(refused(camera, V4l2Config(PATH)), DeviceFaultError, "automatic exposure", "manual")


def test_a_setting_out_of_range_names_the_range() -> None:
    config = V4l2Config(PATH, gain=400)
    told(refused(emulator(), config), DeviceFaultError, "gain 400", "from 0 to 255 in steps of 1")


def test_a_setting_that_the_camera_does_not_have() -> None:
    camera = emulator()
    del camera.ranges[Control.FOCUS_ABSOLUTE]
    told(refused(camera, V4l2Config(PATH, focus=3)), DeviceFaultError, "has no control focus")


def test_a_camera_with_hardly_a_control_still_films() -> None:
    only = {Control.EXPOSURE_ABSOLUTE: RANGES[Control.EXPOSURE_ABSOLUTE]}
    camera = CameraEmulator(lambda _: jpeg(), ranges=only)
    assert connected(camera, V4l2Config(PATH)).identify()["controls"] == {"exposure_absolute": 3}


def test_a_full_usb_bus() -> None:
    camera = emulator()
    camera.start_errno = errno.ENOSPC
    told(refused(camera), DeviceFaultError, "the USB bus has no room", "480 Mbit/s, USB 2", "MJPG")


def test_a_full_usb_bus_with_uncompressed_frames_names_the_demand() -> None:
    camera = emulator()
    camera.start_errno = errno.ENOSPC
    config = V4l2Config(PATH, 640, 480, fourcc="YUYV")
    told(refused(camera, config), DeviceFaultError, "the mode needs 18 MB/s; its port runs at 480")


@pytest.mark.parametrize(
    ("number", "kind", "remedy"),
    [
        (errno.EBUSY, PortBusyError, "another program uses this camera"),
        (errno.EIO, DeviceFaultError, "does not start to stream"),
        (errno.ENODEV, DeviceLostError, "the camera is gone"),
    ],
)
def test_a_stream_that_does_not_start(number: int, kind: type[DriverError], remedy: str) -> None:
    camera = emulator()
    camera.start_errno = number
    told(refused(camera), kind, remedy)


def test_a_camera_that_stays_silent() -> None:
    camera = emulator()
    camera.frozen = True
    told(refused(camera), NoAnswerError, "no frame from Emulated camera within 3.0 s")


def test_a_camera_that_starts_late() -> None:
    camera = emulator()
    camera.late_s = 2.5
    device = connected(camera)
    assert elapsed_s(camera) < 5.0
    assert one(device.read(0.1)).fault is None


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("fourcc", "H264"),
        ("width_px", 0),
        ("rate_hz", 0.0),
        ("exposure_s", 0.05),
        ("exposure_s", 0.0),
        ("power_line_hz", 55),
        ("buffers", 1),
        ("rate_tolerance", 1.0),
        ("silence_s", 0.0),
    ],
)
def test_what_no_camera_could_do_is_refused_before_one_is_asked(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        dataclasses.replace(CONFIG, **{field: value})  # type: ignore[arg-type]  # by name
