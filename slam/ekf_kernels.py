"""The inner loops of EKF-SLAM on one preallocated state.

State x = (car x, y, heading, landmark 0 x, y, landmark 1 x, y, ...); of its covariance P only the
lower half (row >= column) is kept: half the memory traffic, and symmetric by construction.
Thrun, Burgard, Fox 2005, table 10.1, with three corrections that matter: new landmarks get their
full cross-covariance, all observations of a scan are one batch, and additions follow the batch.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import kernel, wrapped
from slam.motion import propagate
from slam.observation import innovation, jacobian, variances


@kernel
def predict(
    x: Floats, P: Floats, dimension: int, increments: Floats, dt_s: Floats, noise: Floats
) -> tuple[Floats, Floats]:
    """Move the car, in place; gives poses (k, 3) and pose covariances (k, 3, 3) on the way."""
    steps = increments.shape[0]
    poses, covariances = np.empty((steps, 3)), np.empty((steps, 3, 3))
    covariance = pose_covariance(P)
    fx, fy = propagate(x[:3], covariance, increments, dt_s, noise, poses, covariances)
    for i in range(3):
        for j in range(i + 1):
            P[i, j] = covariance[i, j]
    # The landmarks stand still: their cross-covariance turns with the car once for all steps.
    for i in range(3, dimension):
        P[i, 0] += fx * P[i, 2]
        P[i, 1] += fy * P[i, 2]
    return poses, covariances


@kernel
def pose_covariance(P: Floats) -> Floats:
    """(3, 3), both halves filled."""
    covariance = np.empty((3, 3))
    for i in range(3):
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = P[i, j]
    return covariance


@kernel
def symmetric_column(P: Floats, column: int, dimension: int, out: Floats) -> None:
    """Column `column` of the whole symmetric matrix, from its lower half."""
    row = P[column]
    for i in range(column):
        out[i] = row[i]
    for i in range(column, dimension):
        out[i] = P[i, column]


@kernel
def linearise(
    x: Floats,
    P: Floats,
    dimension: int,
    slots: npt.NDArray[np.int64],
    range_m: Floats,
    bearing_rad: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Innovation (2m,), landmark Jacobian (2m, 2) and H P (2m, dimension) of m observations."""
    m = slots.size
    nu, H = np.empty(2 * m), np.empty((2 * m, 2))
    HP = np.empty((2 * m, dimension))
    pose_columns = np.empty((3, dimension))
    landmark_columns = np.empty((2, dimension))
    for c in range(3):
        symmetric_column(P, c, dimension, pose_columns[c])
    for i in range(m):
        j = 3 + 2 * slots[i]
        nu[2 * i], nu[2 * i + 1], expected_m, dx, dy = innovation(
            x, x[j], x[j + 1], range_m[i], bearing_rad[i]
        )
        H[2 * i, 0], H[2 * i, 1], H[2 * i + 1, 0], H[2 * i + 1, 1] = jacobian(expected_m, dx, dy)
        symmetric_column(P, j, dimension, landmark_columns[0])
        symmetric_column(P, j + 1, dimension, landmark_columns[1])
        a, b, c, d = H[2 * i, 0], H[2 * i, 1], H[2 * i + 1, 0], H[2 * i + 1, 1]
        for k in range(dimension):
            x_offset = landmark_columns[0, k] - pose_columns[0, k]
            y_offset = landmark_columns[1, k] - pose_columns[1, k]
            HP[2 * i, k] = a * x_offset + b * y_offset
            HP[2 * i + 1, k] = c * x_offset + d * y_offset - pose_columns[2, k]
    return nu, H, HP


