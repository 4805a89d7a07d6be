"""Patches around points, brought to their place in another picture to a hundredth of a pixel.

Inverse compositional alignment (Baker and Matthews, 2004) of a translation. The patch is bent
beforehand as the surface it lies on would bend it between the two views: a floor seen from 20 cm
above changes so much within 10 cm of driving that a patch that is only shifted lands beside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats
from visual_odometry.rectification import Image

HALF_PX = 6
ROUNDS = 3
_STEP = np.arange(-HALF_PX, HALF_PX + 1, dtype=np.float32)
_OFFSETS = np.stack([grid.ravel() for grid in np.meshgrid(_STEP, _STEP)])
# Less weight at the rim, where the bending is told less well.
_WEIGHT = np.exp(-0.5 * (_OFFSETS**2).sum(axis=0) / (0.6 * HALF_PX) ** 2).astype(np.float32)
_WEIGHT /= _WEIGHT.sum()

Single = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches (n, k) without their mean, their slopes (n, k) and the solver (n, 2, 2) of a step."""

    values: Single
    spread: Single
    slope_x: Single
    slope_y: Single
    solver: Single

    def selected(self, mask: npt.NDArray[np.bool_]) -> Patches:
        """Some of them."""
        return Patches(self.values[mask], self.spread[mask], self.slope_x[mask],
                       self.slope_y[mask], self.solver[mask])  # fmt: skip


def patches_at(image: Image, points: Floats) -> Patches:
    """The patches of points (n, 2) that are whole pixels, in the border of none."""
    at = np.rint(points).astype(int)
    grown = np.arange(-HALF_PX - 1, HALF_PX + 2)
    rows, columns = at[:, 1, None, None] + grown[:, None], at[:, 0, None, None] + grown
    around = image[rows, columns].astype(np.float32)
    count = len(at)
    values = around[:, 1:-1, 1:-1].reshape(count, _OFFSETS.shape[1])
    slope_x = (around[:, 1:-1, 2:] - around[:, 1:-1, :-2]).reshape(
        count, _OFFSETS.shape[1]
    ) * np.float32(0.5)
    slope_y = (around[:, 2:, 1:-1] - around[:, :-2, 1:-1]).reshape(
        count, _OFFSETS.shape[1]
    ) * np.float32(0.5)
    values = values - (values @ _WEIGHT)[:, None]
    # A mean that is free takes its share of the slopes.
    slope_x -= (slope_x @ _WEIGHT)[:, None]
    slope_y -= (slope_y @ _WEIGHT)[:, None]
    xx, yy = (slope_x**2) @ _WEIGHT, (slope_y**2) @ _WEIGHT
    xy = (slope_x * slope_y) @ _WEIGHT
    scale = 1.0 / np.maximum(xx * yy - xy * xy, 1e-6)
    solver = np.stack([np.stack([yy, -xy], 1), np.stack([-xy, xx], 1)], 1) * scale[:, None, None]
    spread = np.sqrt((values**2) @ _WEIGHT)
    return Patches(values, spread, slope_x * _WEIGHT, slope_y * _WEIGHT, solver)


def aligned(
    patches: Patches, image: Image, start: Floats, bent: Floats, rounds: int = ROUNDS
) -> tuple[Floats, Floats]:
    """Where the patches are in an image (n, 2), from `start` (n, 2), and how alike (n,) -1..1.

    bent : (n, 2, 2) d pixel here / d pixel there. Brightness may differ by a factor and a shift.
    rounds : steps of Gauss-Newton; how alike is told before the last.
    """
    if not len(start):
        return start, np.zeros(0)
    at = start.astype(np.float32)
    turn = bent.astype(np.float32)
    spread = turn @ _OFFSETS
    for left in reversed(range(rounds)):
        seen = _sampled(image, at, spread)
        length = np.maximum(np.sqrt((seen * seen) @ _WEIGHT), 1e-3)
        differs = seen * (patches.spread / length)[:, None]
        if not left:
            alike = ((differs * patches.values) @ _WEIGHT) / np.maximum(patches.spread, 1e-3) ** 2
        differs -= patches.values
        slopes = np.stack(
            [np.einsum("nk,nk->n", differs, slope) for slope in (patches.slope_x, patches.slope_y)],
            axis=1,
        )
        step = (patches.solver @ slopes[..., None])[..., 0]
        at = at - (turn @ np.clip(step, -2.0, 2.0)[..., None])[..., 0]
    return at.astype(np.float64), alike.astype(np.float64)


def _sampled(image: Image, at: Single, spread: Single) -> Single:
    import cv2

    u = at[:, :1] + spread[:, 0]
    v = at[:, 1:] + spread[:, 1]
    seen = np.asarray(
        cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
    seen -= (seen @ _WEIGHT)[:, None]
    return seen
