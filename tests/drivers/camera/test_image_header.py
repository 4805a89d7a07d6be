from __future__ import annotations

import numpy as np
import pytest
from camera_pictures import encoded, jpeg
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera import read_header, read_jpeg_header

NOISE = np.random.default_rng(1).integers(0, 256, (48, 64, 3), dtype=np.uint8)
JPEG, PNG = encoded(NOISE, ".jpg"), encoded(NOISE, ".png")


def segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + (len(body) + 2).to_bytes(2, "big") + body


def frame_start(width: int, height: int) -> bytes:
    return b"\x08" + height.to_bytes(2, "big") + width.to_bytes(2, "big") + b"\x01\x01\x11\x00"


SCAN = segment(0xDA, bytes(6)) + b"\x12\xff\x00\x34"


def without_tables(data: bytes) -> bytes:
    """The JPEG as USB cameras send it: the Huffman tables are those of the standard, left out."""
    out, at = data[:2], 2
    while data[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(data[at + 2 : at + 4], "big")
        out += b"" if data[at + 1] == 0xC4 else data[at:end]
        at = end
    return out + data[at:]


@pytest.mark.parametrize("kind", ["jpeg", "png"])
def test_size_and_format(kind: str) -> None:
    header = read_header({"jpeg": JPEG, "png": PNG}[kind])
    assert (header.format, header.width_px, header.height_px) == (kind, 64, 48)
    assert header.fault is None


def test_a_full_size_picture() -> None:
    header = read_jpeg_header(jpeg(1920, 1080))
    assert (header.width_px, header.height_px, header.fault) == (1920, 1080, None)


def test_a_jpeg_of_a_usb_camera_brings_no_tables() -> None:
    bare = without_tables(JPEG)
    assert len(bare) < len(JPEG) - 100
    assert read_jpeg_header(bare) == read_jpeg_header(JPEG)


@pytest.mark.parametrize("rest", [bytes(1000), b"\x00\x01", JPEG[-500:-2]])
def test_what_a_driver_leaves_behind_the_end_does_not_matter(rest: bytes) -> None:
    assert read_jpeg_header(JPEG + rest) == read_jpeg_header(JPEG)


def test_a_picture_inside_a_segment_is_not_the_picture() -> None:
    inner = segment(0xE1, b"\xff\xd8" + segment(0xC0, frame_start(9, 9)) + b"\xff\xd9")
    outer = b"\xff\xd8" + inner + segment(0xC0, frame_start(64, 48)) + SCAN
    header = read_jpeg_header(outer + b"\xff\xd9")
    assert (header.width_px, header.height_px, header.fault) == (64, 48, None)
    # Nor is its end the picture's.
    assert read_jpeg_header(outer).fault == "cut off: the end mark is missing"


def test_fill_bytes_and_marks_without_length_are_passed_over() -> None:
    data = b"\xff\xd8\xff\xff\xff\x01" + segment(0xC2, frame_start(64, 48)) + SCAN + b"\xff\xd9"
    header = read_jpeg_header(data)
    assert (header.width_px, header.height_px, header.fault) == (64, 48, None)


@given(st.integers(2, len(JPEG) - 1))
def test_a_jpeg_cut_anywhere_is_at_fault(length: int) -> None:
    assert read_jpeg_header(JPEG[:length]).fault is not None


@given(st.integers(0, len(PNG) - 1))
def test_a_png_cut_anywhere_is_at_fault(length: int) -> None:
    assert read_header(PNG[:length]).fault is not None


@given(st.integers(8, len(PNG) - 1), st.integers(1, 255))
def test_a_png_with_any_wrong_byte_is_at_fault(at: int, flip: int) -> None:
    assert read_header(PNG[:at] + bytes([PNG[at] ^ flip]) + PNG[at + 1 :]).fault is not None


@given(st.binary(max_size=200))
def test_any_bytes_are_judged_and_none_is_an_error(data: bytes) -> None:
    for start in (b"", b"\xff\xd8", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n"):
        header = read_header(start + data)
        assert header.fault is not None or header.width_px > 0


def test_no_image_at_all() -> None:
    assert read_header(b"GIF89a").fault == "no image: it starts like neither a JPEG nor a PNG"
    assert read_jpeg_header(PNG).fault == "no JPEG: the start mark is missing"
    assert read_header(b"").format is None
