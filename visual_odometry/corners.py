"""Corners worth following, spread over the picture, and a first guess of their disparity."""

from __future__ import annotations

import numpy as np

from geometry import Floats
from visual_odometry.config import VoConfig
from visual_odometry.rectification import Image

BORDER_PX = 14
_BLOCK_PX = 5
_APART_PX = 7
_QUALITY = 0.003
"""Of the best corner of the picture, below which a corner is none."""
_DISPARITIES = 64
_HALF_BLOCK_PX = 11


def corners(image: Image, config: VoConfig) -> Floats:
    """The best corners (n, 2) of each cell, to whole pixels (Shi and Tomasi, 1994)."""
    import cv2

    strength = np.asarray(cv2.cornerMinEigenVal(image, _BLOCK_PX))
    peak = strength == np.asarray(cv2.dilate(strength, np.ones((_APART_PX, _APART_PX), np.uint8)))
    best = float(strength.max())
    down, across = np.nonzero(peak & (strength > _QUALITY * best))
    height, width = image.shape
    inside = (across >= BORDER_PX) & (across < width - BORDER_PX)
    inside &= (down >= BORDER_PX) & (down < height - BORDER_PX)
    down, across = down[inside], across[inside]
    cell = (down * config.cells_down // height) * config.cells_across
    cell += across * config.cells_across // width
    order = np.lexsort((-strength[down, across], cell))
    down, across, cell = down[order], across[order], cell[order]
    first = np.searchsorted(cell, cell)
    kept = np.arange(cell.size) - first < config.per_cell
    return np.stack([across[kept], down[kept]], axis=1).astype(np.float64)


def coarse_disparity(left: Image, right: Image, points: Floats) -> Floats:
    """Disparity (n,) at points (n, 2) of the left eye to a pixel or two; NaN where unknown.

    left, right : at half the size, points and disparity at full. Block matching, for a corner near
    the car is 120 pixels off in the other eye, too far for following it down a pyramid.
    """
    import cv2

    # Widened, as block matching leaves out the first columns.
    wide = [
        cv2.copyMakeBorder(half, 0, 0, _DISPARITIES, 0, cv2.BORDER_REPLICATE)
        for half in (left, right)
    ]
    matcher = cv2.StereoBM.create(_DISPARITIES, _HALF_BLOCK_PX)
    matcher.setUniquenessRatio(5)
    found = np.asarray(matcher.compute(*wide), np.float64)[:, _DISPARITIES:] / 16.0
    rows = np.minimum((points[:, 1] / 2.0).astype(int), found.shape[0] - 1)
    columns = np.minimum((points[:, 0] / 2.0).astype(int), found.shape[1] - 1)
    disparity = found[rows, columns]
    return np.where(disparity > 0.0, 2.0 * disparity, np.nan)
