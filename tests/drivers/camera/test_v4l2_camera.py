"""Conversations with an emulated camera, in simulated time."""

from __future__ import annotations

import dataclasses
import errno
import itertools

import pytest
from pictures import jpeg, yuyv

from drivers import (
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    NoAnswerError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
    Reading,
)
from drivers.camera import CameraEmulator, Frame, Stamp, V4l2Camera, V4l2Config
from drivers.camera.v4l2 import Control, StampClock, StampEdge, VideoMode
from drivers.camera.v4l2.emulator import FACTS, RANGES, TRANSFER_NS

PATH = "/dev/v4l/by-id/usb-emulated-video-index0"
CONFIG = V4l2Config(PATH, exposure_s=0.005)
PERIOD_NS = 33_333_333


def emulator(width: int = 1920, height: int = 1080) -> CameraEmulator:
    return CameraEmulator(lambda t_ns: jpeg(width, height, t_ns % 7))


def connected(camera: CameraEmulator, config: V4l2Config = CONFIG) -> V4l2Camera:
    device = V4l2Camera(config, camera.open)
    device.connect()
    return device


def one(reading: Reading[Frame] | None) -> Frame:
    assert reading is not None
    assert reading.raw == ()
    assert len(reading.samples) == 1
    return reading.samples[0]


def elapsed_s(camera: CameraEmulator) -> float:
    return camera.clock.now_ns() * 1e-9


def test_making_a_camera_touches_nothing() -> None:
    camera = emulator()
    device = V4l2Camera(CONFIG, camera.open)
    assert (camera.opened, device.identify()) == (0, {})
    assert device.name == f"camera on {PATH}"


def test_frames_come_as_the_camera_made_them() -> None:
    device = connected(emulator())
    frames = [one(device.read(0.1)) for _ in range(5)]
    for frame in frames:
        assert (frame.format, frame.width_px, frame.height_px) == ("jpeg", 1920, 1080)
        assert frame.data == jpeg(1920, 1080, frame.t_ns % 7)
        assert frame.fault is None
    assert [b.sequence - a.sequence for a, b in itertools.pairwise(frames)] == [1] * 4
    assert device.counters.samples == 5
    assert device.counters.lost_samples == 0


def test_no_copy_of_the_bytes_is_made_on_the_way() -> None:
    picture = jpeg()
    device = connected(CameraEmulator(lambda _: picture))
    assert one(device.read(0.1)).data is picture


def test_a_start_of_exposure_stamp_gives_the_middle_of_the_exposure() -> None:
    device = connected(emulator())
    frame = one(device.read(0.1))
    started_ns = round(frame.sequence * 1e9 / 30)
    assert frame.stamp is Stamp.EXPOSURE_START
    assert frame.t_ns == started_ns + 2_500_000
    assert frame.exposure_ns == 5_000_000
    assert frame.device_ns is None
    assert frame.arrival_ns == pytest.approx(started_ns + 5_000_000 + TRANSFER_NS, abs=2000)


def test_an_automatic_exposure_is_not_known_and_not_guessed() -> None:
    device = connected(emulator(), V4l2Config(PATH))
    frame = one(device.read(0.1))
    assert frame.exposure_ns is None
    assert (frame.stamp, frame.t_ns) == (Stamp.EXPOSURE_START, round(frame.sequence * 1e9 / 30))


def test_an_end_of_frame_stamp_is_said_to_be_one() -> None:
    camera = emulator()
    camera.edge = StampEdge.FRAME_END
    frame = one(connected(camera).read(0.1))
    ended_ns = round(frame.sequence * 1e9 / 30) + 5_000_000 + TRANSFER_NS
    assert (frame.stamp, frame.t_ns) == (Stamp.FRAME_END, ended_ns - 2_500_000)


@pytest.mark.parametrize("claims", [StampClock.OTHER, StampClock.MONOTONIC])
def test_stamps_of_another_clock_become_ticks_whatever_the_flag_claims(claims: StampClock) -> None:
    camera = emulator()
    camera.claims, camera.stamp_offset_ns = claims, 1_700_000_000_000_000_000
    device = connected(camera)
    assert device.identify()["stamps_by"] == "another clock"
    reading = device.read(0.1)
    frame = one(reading)
    assert reading is not None
    (tick,) = reading.ticks
    started_ns = round(frame.sequence * 1e9 / 30)
    assert frame.stamp is Stamp.ARRIVAL
    assert frame.t_ns == frame.arrival_ns - 2_500_000
    assert frame.device_ns == started_ns + camera.stamp_offset_ns + 2_500_000
    assert tick.device_ns == started_ns + camera.stamp_offset_ns
    assert (tick.arrival_ns, tick.delay_ns) == (frame.arrival_ns, 5_000_000)
    assert "odd_stamps" not in device.counters.details


def test_a_clock_that_goes_back_begins_a_new_epoch() -> None:
    camera = emulator()
    camera.claims, camera.stamp_offset_ns = StampClock.OTHER, 10**18
    device = connected(camera)
    before = device.read(0.1)
    camera.stamp_offset_ns = 0
    after = device.read(0.1)
    assert before is not None
    assert after is not None
    assert after.ticks[0].epoch == before.ticks[0].epoch + 1


