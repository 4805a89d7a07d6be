"""What counts as a picture."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from tracking.errors import ImageError

Image: TypeAlias = npt.NDArray[np.uint8]


def grey_image(image: npt.NDArray[Any] | None) -> Image:
    """The picture (h, w) in grey levels: as it is, or from blue, green, red (h, w, 3).

    Raises `ImageError` for anything that is not an 8-bit picture, also for the None with which
    OpenCV answers a file that it cannot decode.
    """
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise ImageError(f"a picture must be an array of 8-bit numbers (uint8), this is {kind}")
    if image.size == 0 or not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (1, 3))):
        raise ImageError(
            f"a picture must have shape (h, w) or (h, w, 3), this one has {image.shape}"
        )
    picture: Image = image
    if picture.ndim == 2:
        return picture
    if picture.shape[2] == 1:
        return picture[:, :, 0]
    import cv2

    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
