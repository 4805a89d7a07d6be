from __future__ import annotations

import dataclasses
import errno

import numpy as np
import pytest
from camera_pictures import yuyv

from drivers import DeviceFaultError, ProtocolError
from drivers.camera import CameraEmulator, Frame, ZedCamera, ZedConfig, grey_image, split_stereo
from drivers.camera.v4l2 import VideoMode
from drivers.camera.v4l2.emulator import FACTS
from drivers.camera.zed import MODELS, ZED_MODES, Encoding
from drivers.camera.zed.driver import ENCODINGS

PATH = "/dev/v4l/by-id/usb-ZED-video-index0"
ZED = dataclasses.replace(FACTS, card="ZED: ZED", usb_id="2b03:f582", usb_mbit_s=5000.0)
OFFERED = tuple(
    VideoMode("YUYV", mode.width_px, mode.eye_height_px, tuple(map(float, mode.rates_hz)))
    for mode in ZED_MODES.values()
)


def emulator(config: ZedConfig) -> CameraEmulator:
    mode = ZED_MODES[config.mode]
    return CameraEmulator(
        lambda _: yuyv(mode.width_px, mode.eye_height_px), facts=ZED, modes=OFFERED
    )


def first_frame(config: ZedConfig) -> tuple[Frame, ZedCamera]:
    device = ZedCamera(config, emulator(config).open)
    device.connect()
    reading = device.read(0.1)
    assert reading is not None
    return reading.samples[0], device


@pytest.mark.parametrize(
    ("name", "size", "rates", "megabytes_s"),
    [
        ("HD2K", (4416, 1242), (15,), 164.5),
        ("HD1080", (3840, 1080), (15, 30), 248.8),
        ("HD720", (2560, 720), (15, 30, 60), 221.2),
        ("VGA", (1344, 376), (15, 30, 60, 100), 101.1),
    ],
)
def test_modes_are_those_of_the_reference(
    name: str, size: tuple[int, int], rates: tuple[int, ...], megabytes_s: float
) -> None:
    mode = ZED_MODES[name]
    assert ((mode.width_px, mode.eye_height_px), mode.rates_hz) == (size, rates)
    video = ZedConfig(PATH, name, rates[-1]).video
    assert (video.width_px, video.height_px, video.fourcc) == (*size, "YUYV")
    assert video.frame_bytes is not None
    assert video.frame_bytes * rates[-1] / 1e6 == pytest.approx(megabytes_s, abs=0.06)


def test_every_known_id_is_a_stereolabs_one() -> None:
    assert {usb_id.partition(":")[0] for usb_id in MODELS} == {"2b03"}
    assert MODELS["2b03:f582"] == "ZED"


@pytest.mark.parametrize("encode", ENCODINGS)
def test_eyes_are_apart_in_every_encoding(encode: Encoding) -> None:
    frame, _ = first_frame(ZedConfig(PATH, "VGA", encode=encode))
    assert frame.format == {"luma": "grey8", "yuyv": "yuyv", "jpeg": "jpeg"}[encode]
    left, right = split_stereo(grey_image(frame))
    assert left.shape == right.shape == (376, 672)
    # The seam lies on a border of JPEG blocks (672 = 84 x 8), so even a JPEG keeps it.
    np.testing.assert_allclose(left, 40, atol=1)
    np.testing.assert_allclose(right, 200, atol=1)


def test_brightness_is_half_the_bytes_and_jpeg_far_less() -> None:
    raw, _ = first_frame(ZedConfig(PATH, "VGA", encode="yuyv"))
    luma, _ = first_frame(ZedConfig(PATH, "VGA", encode="luma"))
    packed, _ = first_frame(ZedConfig(PATH, "VGA", encode="jpeg"))
    assert len(raw.data) == 2 * len(luma.data) == 1344 * 376 * 2
    assert len(packed.data) < len(luma.data) / 10
    assert (raw.t_ns, raw.sequence) == (luma.t_ns, luma.sequence) == (packed.t_ns, packed.sequence)


def test_quality_is_the_jpegs() -> None:
    noise = np.random.default_rng(4).integers(0, 256, (376, 1344, 2), dtype=np.uint8).tobytes()
    sizes = []
    for quality in (30, 90):
        config = ZedConfig(PATH, "VGA", quality=quality)
        camera = CameraEmulator(lambda _: noise, facts=ZED, modes=OFFERED)
        device = ZedCamera(config, camera.open)
        device.connect()
        reading = device.read(0.1)
        assert reading is not None
        sizes.append(len(reading.samples[0].data))
    assert sizes[0] < sizes[1] / 2


def test_a_cut_frame_is_given_as_it_came() -> None:
    config = ZedConfig(PATH, "VGA")
    camera = emulator(config)
    camera.cut = {14}
    device = ZedCamera(config, camera.open)
    device.connect()
    reading = device.read(0.1)
    assert reading is not None
    frame = reading.samples[0]
    assert (frame.sequence, frame.format, len(frame.data)) == (14, "yuyv", 1344 * 376)
    assert frame.fault == "505344 bytes instead of 1010688"
    assert device.counters.bad_frames == 1


def test_what_it_tells() -> None:
    _, device = first_frame(ZedConfig(PATH, "HD720"))
    told = device.identify()
    assert (told["model"], told["card"], told["usb_id"]) == ("ZED", "ZED: ZED", "2b03:f582")
    assert (told["mode"], told["eye_width_px"], told["width_px"]) == ("HD720", 1280, 2560)
    assert (told["encode"], told["quality"]) == ("jpeg", 90)
    assert device.name == f"ZED on {PATH}"
    assert ZedCamera(ZedConfig(PATH)).identify() == {}


def test_another_camera_is_no_zed_and_is_given_back() -> None:
    config = ZedConfig(PATH, "VGA")
    camera = emulator(config)
    camera.facts = dataclasses.replace(ZED, card="Webcam", usb_id="046d:082d")
    with pytest.raises(ProtocolError, match=r"is no ZED but Webcam \(046d:082d"):
        ZedCamera(config, camera.open).connect()
    assert (camera.opened, camera.closed) == (1, 1)


def test_a_mode_that_the_driver_changes_is_an_error() -> None:
    config = ZedConfig(PATH, "HD1080", 30)
    camera = emulator(config)
    camera.mode_in_force = ("YUYV", 2560, 720)
    with pytest.raises(DeviceFaultError, match="for 3840 x 1080 YUYV, got 2560 x 720 YUYV"):
        ZedCamera(config, camera.open).connect()


def test_a_zed_on_a_usb_2_port() -> None:
    config = ZedConfig(PATH, "HD720", 30)
    camera = emulator(config)
    camera.facts = dataclasses.replace(ZED, usb_mbit_s=480.0)
    camera.start_errno = errno.ENOSPC
    with pytest.raises(
        DeviceFaultError, match=r"needs 111 MB/s; its port runs at 480 Mbit/s, USB 2"
    ):
        ZedCamera(config, camera.open).connect()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("mode", "4K"),
        ("rate_hz", 25.0),
        ("encode", "h264"),
        ("quality", 0),
        ("exposure_s", 1.0),
        ("power_line_hz", 55),
    ],
)
def test_what_a_zed_does_not_have(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        dataclasses.replace(ZedConfig(PATH), **{field: value})  # type: ignore[arg-type]  # by name