@kernel
def innovation_covariance(
    H: Floats,
    HP: Floats,
    slots: npt.NDArray[np.int64],
    range_m: Floats,
    noise: Floats,
    inflation: Floats,
) -> Floats:
    """S = H P H^T + R, (2m, 2m), lower half; R of observation i times `inflation[i]`."""
    rows = H.shape[0]
    S = np.zeros((rows, rows))
    for k in range(rows):
        column = 3 + 2 * slots[k // 2]
        for i in range(k, rows):
            row = HP[i]
            S[i, k] = H[k, 0] * (row[column] - row[0]) + H[k, 1] * (row[column + 1] - row[1])
            if k % 2 == 1:
                S[i, k] -= row[2]
    for i in range(slots.size):
        var_r, var_b = variances(range_m[i], noise)
        S[2 * i, 2 * i] += var_r * inflation[i]
        S[2 * i + 1, 2 * i + 1] += var_b * inflation[i]
    return S


@kernel
def whiten(S: Floats, HP: Floats, nu: Floats) -> bool:
    """Cholesky S = L L^T, then HP <- L^-1 HP and nu <- L^-1 nu, in place; False if not positive."""
    rows = S.shape[0]
    for k in range(rows):
        for j in range(k):
            factor = S[k, j]
            for i in range(k, rows):
                S[i, k] -= S[i, j] * factor
        if not S[k, k] > 0.0:
            return False
        scale = 1.0 / math.sqrt(S[k, k])
        for i in range(k, rows):
            S[i, k] *= scale
        for j in range(k):
            factor = S[k, j]
            nu[k] -= factor * nu[j]
            for i in range(HP.shape[1]):
                HP[k, i] -= factor * HP[j, i]
        nu[k] *= scale
        for i in range(HP.shape[1]):
            HP[k, i] *= scale
    return True


@kernel
def subtract_outer(P: Floats, W: Floats) -> None:
    """P -= W^T W on the lower half, W (2m, dimension); four rows of W in one pass over P."""
    rows, dimension = W.shape
    for i in range(dimension):
        row = P[i]
        for k in range(0, rows - 3, 4):
            w0, w1, w2, w3 = W[k], W[k + 1], W[k + 2], W[k + 3]
            f0, f1, f2, f3 = w0[i], w1[i], w2[i], w3[i]
            for j in range(i + 1):
                row[j] -= f0 * w0[j] + f1 * w1[j] + f2 * w2[j] + f3 * w3[j]
        for k in range(rows - rows % 4, rows):
            w0 = W[k]
            f0 = w0[i]
            for j in range(i + 1):
                row[j] -= f0 * w0[j]


@kernel
def update(
    x: Floats,
    P: Floats,
    dimension: int,
    slots: npt.NDArray[np.int64],
    range_m: Floats,
    bearing_rad: Floats,
    noise: Floats,
    inflation: Floats,
) -> bool:
    """Take the observations of landmarks in `slots` as one batch, in place.

    All are (m,); a negative slot is passed over. False (and x, P untouched) when the innovation
    covariance is not positive definite.
    """
    used = np.flatnonzero(slots >= 0)
    if used.size == 0:
        return True
    slots, range_m, bearing_rad = slots[used], range_m[used], bearing_rad[used]
    nu, H, W = linearise(x, P, dimension, slots, range_m, bearing_rad)
    S = innovation_covariance(H, W, slots, range_m, noise, inflation[used])
    if not whiten(S, W, nu):
        return False
    for k in range(nu.size):
        for i in range(dimension):
            x[i] += W[k, i] * nu[k]
    x[2] = wrapped(x[2])
    subtract_outer(P, W)
    return True


@kernel
def place_landmark(
    x: Floats,
    P: Floats,
    dimension: int,
    slot: int,
    range_m: float,
    bearing_rad: float,
    noise: Floats,
) -> None:
    """Put the landmark of `slot` where an observation sees it, with its full cross-covariance.

    P_new,* = Gx P_x,* and P_new,new = Gx P_xx Gx^T + Gz R Gz^T. `dimension` covers the slot; what
    the slot held before is forgotten.
    """
    j = 3 + 2 * slot
    direction = x[2] + bearing_rad
    cos, sin = math.cos(direction), math.sin(direction)
    east, north = range_m * cos, range_m * sin
    x[j], x[j + 1] = x[0] + east, x[1] + north
    pose = pose_covariance(P)
    var_r, var_b = variances(range_m, noise)
    for k in range(dimension):
        if k == j or k == j + 1:
            continue
        if k < 3:
            p0, p1, p2 = pose[0, k], pose[1, k], pose[2, k]
        else:
            p0, p1, p2 = P[k, 0], P[k, 1], P[k, 2]
        to_x, to_y = p0 - north * p2, p1 + east * p2
        if k < j:
            P[j, k], P[j + 1, k] = to_x, to_y
        else:
            P[k, j], P[k, j + 1] = to_x, to_y
    across = range_m * range_m * var_b
    hh = pose[2, 2]
    P[j, j] = pose[0, 0] - 2.0 * north * pose[0, 2] + north * north * hh
    P[j, j] += cos * cos * var_r + sin * sin * across
    P[j + 1, j] = pose[0, 1] + east * pose[0, 2] - north * pose[1, 2] - north * east * hh
    P[j + 1, j] += sin * cos * (var_r - across)
    P[j + 1, j + 1] = pose[1, 1] + 2.0 * east * pose[1, 2] + east * east * hh
    P[j + 1, j + 1] += sin * sin * var_r + cos * cos * across
