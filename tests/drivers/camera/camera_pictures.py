"""Small pictures for the camera tests, made once."""

from __future__ import annotations

import functools

import cv2
import numpy as np
import numpy.typing as npt


@functools.cache
def jpeg(width: int = 1920, height: int = 1080, value: int = 90) -> bytes:
    """A flat picture with a bright square in its upper left corner."""
    image = np.full((height, width), value, np.uint8)
    image[: height // 4, : width // 4] = 250
    return encoded(image, ".jpg")


def encoded(image: npt.NDArray[np.uint8], suffix: str) -> bytes:
    good, data = cv2.imencode(suffix, image)
    assert good
    return data.tobytes()


@functools.cache
def yuyv(width: int, height: int) -> bytes:
    """Brightness 40 in the left half, 200 in the right one; colours that are not to be seen."""
    pixels = np.empty((height, width, 2), np.uint8)
    pixels[:, : width // 2, 0] = 40
    pixels[:, width // 2 :, 0] = 200
    pixels[:, :, 1] = 77
    return pixels.tobytes()
