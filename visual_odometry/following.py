"""Points of a key frame found again: followed in a circle over both eyes, then brought to place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats
from visual_odometry.config import VoConfig
from visual_odometry.corners import BORDER_PX, coarse_disparity, corners
from visual_odometry.motion import Motion
from visual_odometry.patches import Patches, aligned, patches_at
from visual_odometry.rectification import Eyes, Image

Mask = npt.NDArray[np.bool_]
_WINDOW = (15, 15)
_LEVELS = 3
_FLOOR_BAND_M = 0.03
"""Points this near to the floor's height lie on it; the others on something upright."""


@dataclass(frozen=True, eq=False)
class EyePair:
    """A rectified pair of pictures."""

    left: Image
    right: Image


@dataclass(frozen=True, eq=False)
class KeyFrame:
    """A pair and its points: seen (n, 3) as (u left, v, u right), points (n, 3) metres.

    normals : (n, 3) of the surfaces that they lie on, towards or away from the eye.
    """

    pair: EyePair
    seen: Floats
    points: Floats
    normals: Floats
    patches: Patches

    def __len__(self) -> int:
        return len(self.seen)


def key_frame(
    pair: EyePair, eyes: Eyes, up: Floats, height_m: float, config: VoConfig
) -> KeyFrame:
    """The corners of a pair whose depth is known.

    up : (3,) of the car in the left eye's frame; height_m : of the eye above the floor.
    """
    at = corners(pair.left, config)
    disparity = coarse_disparity(pair.left, pair.right, at)
    known = disparity > config.least_disparity_px
    at, disparity = at[known], disparity[known]
    patches = patches_at(pair.left, at)
    coarse = np.column_stack([at, at[:, 0] - disparity])
    for _ in range(2):  # the bending needs the depth, which the bent patch then tells better
        points = eyes.points(coarse)
        normals = _normals(points, up, height_m)
        bent = _bending(eyes, points, normals, Motion.none(), right=True)
        start = np.column_stack([coarse[:, 2], at[:, 1]])
        found, alike = aligned(patches, pair.right, start, bent)
        coarse = np.column_stack([at, np.minimum(found[:, 0], at[:, 0] - 0.5)])
    good = alike > config.least_likeness
    good &= np.abs(found[:, 1] - at[:, 1]) < config.row_px
    good &= coarse[:, 0] - coarse[:, 2] > config.least_disparity_px
    good &= _inside(found, pair.right)
    return KeyFrame(pair, coarse[good], points[good], normals[good], patches.selected(good))


def followed(
    key: KeyFrame, pair: EyePair, eyes: Eyes, expected: Motion, config: VoConfig
) -> tuple[Floats, Mask]:
    """Where the points of a key frame are in a new pair, (u left, v, u right) (n, 3), and which.

    Left to left, left to right, right to the key frame's right, and so back to where the key frame
    saw it there: what does not close the circle is no match. expected : from the key frame.
    """
    there = expected.applied(key.points)
    ahead = there[:, 2] > 0.05
    guess = eyes.seen(np.where(ahead[:, None], there, key.points))
    start = key.seen[:, :2]
    left, good = _flow(key.pair.left, pair.left, start, guess[:, :2])
    beside = left - np.column_stack([guess[:, 0] - guess[:, 2], np.zeros(len(guess))])
    right, also = _flow(pair.left, pair.right, left, beside)
    back, closes = _flow(
        pair.right, key.pair.right, right, np.column_stack([key.seen[:, 2], start[:, 1]])
    )
    good &= also & closes & ahead
    miss = back - np.column_stack([key.seen[:, 2], start[:, 1]])
    # Looser than the circle's own limit where patches are bent, as only the last step is exact.
    good &= np.hypot(*miss.T) < config.closing_px + _BEND_PX * np.abs(
        1.0 - key.points[:, 2] / np.where(ahead, there[:, 2], 1.0)
    )
    good &= np.abs(left[:, 1] - right[:, 1]) < 2.0 * config.row_px
    good &= _inside(left, pair.left) & _inside(right, pair.right)
    return np.column_stack([left, right[:, 0]]), good


_BEND_PX = 4.0


def brought_to_place(
    key: KeyFrame, pair: EyePair, eyes: Eyes, seen: Floats, motion: Motion, config: VoConfig
) -> tuple[Floats, Mask]:
    """The same matches (n, 3) of all points of a key frame, exact, and which of them are alike.

    motion : from the key frame, as the coarse matches tell it.
    """
    places, likeness = [], []
    for image, column, right in ((pair.left, 0, False), (pair.right, 2, True)):
        bent = _bending(eyes, key.points, key.normals, motion, right=right)
        place, alike = aligned(key.patches, image, seen[:, [column, 1]], bent)
        places.append(place)
        likeness.append(alike)
    left, right_ = places
    good = np.minimum(*likeness) > config.least_likeness
    good &= np.abs(left[:, 1] - right_[:, 1]) < config.row_px
    good &= left[:, 0] - right_[:, 0] > config.least_disparity_px
    good &= _inside(left, pair.left) & _inside(right_, pair.right)
    return np.column_stack([left[:, 0], 0.5 * (left[:, 1] + right_[:, 1]), right_[:, 0]]), good


def _flow(source: Image, target: Image, start: Floats, guess: Floats) -> tuple[Floats, Mask]:
    import cv2

    if not len(start):
        return guess, np.zeros(0, bool)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 12, 0.05)
    points = np.ascontiguousarray(start, np.float32).reshape(-1, 1, 2)
    first = np.ascontiguousarray(guess, np.float32).reshape(-1, 1, 2)
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        source, target, points, first, winSize=_WINDOW, maxLevel=_LEVELS, criteria=stop,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    return np.asarray(found, np.float64).reshape(-1, 2), status.ravel() == 1


def _inside(at: Floats, image: Image) -> Mask:
    height, width = image.shape
    limit = np.array([width, height]) - BORDER_PX / 2.0
    inside: Mask = ((at > BORDER_PX / 2.0) & (at < limit)).all(axis=1)
    return inside


def _normals(points: Floats, up: Floats, height_m: float) -> Floats:
    """Of the floor where a point is on it, else of an upright surface that faces the eye."""
    above = points @ up + height_m
    on_floor = np.abs(above) < _FLOOR_BAND_M
    level = points - (points @ up)[:, None] * up
    facing = level / np.maximum(np.linalg.norm(level, axis=1), 1e-6)[:, None]
    return np.where(on_floor[:, None], up, facing)


def _bending(
    eyes: Eyes, points: Floats, normals: Floats, motion: Motion, *, right: bool
) -> Floats:
    """(n, 2, 2): d pixel in the new view's left or right eye / d pixel of the key frame's left.

    A pixel beside a point sees the plane through the point: Y = r (n.X) / (n.r) along its ray r.
    """
    z = points[:, 2:]
    rays = points / z
    slant = (normals * rays).sum(axis=1, keepdims=True)
    slant = np.where(np.abs(slant) < 0.02, np.copysign(0.02, slant), slant)
    beside = np.zeros((len(points), 3, 2))
    for axis in (0, 1):
        beside[:, :, axis] = -rays * (normals[:, axis : axis + 1] / slant)
        beside[:, axis, axis] += 1.0
    beside *= z[..., None]  # per focal length, which the projection multiplies with again
    there = motion.applied(points) - (eyes.baseline_m if right else 0.0) * np.array([1.0, 0, 0])
    moved = motion.rotation @ beside
    slopes = there[:, :2] / there[:, 2:]
    bent: Floats = (moved[:, :2] - slopes[..., None] * moved[:, 2:]) / there[:, 2, None, None]
    return bent
