"""From a frame's bytes to brightness in an array, and a stereo image into its eyes."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from drivers.camera.frame import Frame
from drivers.errors import ProtocolError

Image: TypeAlias = npt.NDArray[np.uint8]


def grey_image(frame: Frame) -> Image:
    """Brightness (height, width) of a frame in any format.

    Raises `ProtocolError` where the bytes cannot be decoded or do not give the frame's size.
    """
    import cv2

    size = (frame.height_px, frame.width_px)
    channels = {"grey8": 1, "yuyv": 2, "bgr8": 3}.get(frame.format)
    if channels is None:
        return _decoded(frame, size)
    raw = np.frombuffer(frame.data, dtype=np.uint8)
    if raw.size != size[0] * size[1] * channels:
        raise ProtocolError(
            f"frame {frame.sequence}: {raw.size} bytes for {frame.width_px} x {frame.height_px} "
            f"pixels of {frame.format}; {size[0] * size[1] * channels} were expected"
        )
    if frame.format == "bgr8":
        return np.asarray(cv2.cvtColor(raw.reshape(*size, 3), cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    return (yuyv_luma(frame.data) if frame.format == "yuyv" else raw).reshape(size)


def decode_grey(data: bytes) -> Image | None:
    """Brightness (height, width) of an encoded image; None where its bytes cannot be decoded.

    As the pixels lie: a turn that EXIF asks for is left out, as a calibration is of the sensor.
    """
    import cv2

    raw = np.frombuffer(data, dtype=np.uint8)
    how = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(raw, how) if raw.size else None
    return None if image is None else np.asarray(image, dtype=np.uint8)


def yuyv_luma(data: bytes) -> Image:
    """Brightness (n,) of n pixels in YUYV, where it is the first of every two bytes.

    Raises `ValueError` for an odd number of bytes.
    """
    # The lower half of a 16-bit word: numpy narrows words much faster than it picks bytes.
    return np.frombuffer(data, dtype="<u2").astype(np.uint8)


def split_stereo(image: npt.NDArray[np.uint8]) -> tuple[Image, Image]:
    """Left and right eye of a side-by-side image, as views; the left eye is the left half.

    Raises `ValueError` for an odd width.
    """
    width = image.shape[1]
    if width % 2:
        raise ValueError(f"an image {width} pixels wide is not two eyes side by side")
    return image[:, : width // 2], image[:, width // 2 :]


def _decoded(frame: Frame, size: tuple[int, int]) -> Image:
    image = decode_grey(frame.data)
    if image is None or image.shape != size:
        got = "no image" if image is None else f"{image.shape[1]} x {image.shape[0]} pixels"
        raise ProtocolError(
            f"frame {frame.sequence}: its {len(frame.data)} bytes of {frame.format} decode to {got}"
            f"; {frame.width_px} x {frame.height_px} pixels were expected; leave this frame out"
        )
    return image
