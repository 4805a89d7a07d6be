"""Places in a picture that might be ring markers: cheap tests on contours of small copies.

A copy of the picture is halved until the smallest marker is just large enough, and on from there
for the larger ones: each octave of sizes is looked for where it is ten to thirty pixels wide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from geometry import Floats
from tracking.images import Image

LEAST_PX = 10.0
"""A marker must keep this diameter in the copy in which it is looked for."""
_BLOCK_PX = 25
"""Side of the square whose mean is the local threshold: a marker and what is around it."""
_WIDEST_PX = 44.0
_HOLE = (0.15, 0.75)
"""The hole's width over the ring's; contours are a pixel off, so this is generous."""
_OFF_MIDDLE = 0.15
_FLATTEST = 0.2


def ring_candidates(
    image: Image, smallest_px: float, ratio: float, below_mean: float
) -> tuple[Floats, Floats]:
    """Centres (n, 2) and half widths and heights (n, 2) of the outer edges, in pixels.

    below_mean : grey levels by which the black must be darker than the surrounding. The same
    marker may come twice, from two copies or from its ring and its hole.
    """
    centres, halves = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for copy, factor in _copies(image, smallest_px):
        centre, half = _in_copy(copy, ratio, below_mean)
        # Pixel (0, 0) of the copy is the middle of a square of the picture.
        centres.append(factor * (centre + 0.5) - 0.5)
        halves.append(factor * half)
    return np.concatenate(centres), np.concatenate(halves)


def _copies(image: Image, smallest_px: float) -> Iterator[tuple[Image, int]]:
    """The picture in the sizes in which markers are looked for, and how many times smaller."""
    import cv2

    factor = 1
    while min(image.shape) >= LEAST_PX:
        if smallest_px / (2 * factor) < LEAST_PX:
            # Halving averages the noise away; the picture itself must be smoothed for that.
            yield (image if factor > 1 else np.asarray(cv2.blur(image, (3, 3)), np.uint8)), factor
        half = (image.shape[1] // 2, image.shape[0] // 2)
        if min(half) < LEAST_PX:
            return
        even = image[: 2 * half[1], : 2 * half[0]]
        image = np.asarray(cv2.resize(even, half, interpolation=cv2.INTER_AREA), np.uint8)
        factor *= 2


def _in_copy(copy: Image, ratio: float, below_mean: float) -> tuple[Floats, Floats]:
    import cv2

    black = cv2.adaptiveThreshold(
        copy, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, _BLOCK_PX, below_mean
    )
    contours, hierarchy = cv2.findContours(black, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    if not len(contours):
        return np.zeros((0, 2)), np.zeros((0, 2))
    parents = hierarchy[0, :, 3]
    corners = np.fromiter(map(len, contours), np.int64, len(contours))
    # Even a hole of one pixel has four corners, and a ring of ten pixels eight.
    holes = np.flatnonzero((parents >= 0) & (corners >= 4) & (corners[parents] >= 8))
    inner = _boxes(contours, holes)
    # The contour of a hole runs on the black pixels around it.
    inner[:, 2:] -= 2.0
    plausible = (inner[:, 2:].max(axis=1) <= _HOLE[1] * _WIDEST_PX) & (
        inner[:, 2:].min(axis=1) >= _FLATTEST * inner[:, 2:].max(axis=1)
    )
    holes, inner = holes[plausible], inner[plausible]
    return _rings(inner, _boxes(contours, parents[holes]), ratio)


def _rings(inner: Floats, outer: Floats, ratio: float) -> tuple[Floats, Floats]:
    """Outer edges where ring and hole fit; from the hole where the ring runs into the dark."""
    size = outer[:, 2:].max(axis=1)
    share = inner[:, 2:] / outer[:, 2:]
    aside = np.abs(inner[:, :2] - outer[:, :2]).max(axis=1)
    whole = (
        (size >= LEAST_PX - 2.0)
        & (size <= _WIDEST_PX)
        & (share > _HOLE[0]).all(axis=1)
        & (share < _HOLE[1]).all(axis=1)
        & (aside <= _OFF_MIDDLE * size + 1.0)
    )
    half = inner[:, 2:] / (2.0 * ratio)
    torn = ~whole & (size > _WIDEST_PX) & (half.max(axis=1) <= _WIDEST_PX / 2.0)
    torn &= half.min(axis=1) >= LEAST_PX / 2.0
    centres = np.concatenate([outer[whole, :2], inner[torn, :2]])
    return centres, np.concatenate([outer[whole, 2:] / 2.0, half[torn]])


def _boxes(contours: Sequence[Any], which: npt.NDArray[np.generic]) -> Floats:
    """Middle and size (n, 4) of the contours' bounding boxes, pixels counted whole."""
    import cv2

    boxes = np.array([cv2.boundingRect(contours[i]) for i in which], np.float64).reshape(-1, 4)
    boxes[:, :2] += (boxes[:, 2:] - 1.0) / 2.0
    return boxes
