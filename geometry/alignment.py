"""Rigid alignment of points, without scale, in the plane or in space."""

from __future__ import annotations

import math

import numpy as np

from geometry.angles import Floats, wrap
from geometry.errors import AlignmentError
from geometry.se2 import compose, inverse


def umeyama(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Rotation (d, d) and translation (d,) that bring `source` (n, d) closest to `target` (n, d).

    Least squares of `target - (R source + t)`, never scale, never mirror.
    Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
    IEEE PAMI 13 (1991), Eq. 34-41 with c = 1. Raises `AlignmentError` when the points are too few
    or lie so that a rotation about them is free (coincident; in space also on one line; mirror
    images of a shape that is as wide as long).
    """
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] not in (2, 3):
        raise AlignmentError(
            f"points of shape {source.shape} against {target.shape}, expected (n, 2) or (n, 3)"
        )
    if not source.size:
        raise AlignmentError("no points to align; use --align origin or none")
    mean_source, mean_target = source.mean(axis=0), target.mean(axis=0)
    covariance = (target - mean_target).T @ (source - mean_source) / source.shape[0]
    u, singular, vt = np.linalg.svd(covariance)
    sign = np.ones(source.shape[1])
    sign[-1] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    # Turning in the plane of the two least singular directions costs in proportion to this sum.
    hold = singular[-2] + sign[-1] * singular[-1]
    if hold <= _rounding(source, target, float(singular[0])):
        raise AlignmentError(
            f"{source.shape[0]} points do not fix a rotation in {source.shape[1]} dimensions (they "
            "coincide, lie on one line or mirror each other); use --align origin or none"
        )
    rotation = (u * sign) @ vt
    return rotation, mean_target - rotation @ mean_source


def _rounding(source: Floats, target: Floats, largest: float) -> float:
    """How large a singular value that is zero may come out: below, it means nothing.

    Sums of n products round by sqrt(n) of their size, means of n coordinates by n of theirs.
    """
    n, eps = len(source), float(np.finfo(np.float64).eps)
    coordinates = n * eps * float(np.abs(source).max()) * n * eps * float(np.abs(target).max())
    return 4.0 * math.sqrt(n) * eps * largest + coordinates


def planar_umeyama(source: Floats, target: Floats) -> Floats:
    """The pose (3,) of the source frame in the target frame, from points (n, 2) of both."""
    rotation, translation = umeyama(source, target)
    heading = wrap(np.arctan2(rotation[1, 0], rotation[0, 0]))
    return np.array([translation[0], translation[1], heading])


def alignment_from_first_pose(source: Floats, target: Floats) -> Floats:
    """The pose (3,) of the source frame in the target frame that makes two poses (3,) one."""
    return compose(target, inverse(source))