def test_a_camera_without_stamps_is_stamped_at_arrival_without_ticks() -> None:
    camera = emulator()
    camera.claims, camera.stampless = StampClock.OTHER, True
    device = connected(camera)
    reading = device.read(0.1)
    frame = one(reading)
    assert reading is not None
    assert reading.ticks == ()
    assert (frame.stamp, frame.device_ns) == (Stamp.ARRIVAL, None)
    assert frame.t_ns == frame.arrival_ns - 2_500_000
    assert device.identify()["stamps_by"] == "arrival; the driver gives no stamps"


def test_one_odd_stamp_of_a_good_camera_is_counted_and_not_believed() -> None:
    camera = emulator()
    device = connected(camera)
    camera.stamp_offset_ns = 5_000_000_000
    frame = one(device.read(0.1))
    assert (frame.stamp, frame.t_ns) == (Stamp.ARRIVAL, frame.arrival_ns - 2_500_000)
    camera.stamp_offset_ns = 0
    assert one(device.read(0.1)).stamp is Stamp.EXPOSURE_START
    assert device.counters.details == {"odd_stamps": 1}


def test_holes_in_the_count_are_lost_samples() -> None:
    camera = emulator()
    device = connected(camera)
    first = one(device.read(0.1)).sequence
    camera.lost = {first + 1, first + 2, first + 5}
    assert [one(device.read(0.2)).sequence - first for _ in range(3)] == [3, 4, 6]
    assert device.counters.lost_samples == 3


def test_a_reader_that_comes_late_loses_frames_and_knows_how_many() -> None:
    camera = emulator()
    device = connected(camera)
    first = one(device.read(0.1)).sequence
    camera.clock.pause(1.0)
    later = [one(device.read(0.1)).sequence - first for _ in range(6)]
    assert later[:4] == [1, 2, 3, 4]
    assert later[4] >= 30
    assert device.counters.lost_samples == later[4] - 5


def test_a_cut_frame_is_counted_given_and_flagged() -> None:
    camera = emulator()
    device = connected(camera)
    camera.cut = {one(device.read(0.1)).sequence + 1}
    frame = one(device.read(0.1))
    assert frame.fault == "cut off: the end mark is missing"
    assert len(frame.data) > 0
    assert one(device.read(0.1)).fault is None
    assert (device.counters.bad_frames, device.counters.samples) == (1, 3)


def test_the_drivers_own_flag_for_lost_data_counts() -> None:
    camera = emulator()
    device = connected(camera)
    camera.damaged = {one(device.read(0.1)).sequence + 1}
    assert one(device.read(0.1)).fault == "the driver says that data was lost"
    assert device.counters.bad_frames == 1


def test_a_picture_of_another_size_is_flagged() -> None:
    device = connected(emulator(1280, 720))
    assert one(device.read(0.1)).fault == "1280 x 720 pixels instead of the mode's"


def test_uncompressed_frames_are_judged_by_their_length() -> None:
    config = V4l2Config(PATH, 640, 480, fourcc="YUYV")
    camera = CameraEmulator(lambda _: yuyv(640, 480))
    device = connected(camera, config)
    frame = one(device.read(0.1))
    assert (frame.format, frame.fault) == ("yuyv", None)
    camera.cut = {frame.sequence + 1}
    assert one(device.read(0.1)).fault == "307200 bytes instead of 614400"


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


def test_a_size_that_is_not_offered_names_asked_got_and_offered() -> None:
    told(
        refused(emulator(), V4l2Config(PATH, 1600, 1200)),
        DeviceFaultError,
        "asked Emulated camera for 1600 x 1200 MJPG, got 1920 x 1080 MJPG",
        "it offers 640 x 480, 1280 x 720, 1920 x 1080",
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


def test_a_frame_that_is_not_yet_there_is_none() -> None:
    camera = emulator()
    device = connected(camera)
    one(device.read(0.1))
    before_s = elapsed_s(camera)
    assert device.read(0.01) is None
    assert elapsed_s(camera) == pytest.approx(before_s + 0.01, abs=1e-5)


def test_a_frozen_camera_is_lost_after_two_seconds() -> None:
    camera = emulator()
    device = connected(camera)
    camera.frozen = True
    before_s = elapsed_s(camera)
    while elapsed_s(camera) - before_s < 1.9:
        assert device.read(0.1) is None
    camera.clock.pause(0.1)
    with pytest.raises(DeviceLostError, match=r"no frame for 2\.\d s.*check its cable"):
        device.read(0.1)
    assert 1.9 < elapsed_s(camera) - before_s < 2.2
    assert device.counters.timeouts == 1


def test_an_unplugged_camera_is_lost_and_comes_back() -> None:
    camera = emulator()
    device = connected(camera)
    one(device.read(0.1))
    camera.unplugged = True
    with pytest.raises(DeviceLostError, match=r"the camera is gone.*No such device"):
        device.read(0.1)
    device.close()
    with pytest.raises(PortMissingError):
        device.connect()
    camera.unplugged = False
    device.connect()
    assert one(device.read(0.1)).fault is None
    assert device.counters.lost_samples == 0
    assert (camera.opened, camera.closed) == (2, 1)


def test_closing_twice_and_while_connecting() -> None:
    camera = emulator()
    device = connected(camera)
    device.close()
    device.close()
    assert camera.closed == 1

    def scene(_: int) -> bytes:
        device.close()
        return jpeg()

    camera.scene = scene
    with pytest.raises(DeviceLostError, match="closed while it was being connected"):
        device.connect()
    assert camera.opened == camera.closed


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
