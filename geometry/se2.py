"""Rigid motions of the plane, SE(2), as arrays.

A pose is `[x, y, heading]` in its last axis: shape (3,) or (n, 3), float64, metres and radians.
`pose_a_b` is the pose of b in a, so `compose(pose_a_b, pose_b_c)` gives `pose_a_c`.
"""

from __future__ import annotations

import numpy as np

from geometry.angles import Floats, wrap


def compose(pose_a_b: Floats, pose_b_c: Floats) -> Floats:
    """`pose_a_c`, shape broadcast of both."""
    xy = transform_points(pose_a_b, pose_b_c[..., :2])
    heading = wrap(pose_a_b[..., 2] + pose_b_c[..., 2])
    return np.concatenate([xy, heading[..., None]], axis=-1)


def inverse(pose_a_b: Floats) -> Floats:
    """`pose_b_a`, same shape."""
    x, y, heading = pose_a_b[..., 0], pose_a_b[..., 1], pose_a_b[..., 2]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([-cos * x - sin * y, sin * x - cos * y, wrap(-heading)], axis=-1)


def between(pose_a_b: Floats, pose_a_c: Floats) -> Floats:
    """`pose_b_c`: where c stands as b sees it, same shape."""
    return compose(inverse(pose_a_b), pose_a_c)


def transform_points(pose_a_b: Floats, points_b: Floats) -> Floats:
    """Points (n, 2) given in b, expressed in a: under one pose (3,) or each its own (n, 3)."""
    x, y, heading = pose_a_b[..., 0], pose_a_b[..., 1], pose_a_b[..., 2]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack(
        [
            x + cos * points_b[..., 0] - sin * points_b[..., 1],
            y + sin * points_b[..., 0] + cos * points_b[..., 1],
        ],
        axis=-1,
    )


def rotate_covariance(heading: float, covariance: Floats) -> Floats:
    """`R C R^T` for 2x2 blocks, (n, 2, 2) or (2, 2): the same spread in a turned frame."""
    cos, sin = np.cos(heading), np.sin(heading)
    rotation = np.array([[cos, -sin], [sin, cos]])
    rotated: Floats = rotation @ covariance @ rotation.T
    return rotated
