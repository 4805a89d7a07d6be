"""Rigid alignment of points, without scale, in the plane or in space."""

from __future__ import annotations

import numpy as np

from geometry.angles import Floats
from geometry.errors import AlignmentError
from geometry.se2 import compose, inverse


def umeyama(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Rotation (d, d) and translation (d,) that bring `source` (n, d) closest to `target` (n, d).

    Least squares of `target - (R source + t)`, never scale, never mirror.
    Umeyama, "Least-squares estimation of transformation parameters between two point patterns",
    IEEE PAMI 13 (1991), Eq. 34-41 with c = 1. Raises `AlignmentError` when the points are too few
    or lie so that a rotation about them is free (coincident; in space also on one line).
    """
    if source.shape != target.shape or source.ndim != 2:
        raise AlignmentError(f"points of shape {source.shape} against {target.shape}")
    mean_source, mean_target = source.mean(axis=0), target.mean(axis=0)
    covariance = (target - mean_target).T @ (source - mean_source) / source.shape[0]
    u, singular, vt = np.linalg.svd(covariance)
    dimension = source.shape[1]
    spread = float(np.abs(source - mean_source).max() * np.abs(target - mean_target).max())
    rank = int(np.sum(singular > 1e-12 * max(spread, 1e-12)))
    if rank < dimension - 1:
        raise AlignmentError(
            f"{source.shape[0]} points do not fix a rotation in {dimension} dimensions "
            "(they coincide or lie on one line); use --align origin or none"
        )
    sign = np.ones(dimension)
    sign[-1] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = u @ np.diag(sign) @ vt
    return rotation, mean_target - rotation @ mean_source


def planar_umeyama(source: Floats, target: Floats) -> Floats:
    """The pose (3,) of the source frame in the target frame, from points (n, 2) of both."""
    rotation, translation = umeyama(source, target)
    heading = np.arctan2(rotation[1, 0], rotation[0, 0])
    return np.array([translation[0], translation[1], heading])


def alignment_from_first_pose(source: Floats, target: Floats) -> Floats:
    """The pose (3,) of the source frame in the target frame that makes two poses (3,) one."""
    return compose(target, inverse(source))
