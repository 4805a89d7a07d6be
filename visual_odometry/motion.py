"""How the camera moved between two views of the same points, and how well that is known.

A point's three pixel coordinates in the key frame are as uncertain as those in the new view. Their
errors are carried through triangulation into the residual, whose covariance weighs it: near points
tell the way, far ones the turn, without a choice by hand (Maimone, Cheng, Matthies, Two Years of
Visual Odometry on the Mars Exploration Rovers, 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, turned
from visual_odometry.rectification import Eyes

Mask = npt.NDArray[np.bool_]
_ROUNDS = 8
_STILL = 1e-6
_CAUCHY = 2.5
"""Of a residual's length in its standard deviations, where it begins to count less."""
_OUTLIER = 5.0
_SHRUNK = 0.83
"""Mean square of a normal's residual under those weights, by integration."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What carries points of the key frame into the new view: rotation @ X + translation."""

    rotation: Floats
    translation: Floats

    @classmethod
    def none(cls) -> Motion:
        """No motion."""
        return cls(np.eye(3), np.zeros(3))

    def applied(self, points: Floats) -> Floats:
        """Points (n, 3) in the new view's frame."""
        carried: Floats = points @ self.rotation.T + self.translation
        return carried

    def stepped(self, step: Floats) -> Motion:
        """Moved further by (translation, turn) (6,), both in the new view's frame."""
        turn = turned(step[3:])
        return Motion(turn @ self.rotation, turn @ self.translation + step[:3])


@dataclass(frozen=True, eq=False)
class MotionFit:
    """A motion, its covariance (6, 6) as of `Motion.stepped`, and which points (n,) agree.

    sigma_px : of a matched point, by the residuals.
    """

    motion: Motion
    covariance: Floats
    inliers: Mask
    sigma_px: float


def coarse_motion(
    points: Floats, seen: Floats, eyes: Eyes, expected: Motion, ransac_px: float
) -> tuple[Motion, Mask] | None:
    """The motion that most points (n, 3) agree with as the left eye sees them; None if none does.

    P3P in RANSAC (Ke and Roumeliotis, 2017), then Levenberg-Marquardt over those that agree.
    """
    import cv2

    if len(points) < 6:
        return None
    pixels = np.ascontiguousarray(seen[:, :2])
    near = np.asarray(cv2.Rodrigues(expected.rotation)[0], np.float64)
    found, turn, move, rows = cv2.solvePnPRansac(
        np.ascontiguousarray(points), pixels, eyes.matrix, None, near,
        expected.translation.reshape(3, 1).copy(), iterationsCount=200, confidence=0.999,
        reprojectionError=ransac_px, flags=cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    if not found or rows is None or len(rows) < 6:
        return None
    inliers = np.zeros(len(points), bool)
    inliers[np.asarray(rows).ravel()] = True
    turn, move = cv2.solvePnPRefineLM(
        points[inliers], pixels[inliers], eyes.matrix, None, turn, move
    )
    rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
    motion = Motion(rotation, np.asarray(move, np.float64).ravel())
    return motion, inliers


def fitted_motion(
    before: Floats, after: Floats, eyes: Eyes, start: Motion, sigma_px: float
) -> MotionFit:
    """The motion under which (u left, v, u right) (n, 3) before and after agree best.

    Gauss-Newton on whitened residuals with Cauchy's weights; the covariance is the inverse of
    J^T J, times the variance that the residuals show.
    """
    points = eyes.points(before)
    motion, count = start, len(before)
    # Once: the start is so near that neither slopes nor spread change by what could be noticed.
    root, slopes = _whitening(points, _point_slopes(before, points, eyes), eyes, motion)
    jacobian = _solved(root, slopes @ _moving(motion.applied(points))) / sigma_px
    rows = jacobian.reshape(3 * count, 6)
    for _ in range(_ROUNDS):
        missed = after - eyes.seen(motion.applied(points))
        residuals = _solved(root, missed[..., None])[..., 0] / sigma_px
        length = np.sqrt((residuals**2).sum(axis=1))
        scale = max(1.0, float(np.median(length)) / 1.54)  # the median length of a normal's three
        weights = 1.0 / (1.0 + (length / (_CAUCHY * scale)) ** 2)
        weights[length > _OUTLIER * scale] = 0.0
        weighed = rows * np.repeat(weights, 3)[:, None]
        information = weighed.T @ rows + 1e-12 * np.eye(6)
        step = np.linalg.solve(information, weighed.T @ residuals.ravel())
        motion = motion.stepped(step)
        if np.abs(step).max() < _STILL:
            break
    inliers = weights > 0.0
    freedom = max(3.0 * float(weights.sum()) - 6.0, 1.0)
    variance = float((weights * length**2).sum()) / freedom
    variance /= _SHRUNK
    covariance = np.linalg.pinv(information, hermitian=True) * variance
    return MotionFit(motion, covariance, inliers, sigma_px * float(np.sqrt(variance)))


def _point_slopes(seen: Floats, points: Floats, eyes: Eyes) -> Floats:
    """(n, 3, 3): d point / d (u left, v, u right)."""
    disparity = (seen[:, 0] - seen[:, 2])[:, None]
    scale = eyes.baseline_m / disparity[:, 0]
    slopes = np.zeros((len(seen), 3, 3))
    slopes[:, :, 0] = -points / disparity
    slopes[:, :, 2] = points / disparity
    slopes[:, 0, 0] += scale
    slopes[:, 1, 1] = scale
    return slopes


def _whitening(points: Floats, spread: Floats, eyes: Eyes, motion: Motion) -> tuple[Floats, Floats]:
    """Cholesky factors (n, 3, 3) of the residuals' covariance, and d seen / d point (n, 3, 3)."""
    x, y, z = motion.applied(points).T
    slopes = np.zeros((len(points), 3, 3))
    slopes[:, [0, 1, 2], [0, 1, 0]] = 1.0
    slopes[:, 0, 2], slopes[:, 1, 2] = -x / z, -y / z
    slopes[:, 2, 2] = -(x - eyes.baseline_m) / z
    slopes *= (eyes.focal_px / z)[:, None, None]
    carried = slopes @ motion.rotation @ spread
    covariance = carried @ carried.transpose(0, 2, 1) + np.eye(3)
    return np.asarray(np.linalg.cholesky(covariance), np.float64), slopes


def _moving(there: Floats) -> Floats:
    """(n, 3, 6): d point / d (translation, turn) of `Motion.stepped`."""
    x, y, z = there.T
    moving = np.zeros((len(there), 3, 6))
    moving[:, [0, 1, 2], [0, 1, 2]] = 1.0
    moving[:, 0, 4], moving[:, 0, 5] = z, -y
    moving[:, 1, 3], moving[:, 1, 5] = -z, x
    moving[:, 2, 3], moving[:, 2, 4] = y, -x
    return moving


def _solved(root: Floats, right: Floats) -> Floats:
    """Of lower triangular systems (n, 3, 3), (n, 3, m), by substitution."""
    first = right[:, 0] / root[:, 0, 0, None]
    second = (right[:, 1] - root[:, 1, 0, None] * first) / root[:, 1, 1, None]
    third = right[:, 2] - root[:, 2, 0, None] * first - root[:, 2, 1, None] * second
    return np.stack([first, second, third / root[:, 2, 2, None]], axis=1)
