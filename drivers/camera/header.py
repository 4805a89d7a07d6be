"""What the bytes of an image say of themselves, without decoding a pixel.

JPEG: ITU-T T.81, annex B; PNG: ISO/IEC 15948, clause 5. A file that passes can still hold damaged
pixels (JPEG has no checksum); what a pulled cable or a full bus leaves behind does not pass.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from drivers.camera.frame import FrameFormat

SOI, EOI = b"\xff\xd8", b"\xff\xd9"
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
SOS = 0xDA
# The start-of-frame markers; C4, C8 and CC in their range mean something else (T.81, table B.1).
SOF = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
STANDALONE = frozenset(range(0xD0, 0xD8)) | {0x01}
DAMAGED = "damaged header"


@dataclass(frozen=True)
class ImageHeader:
    """format : None where the bytes are no image we know; fault : None where nothing is wrong."""

    format: FrameFormat | None
    width_px: int = 0
    height_px: int = 0
    fault: str | None = None


def read_header(data: bytes) -> ImageHeader:
    """Format, size and completeness of a JPEG or PNG; never raises, whatever the bytes are."""
    if data.startswith(SOI):
        return read_jpeg_header(data)
    if data.startswith(PNG_SIGNATURE):
        return _png(data)
    return ImageHeader(None, fault="no image: it starts like neither a JPEG nor a PNG")


def read_jpeg_header(data: bytes) -> ImageHeader:
    """Size and completeness of a JPEG; what a driver left behind its end does not matter."""
    if not data.startswith(SOI):
        return ImageHeader(None, fault="no JPEG: the start mark is missing")
    size, scan = _jpeg_segments(data)
    if size is None:
        return ImageHeader("jpeg", fault=DAMAGED)
    # Within the pixels FF is always followed by 00, so the end mark cannot stand there by chance.
    complete = scan is not None and (data.endswith(EOI) or data.find(EOI, scan) >= 0)
    fault = None if complete else "cut off: the end mark is missing"
    return ImageHeader("jpeg", size[0], size[1], fault)


def _jpeg_segments(data: bytes) -> tuple[tuple[int, int] | None, int | None]:
    """Width and height, and where the pixels begin; None for what the segments do not lead to."""
    size = None
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF or marker in STANDALONE:  # a fill byte; a mark without a length
            at += 1 if marker == 0xFF else 2
            continue
        length = int.from_bytes(data[at + 2 : at + 4], "big")
        if length < 2:
            break
        if marker in SOF and length >= 8 and at + 9 <= len(data):
            height = int.from_bytes(data[at + 5 : at + 7], "big")
            width = int.from_bytes(data[at + 7 : at + 9], "big")
            size = (width, height) if width and height else None
        at += 2 + length
        if marker == SOS:
            return size, at
    return size, None


def _png(data: bytes) -> ImageHeader:
    """A PNG's chunks with their checksums; the pixels are inside them."""
    width = height = 0
    at = len(PNG_SIGNATURE)
    while at + 12 <= len(data):
        length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        end = at + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return ImageHeader("png", width, height, f"damaged at byte {at}: wrong checksum")
        if at == len(PNG_SIGNATURE):
            if kind != b"IHDR" or length < 8:
                return ImageHeader("png", fault=DAMAGED)
            width = int.from_bytes(data[at + 8 : at + 12], "big")
            height = int.from_bytes(data[at + 12 : at + 16], "big")
        if kind == b"IEND":
            return ImageHeader("png", width, height)
        at = end + 4
    return ImageHeader("png", width, height, "cut off: the end chunk is missing")
