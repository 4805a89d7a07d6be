"""Frames, stamps, counts and losses of an emulated camera, in simulated time."""

from __future__ import annotations

import dataclasses
import itertools

import pytest
from camera_pictures import jpeg, yuyv
from v4l2_talk import CONFIG, PATH, connected, elapsed_s, emulator, one

from drivers import (
    DeviceLostError,
    PortMissingError,
)
from drivers.camera import CameraEmulator, Stamp, V4l2Camera, V4l2Config
from drivers.camera.v4l2 import Grab, StampClock, StampEdge, VideoSource
from drivers.camera.v4l2.emulator import TRANSFER_NS


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


def test_frames_that_the_camera_takes_late_are_counted_as_slow() -> None:
    camera = emulator()
    device = connected(camera)
    camera.lost = {one(device.read(0.1)).sequence + 2}
    for _ in range(3):
        one(device.read(0.1))
    assert "slow_frames" not in device.counters.details
    camera.true_rate_hz = 15.0  # the light went out
    for _ in range(5):
        one(device.read(1.0))
    assert device.counters.details == {"slow_frames": 5}
    assert device.counters.lost_samples == 1


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


def test_a_driver_that_does_not_count_loses_nothing_and_says_so() -> None:
    camera = emulator()
    device = connected(camera)
    source = device._source
    assert source is not None
    counted = source.read

    def uncounted(timeout_s: float) -> Grab | None:
        grab = counted(timeout_s)
        return None if grab is None else dataclasses.replace(grab, sequence=0)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(source, "read", uncounted)
        assert [one(device.read(0.1)).sequence for _ in range(3)] == [0, 0, 0]
    assert device.counters.details == {"sequence_steps_back": 3}
    assert device.counters.lost_samples == 0


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


def test_closing_while_it_is_opened() -> None:
    camera = emulator()

    def open_and_be_closed(path: str) -> VideoSource:
        source = camera.open(path)
        device.close()
        return source

    device = V4l2Camera(CONFIG, open_and_be_closed)
    with pytest.raises(DeviceLostError, match="closed while it was being connected"):
        device.connect()
    assert (camera.opened, camera.closed) == (1, 1)


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
