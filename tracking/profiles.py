"""Where to sample around a ring: short lines across its edges.

Every marker gets the same K lines, so that all are sampled by one `remap` and solved by one matrix.
Line k crosses the edge where the edge's *normal* has the angle 2 pi k / K. The place of a closed
convex curve is then the first harmonic of its offsets along the lines, whatever its shape in the
image; size and flattening are harmonics 0 and 2, and nothing of one leaks into another.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TypeAlias, cast

import numpy as np
import numpy.typing as npt

from geometry import Floats
from tracking.images import Image

Samples: TypeAlias = npt.NDArray[np.float32]
FixedMaps: TypeAlias = tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]

_NOTHING = np.zeros((0, 0), np.float32)


@lru_cache(maxsize=8)
def line_directions(lines: int) -> Floats:
    """Unit vectors (K, 2) along which the lines run outwards."""
    angle = np.arange(lines) * (2.0 * np.pi / lines)
    return _fixed(np.stack([np.cos(angle), np.sin(angle)], axis=1))


@lru_cache(maxsize=8)
def harmonics(lines: int) -> Floats:
    """What a shift in x and y, growth and flattening do to the offsets: (K, 5).

    Columns cos, sin, 1, cos 2, sin 2 of the lines' angles.
    """
    angle = np.arange(lines) * (2.0 * np.pi / lines)
    columns = [np.cos(angle), np.sin(angle), np.ones(lines), np.cos(2 * angle), np.sin(2 * angle)]
    return _fixed(np.stack(columns, axis=1))


@lru_cache(maxsize=8)
def harmonic_fit(lines: int) -> Floats:
    """The least squares inverse of `harmonics`, (5, K)."""
    return _fixed(np.asarray(np.linalg.pinv(harmonics(lines)), np.float64))


def spokes(shapes: Floats, lines: int) -> Floats:
    """Unit vectors (n, K, 2) on the marker which shapes (n, 2, 2) carry to where the lines cross.

    A shape carries the unit circle to pixels round the centre; the normals of the image are the
    circle's own under the inverse transpose.
    """
    raw = line_directions(lines) @ shapes
    unit: Floats = raw / np.sqrt(np.einsum("nki,nki->nk", raw, raw))[..., None]
    return unit


def line_vectors(lines: int, offsets_px: Floats) -> Samples:
    """From an edge point to its samples (n, K, 1, m, 2), for offsets (n, m) outwards."""
    along = line_directions(lines)[None, :, None, None, :] * offsets_px[:, None, None, :, None]
    return along.astype(np.float32)


def line_points(edges: Floats, vectors: Samples) -> Samples:
    """Sample points (n, K * s * m, 2) from edge points (n, K, s, 2)."""
    points = edges[:, :, :, None, :].astype(np.float32) + vectors
    return points.reshape(len(edges), -1, 2)


def fixed_maps(coordinates: Samples) -> FixedMaps:
    """Sample points (n, points, 2) in the form in which OpenCV looks them up fastest.

    In 1/32 of a pixel, the grid to which it rounds coordinates in any case.
    """
    import cv2

    whole, part = cv2.convertMaps(coordinates, _NOTHING, cv2.CV_16SC2)
    return np.asarray(whole, np.int16), np.asarray(part, np.uint16)


def sample(image: Image, coordinates: Samples) -> Samples:
    """`grey_levels` as numbers to reckon with."""
    return grey_levels(image, coordinates).astype(np.float32)


def grey_levels(image: Image, coordinates: Samples | FixedMaps) -> Image:
    """Bilinear grey levels (n, points) at (n, points, 2); beyond the border its last pixel."""
    import cv2

    first, second = coordinates if isinstance(coordinates, tuple) else (coordinates, _NOTHING)
    if not len(first):
        return np.zeros(first.shape[:2], np.uint8)
    levels = cv2.remap(image, first, second, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return cast(Image, levels)


def _fixed(array: Floats) -> Floats:
    array.flags.writeable = False
    return array
