"""The particles of FastSLAM: a pose and a map each, in contiguous arrays, and their resampling.

Landmarks of particle p are the first `landmarks[p]` entries of its rows. Nothing is shared between
particles: a copy writes whole rows, so what one particle learns no other can see.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import inlined, kernel, wrapped
from slam.motion import increment_covariance

Integers = npt.NDArray[np.int32]


class Cloud(NamedTuple):
    """N particles with room for K landmarks each.

    x, y, heading, log_weight : (N,); landmarks : (N,) how many are in use; landmark_x, landmark_y,
    evidence, seen, birth : (N, K); covariance : (N, K, 3), xx xy yy given the particle's path.
    seen counts sightings, birth is a row of the filter's table of births.
    """

    x: Floats
    y: Floats
    heading: Floats
    log_weight: Floats
    landmarks: Integers
    landmark_x: Floats
    landmark_y: Floats
    covariance: Floats
    evidence: Floats
    seen: Integers
    birth: Integers


def new_cloud(particles: int, capacity: int) -> Cloud:
    """All particles at the origin with the same weight and no landmark."""
    n, k = particles, capacity
    x, y, heading, log_weight = np.zeros((4, n))
    landmark_x, landmark_y, evidence = np.zeros((3, n, k))
    seen, birth = np.zeros((2, n, k), dtype=np.int32)
    return Cloud(
        x=x,
        y=y,
        heading=heading,
        log_weight=log_weight,
        landmarks=np.zeros(n, dtype=np.int32),
        landmark_x=landmark_x,
        landmark_y=landmark_y,
        covariance=np.zeros((n, k, 3)),
        evidence=evidence,
        seen=seen,
        birth=birth,
    )


def grown(cloud: Cloud, capacity: int) -> Cloud:
    """The same particles with room for `capacity` landmarks each."""
    larger = new_cloud(cloud.x.size, capacity)
    for before, after in zip(columns(cloud), columns(larger), strict=True):
        if before.ndim == 1:
            after[:] = before
        else:
            after[:, : before.shape[1]] = before
    return larger


def columns(cloud: Cloud) -> list[npt.NDArray[np.float64] | npt.NDArray[np.int32]]:
    """The arrays of the cloud in the order of its fields."""
    return [getattr(cloud, name) for name in Cloud._fields]


@kernel
def normalised_weights(log_weight: Floats) -> Floats:
    """Weights that sum to 1; `log_weight` is shifted so that its greatest is 0, in place.

    A particle without a number for a weight gets none; if no particle has any, all get the same.
    """
    greatest = -math.inf
    for p in range(log_weight.size):
        greatest = max(greatest, log_weight[p]) if log_weight[p] == log_weight[p] else greatest
    weights = np.empty(log_weight.size)
    total = 0.0
    for p in range(log_weight.size):
        log_weight[p] = log_weight[p] - greatest if greatest > -math.inf else 0.0
        if log_weight[p] != log_weight[p]:
            log_weight[p] = -math.inf
        weights[p] = math.exp(log_weight[p])
        total += weights[p]
    for p in range(weights.size):
        weights[p] /= total
    return weights


@kernel
def moments(cloud: Cloud, weights: Floats, near: Floats, pose: Floats, covariance: Floats) -> None:
    """Weighted mean `pose` (3,) and spread `covariance` (3, 3) of the cloud, written in place.

    near : (3,), a pose about where the mean will be. Headings are averaged as their turns from
    it, so that a cloud across +-180 degrees has its mean there.
    """
    sx, sy, sh, sxx, sxy, syy, sxh, syh, shh = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(weights.size):
        w = weights[p]
        x, y = cloud.x[p] - near[0], cloud.y[p] - near[1]
        h = wrapped(cloud.heading[p] - near[2])
        wx, wy, wh = w * x, w * y, w * h
        sx += wx
        sy += wy
        sh += wh
        sxx += wx * x
        sxy += wx * y
        syy += wy * y
        sxh += wx * h
        syh += wy * h
        shh += wh * h
    pose[0], pose[1], pose[2] = near[0] + sx, near[1] + sy, wrapped(near[2] + sh)
    covariance[0, 0] = max(sxx - sx * sx, 0.0)
    covariance[1, 1] = max(syy - sy * sy, 0.0)
    covariance[2, 2] = max(shh - sh * sh, 0.0)
    covariance[0, 1] = covariance[1, 0] = sxy - sx * sy
    covariance[0, 2] = covariance[2, 0] = sxh - sx * sh
    covariance[1, 2] = covariance[2, 1] = syh - sy * sh


@kernel
def move(
    cloud: Cloud,
    weights: Floats,
    increments: Floats,
    dt_s: Floats,
    noise: Floats,
    normals: Floats,
    near: Floats,
    poses: Floats,
    covariances: Floats,
) -> None:
    """Move every particle by increments (k, 3) over dt_s (k,) with noise of its own, in place.

    normals : (k, 3, N) standard normal draws; near : (3,) the mean before. Fills poses (k, 3) and
    covariances (k, 3, 3), mean and spread after each increment.
    """
    for k in range(increments.shape[0]):
        dx, dy, turn = increments[k, 0], increments[k, 1], increments[k, 2]
        a, ba, b, ca, cb, c = _root(increment_covariance(0.0, dx, dy, turn, dt_s[k], noise))
        for p in range(weights.size):
            n0, n1, n2 = normals[k, 0, p], normals[k, 1, p], normals[k, 2, p]
            ahead = dx + a * n0
            left = dy + ba * n0 + b * n1
            heading = cloud.heading[p]
            cos, sin = math.cos(heading), math.sin(heading)
            cloud.x[p] += cos * ahead - sin * left
            cloud.y[p] += sin * ahead + cos * left
            cloud.heading[p] = wrapped(heading + turn + ca * n0 + cb * n1 + c * n2)
        cos, sin = math.cos(near[2]), math.sin(near[2])
        near[0] += cos * dx - sin * dy
        near[1] += sin * dx + cos * dy
        near[2] += turn
        moments(cloud, weights, near, poses[k], covariances[k])
        for i in range(3):
            near[i] = poses[k, i]


@kernel
def _root(
    covariance: tuple[float, float, float, float, float, float],
) -> tuple[float, float, float, float, float, float]:
    """Lower Cholesky factor row by row of xx, xy, yy, xh, yh, hh; may be singular."""
    xx, xy, yy, xh, yh, hh = covariance
    a = math.sqrt(max(xx, 0.0))
    ba, ca = (xy / a, xh / a) if a > 0.0 else (0.0, 0.0)
    b = math.sqrt(max(yy - ba * ba, 0.0))
    cb = (yh - ca * ba) / b if b > 0.0 else 0.0
    return a, ba, b, ca, cb, math.sqrt(max(hh - ca * ca - cb * cb, 0.0))


@kernel
def offspring(weights: Floats, offset: float) -> npt.NDArray[np.int64]:
    """(N,): how often each particle is drawn by systematic resampling, offset in [0, 1).

    N w rounded up or down, N w on average over the offset: unbiased, of least variance.
    """
    n = weights.size
    copies = np.zeros(n, dtype=np.int64)
    total, drawn, last = 0.0, 0, 0
    for p in range(n):
        total += weights[p]
        upto = min(n, math.ceil(n * total - offset))
        if upto > drawn:
            copies[p] = upto - drawn
            drawn, last = upto, p
    copies[last] += n - drawn  # what rounding of the sum left over
    return copies


@kernel
def resample(cloud: Cloud, copies: npt.NDArray[np.int64]) -> None:
    """Give every particle `copies[p]` places and the same weight, in place.

    Survivors stay where they are; only the places of the dead are written.
    """
    n = copies.size
    dead = 0
    for p in range(n):
        cloud.log_weight[p] = 0.0
        for _ in range(copies[p] - 1):
            while copies[dead] > 0:
                dead += 1
            _copy(cloud, p, dead)
            dead += 1


@inlined
def copy_landmark(cloud: Cloud, source: int, j: int, target: int, k: int) -> None:
    """Put landmark j of one particle, with everything known of it, in place k of another."""
    cloud.landmark_x[target, k] = cloud.landmark_x[source, j]
    cloud.landmark_y[target, k] = cloud.landmark_y[source, j]
    cloud.covariance[target, k, 0] = cloud.covariance[source, j, 0]
    cloud.covariance[target, k, 1] = cloud.covariance[source, j, 1]
    cloud.covariance[target, k, 2] = cloud.covariance[source, j, 2]
    cloud.evidence[target, k] = cloud.evidence[source, j]
    cloud.seen[target, k] = cloud.seen[source, j]
    cloud.birth[target, k] = cloud.birth[source, j]


@kernel
def _copy(cloud: Cloud, source: int, target: int) -> None:
    cloud.x[target], cloud.y[target] = cloud.x[source], cloud.y[source]
    cloud.heading[target] = cloud.heading[source]
    cloud.landmarks[target] = cloud.landmarks[source]
    for j in range(cloud.landmarks[source]):
        copy_landmark(cloud, source, j, target, j)
