from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest
from camera_pictures import encoded, yuyv

from drivers import ProtocolError
from drivers.camera import Frame, FrameFormat, Stamp, decode_grey, grey_image, split_stereo

RAMP = np.arange(48 * 64, dtype=np.uint32).reshape(48, 64).astype(np.uint8)


def frame(image_format: FrameFormat, data: bytes, width: int = 64, height: int = 48) -> Frame:
    return Frame(0, Stamp.ARRIVAL, 7, image_format, data, width, height, 0)


def test_grey_from_png_is_exact() -> None:
    np.testing.assert_array_equal(grey_image(frame("png", encoded(RAMP, ".png"))), RAMP)


def test_grey_from_raw_brightness_is_exact() -> None:
    np.testing.assert_array_equal(grey_image(frame("grey8", RAMP.tobytes())), RAMP)


def test_grey_from_colours_is_opencvs() -> None:
    colours = np.random.default_rng(2).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    expected = cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY)
    np.testing.assert_array_equal(grey_image(frame("bgr8", colours.tobytes())), expected)


def test_grey_from_yuyv_is_opencvs() -> None:
    raw = np.random.default_rng(3).integers(0, 256, (48, 64, 2), dtype=np.uint8)
    expected = cv2.cvtColor(raw, cv2.COLOR_YUV2GRAY_YUYV)
    np.testing.assert_array_equal(grey_image(frame("yuyv", raw.tobytes())), expected)


def test_a_turn_asked_for_by_exif_is_left_out() -> None:
    plain = encoded(RAMP, ".jpg")
    entry = struct.pack("<HHIHH", 0x0112, 3, 1, 6, 0)  # orientation: a quarter turn
    exif = b"Exif\0\0II*\0" + struct.pack("<IH", 8, 1) + entry + bytes(4)
    turned = plain[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + plain[2:]
    by_default = cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert by_default is not None
    assert by_default.shape == (64, 48)  # so there is something to leave out
    expected = decode_grey(plain)
    assert expected is not None
    np.testing.assert_array_equal(decode_grey(turned), expected)


@pytest.mark.parametrize("data", [b"", b"\xff\xd8 no picture"])
def test_bytes_that_are_no_image_decode_to_none(data: bytes) -> None:
    assert decode_grey(data) is None


def test_left_eye_is_the_left_half_and_no_copy() -> None:
    image = grey_image(frame("yuyv", yuyv(64, 48)))
    left, right = split_stereo(image)
    assert (left.shape, right.shape) == ((48, 32), (48, 32))
    assert (set(left.ravel().tolist()), set(right.ravel().tolist())) == ({40}, {200})
    assert np.shares_memory(left, image)


def test_an_odd_width_is_not_two_eyes() -> None:
    with pytest.raises(ValueError, match="65 pixels wide"):
        split_stereo(np.zeros((4, 65), np.uint8))


def test_bytes_that_do_not_fit_are_named() -> None:
    with pytest.raises(ProtocolError, match=r"frame 7: 10 bytes for 64 x 48.*6144 were expected"):
        grey_image(frame("yuyv", bytes(10)))
    with pytest.raises(ProtocolError, match=r"decode to no image; 64 x 48"):
        grey_image(frame("jpeg", b"\xff\xd8\xff\xd9"))
    with pytest.raises(ProtocolError, match="decode to no image"):
        grey_image(frame("jpeg", b""))
    with pytest.raises(ProtocolError, match="decode to 64 x 48 pixels; 32 x 48"):
        grey_image(frame("png", encoded(RAMP, ".png"), width=32))
