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
_WINDOW = (13, 13)
_LEVELS = 3
_FOLLOWED = 160
"""Points that are followed over the pyramids; the others' places follow from the motion."""
_NEAREST_M = 0.05
_OTHER_EXPOSURE = 1.15
"""Ratio of median brightness from which on it is not only another view."""
_FLOOR_BAND_M = 0.03
"""Points this near to the floor's height lie on it; the others on something upright."""


@dataclass(frozen=True, eq=False)
class EyePair:
    """A rectified pair of pictures, and the same at half the size."""

    left: Image
    right: Image
    half_left: Image
    half_right: Image

    @classmethod
    def of(cls, left: Image, right: Image) -> EyePair:
        """The pair of two eyes."""
        import cv2

        halves = [
            np.asarray(cv2.resize(e, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
            for e in (left, right)
        ]
        return cls(left, right, *halves)

    def halves_exposed_as(self, other: EyePair) -> tuple[Image, Image]:
        """Both halves, brought to the brightness of another pair where that is another.

        Following compares grey levels themselves, and automatic exposure changes them.
        """
        import cv2

        own, theirs = (float(np.median(one.half_left[::4, ::4])) for one in (self, other))
        gain = max(theirs, 1.0) / max(own, 1.0)
        if 1.0 / _OTHER_EXPOSURE < gain < _OTHER_EXPOSURE:
            return self.half_left, self.half_right
        left, right = (
            np.asarray(cv2.convertScaleAbs(half, alpha=gain), np.uint8)
            for half in (self.half_left, self.half_right)
        )
        return left, right


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


def key_frame(pair: EyePair, eyes: Eyes, up: Floats, height_m: float, config: VoConfig) -> KeyFrame:
    """The corners of a pair whose depth is known.

    up : (3,) of the car in the left eye's frame; height_m : of the eye above the floor.
    """
    at = corners(pair.left, config)
    disparity = coarse_disparity(pair.half_left, pair.half_right, at)
    known = disparity > config.least_disparity_px
    at, disparity = at[known], disparity[known]
    patches = patches_at(pair.left, at)
    coarse = np.column_stack([at, at[:, 0] - disparity])
    for rounds in (2, 3):  # the bending needs the depth, which the bent patch then tells better
        points = eyes.points(coarse)
        normals = _normals(points, up, height_m)
        bent = _bending(eyes, points, normals, Motion.none(), right=True)
        start = np.column_stack([coarse[:, 2], at[:, 1]])
        found, alike = aligned(patches, pair.right, start, bent, rounds)
        coarse = np.column_stack([at, np.minimum(found[:, 0], at[:, 0] - 0.5)])
    good = alike > config.least_likeness
    good &= np.abs(found[:, 1] - at[:, 1]) < config.row_px
    good &= coarse[:, 0] - coarse[:, 2] > config.least_disparity_px
    good &= _inside(found, pair.right)
    return KeyFrame(pair, coarse[good], points[good], normals[good], patches.selected(good))


def followed(
    key: KeyFrame, pair: EyePair, eyes: Eyes, expected: Motion, config: VoConfig
) -> tuple[Mask, Floats]:
    """Which points (n,) of a key frame are found in a new pair, and where (k, 3), to half a pixel.

    Left to left, left to right, right to the key frame's right, and so back to where the key frame
    saw it there: what does not close the circle is no match. At half the size, with as many points
    as a motion needs; `brought_to_place` then finds all of them. expected : from the key frame.
    """
    there = expected.applied(key.points)
    guess = eyes.seen(np.where(there[:, 2:] > _NEAREST_M, there, key.points))
    rows = np.flatnonzero((there[:, 2] > _NEAREST_M) & _inside(guess[:, :2], pair.left))
    rows = rows[:: max(1, -(-rows.size // _FOLLOWED))]
    guess, before = guess[rows], key.seen[rows]
    target = before[:, [2, 1]]
    new_left, new_right = pair.halves_exposed_as(key.pair)
    left, good = _flow(key.pair.half_left, new_left, before[:, :2], guess[:, :2])
    beside = np.column_stack([left[:, 0] + guess[:, 2] - guess[:, 0], left[:, 1]])
    right, also = _flow(new_left, new_right, left, beside)
    back, closes = _flow(new_right, key.pair.half_right, right, target)
    good &= also & closes & (np.hypot(*(back - target).T) < config.closing_px)
    good &= np.abs(left[:, 1] - right[:, 1]) < 2.0 * config.row_px
    good &= _inside(left, pair.left) & _inside(right, pair.right)
    found = np.zeros(len(key), bool)
    found[rows[good]] = True
    return found, np.column_stack([left, right[:, 0]])[good]


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
    """Points followed between pictures of half the size; places are those of the full one."""
    import cv2

    if not len(start):
        return guess, np.zeros(0, bool)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 12, 0.03)
    points, first = (
        np.ascontiguousarray((at - 0.5) / 2.0, np.float32).reshape(-1, 1, 2)
        for at in (start, guess)
    )
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        source, target, points, first, winSize=_WINDOW, maxLevel=_LEVELS, criteria=stop,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    return 2.0 * np.asarray(found, np.float64).reshape(-1, 2) + 0.5, status.ravel() == 1


def _inside(at: Floats, image: Image) -> Mask:
    height, width = image.shape
    limit = np.array([width, height]) - BORDER_PX / 2.0
    return np.asarray(((at > BORDER_PX / 2.0) & (at < limit)).all(axis=1))


def _normals(points: Floats, up: Floats, height_m: float) -> Floats:
    """Of the floor where a point is on it, else of an upright surface that faces the eye."""
    above = points @ up + height_m
    on_floor = np.abs(above) < _FLOOR_BAND_M
    level = points - (points @ up)[:, None] * up
    facing = level / np.maximum(np.linalg.norm(level, axis=1), 1e-6)[:, None]
    return np.where(on_floor[:, None], up, facing)


def _bending(eyes: Eyes, points: Floats, normals: Floats, motion: Motion, *, right: bool) -> Floats:
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
