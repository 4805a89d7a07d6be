"""The inner loops of the smoother: normal equations, block elimination of the pose chain.

Unknowns are K + 1 poses, of which the first stays where it is, and n landmarks. Odometry ties a
pose only to its neighbours, so the pose part T of the normal equations is block tridiagonal;
`slam.smoothing.chain` eliminates it. Landmarks see each other only through poses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import kernel, wrapped
from slam.motion import propagate
from slam.observation import innovation, jacobian

Ints = npt.NDArray[np.int64]

NO_LOSS, HUBER, CAUCHY = 0, 1, 2


class Factors(NamedTuple):
    """What is known: motions between K + 1 poses and m observations, in the order of time.

    motion : (K, 3), the pose k + 1 in the pose k; motion_information : (K, 3, 3);
    node, slot : (m,), pose and landmark of each observation; range_m, bearing_rad : (m,);
    information : (m, 2), of range and bearing; loss, loss_scale : see `robust`.
    """

    motion: Floats
    motion_information: Floats
    node: Ints
    slot: Ints
    range_m: Floats
    bearing_rad: Floats
    information: Floats
    loss: int
    loss_scale: float


class Normal(NamedTuple):
    """The normal equations of a linearisation: information matrix and right sides.

    diagonal : (K + 1, 3, 3), and below : (K + 1, 3, 3), block (k, k - 1), of T; pose_right :
    (K + 1, 3); mixed : (m, 3, 2), per observation the block of its pose against its landmark;
    landmark : (n, 2, 2); landmark_right : (n, 2).
    """

    diagonal: Floats
    below: Floats
    pose_right: Floats
    mixed: Floats
    landmark: Floats
    landmark_right: Floats


@kernel
def chain_motions(
    increments: Floats, dt_s: Floats, node_step: Ints, noise: Floats
) -> tuple[Floats, Floats]:
    """Motion (K, 3) from each node to the next, in its frame, and its covariance (K, 3, 3).

    increments (s, 3) over dt_s (s,) lie between s + 1 times; node k stands at time node_step[k].
    """
    count = node_step.size - 1
    motions, covariances = np.zeros((count, 3)), np.zeros((count, 3, 3))
    poses, on_the_way = np.zeros((dt_s.size, 3)), np.zeros((dt_s.size, 3, 3))
    for k in range(count):
        a, b = node_step[k], node_step[k + 1]
        propagate(
            motions[k], covariances[k], increments[a:b], dt_s[a:b], noise, poses[a:b],
            on_the_way[a:b],
        )  # fmt: skip
    return motions, covariances


@kernel
def robust(squared: float, loss: int, scale: float) -> tuple[float, float]:
    """Loss of a squared whitened residual and its derivative, the weight of that residual.

    Huber (1964): quadratic up to `scale` sigmas, linear beyond; Cauchy: logarithmic beyond.
    """
    limit = scale * scale
    if loss == HUBER and squared > limit:
        size = math.sqrt(squared)
        return 2.0 * scale * size - limit, scale / size
    if loss == CAUCHY:
        return limit * math.log1p(squared / limit), 1.0 / (1.0 + squared / limit)
    return squared, 1.0


@kernel
def motion_residual(
    before: Floats, after: Floats, motion: Floats
) -> tuple[float, float, float, float, float]:
    """Found minus measured motion (3,), wrapped, then where `after` stands as `before` sees it."""
    cos, sin = math.cos(before[2]), math.sin(before[2])
    dx, dy = after[0] - before[0], after[1] - before[1]
    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
    turn = wrapped(after[2] - before[2] - motion[2])
    return ahead - motion[0], left - motion[1], turn, ahead, left


@kernel
def cost(poses: Floats, landmarks: Floats, factors: Factors) -> float:
    """Sum of the losses: what the smoother makes small."""
    total = 0.0
    for k in range(factors.motion.shape[0]):
        e0, e1, e2, _, _ = motion_residual(poses[k], poses[k + 1], factors.motion[k])
        W = factors.motion_information[k]
        total += e0 * (W[0, 0] * e0 + 2.0 * (W[0, 1] * e1 + W[0, 2] * e2))
        total += e1 * (W[1, 1] * e1 + 2.0 * W[1, 2] * e2) + W[2, 2] * e2 * e2
    for i in range(factors.node.size):
        pose, landmark = poses[factors.node[i]], landmarks[factors.slot[i]]
        er, eb, _, _, _ = innovation(
            pose, landmark[0], landmark[1], factors.range_m[i], factors.bearing_rad[i]
        )
        squared = factors.information[i, 0] * er * er + factors.information[i, 1] * eb * eb
        total += robust(squared, factors.loss, factors.loss_scale)[0]
    return total


@kernel
def add_motions(poses: Floats, factors: Factors, normal: Normal) -> None:
    """Put the motions into the normal equations."""
    H, weighted, e = np.zeros((3, 6)), np.zeros((3, 6)), np.zeros(3)
    H[0, 3] = H[1, 4] = H[2, 5] = 1.0
    for k in range(factors.motion.shape[0]):
        e[0], e[1], e[2], ahead, left = motion_residual(poses[k], poses[k + 1], factors.motion[k])
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        H[0, 0], H[0, 1], H[0, 2], H[0, 3], H[0, 4] = -cos, -sin, left, cos, sin
        H[1, 0], H[1, 1], H[1, 2], H[1, 3], H[1, 4] = sin, -cos, -ahead, -sin, cos
        H[2, 2] = -1.0
        W = factors.motion_information[k]
        for r in range(3):
            for c in range(6):
                weighted[r, c] = W[r, 0] * H[0, c] + W[r, 1] * H[1, c] + W[r, 2] * H[2, c]
        for c in range(3):
            for r in range(3):
                for s in range(3):
                    normal.diagonal[k, r, c] += H[s, r] * weighted[s, c]
                    normal.diagonal[k + 1, r, c] += H[s, 3 + r] * weighted[s, 3 + c]
                    normal.below[k + 1, r, c] += H[s, 3 + r] * weighted[s, c]
                normal.pose_right[k, c] -= weighted[r, c] * e[r]
                normal.pose_right[k + 1, c] -= weighted[r, 3 + c] * e[r]


@kernel
def add_sights(poses: Floats, landmarks: Floats, factors: Factors, normal: Normal) -> None:
    """Put the observations into the normal equations, each with the weight its loss gives."""
    H = np.zeros((2, 5))
    for i in range(factors.node.size):
        k, slot = factors.node[i], factors.slot[i]
        er, eb, expected_m, dx, dy = innovation(
            poses[k], landmarks[slot, 0], landmarks[slot, 1], factors.range_m[i],
            factors.bearing_rad[i],
        )  # fmt: skip
        H[0, 3], H[0, 4], H[1, 3], H[1, 4] = jacobian(expected_m, dx, dy)
        H[0, 0], H[0, 1], H[1, 0], H[1, 1] = -H[0, 3], -H[0, 4], -H[1, 3], -H[1, 4]
        H[1, 2] = -1.0
        wr, wb = factors.information[i, 0], factors.information[i, 1]
        weight = robust(wr * er * er + wb * eb * eb, factors.loss, factors.loss_scale)[1]
        wr, wb = weight * wr, weight * wb
        for c in range(3):
            normal.pose_right[k, c] += H[0, c] * wr * er + H[1, c] * wb * eb
            for r in range(3):
                normal.diagonal[k, r, c] += H[0, r] * wr * H[0, c] + H[1, r] * wb * H[1, c]
        for c in range(2):
            hr, hb = wr * H[0, 3 + c], wb * H[1, 3 + c]
            normal.landmark_right[slot, c] += hr * er + hb * eb
            for r in range(3):
                normal.mixed[i, r, c] = H[0, r] * hr + H[1, r] * hb
            for r in range(2):
                normal.landmark[slot, r, c] += H[0, 3 + r] * hr + H[1, 3 + r] * hb


@kernel
def hold_first_pose(factors: Factors, normal: Normal) -> None:
    """Take the first pose out of the equations: it defines the frame."""
    for r in range(3):
        normal.pose_right[0, r] = 0.0
        for c in range(3):
            normal.diagonal[0, r, c] = 1.0 if r == c else 0.0
            if normal.below.shape[0] > 1:
                normal.below[1, r, c] = 0.0
    for i in range(factors.node.size):
        if factors.node[i] > 0:
            break
        for r in range(3):
            for c in range(2):
                normal.mixed[i, r, c] = 0.0


@kernel
def linearise(poses: Floats, landmarks: Floats, factors: Factors) -> Normal:
    """The normal equations at poses (K + 1, 3) and landmarks (n, 2)."""
    nodes, n = poses.shape[0], landmarks.shape[0]
    normal = Normal(
        np.zeros((nodes, 3, 3)),
        np.zeros((nodes, 3, 3)),
        np.zeros((nodes, 3)),
        np.zeros((factors.node.size, 3, 2)),
        np.zeros((n, 2, 2)),
        np.zeros((n, 2)),
    )
    add_motions(poses, factors, normal)
    add_sights(poses, landmarks, factors, normal)
    hold_first_pose(factors, normal)
    return normal
