"""Which observation belongs to which landmark.

Individual compatibility nearest neighbour: the gate of Neira and Tardos (IEEE T-RA 17, 2001) with
two thresholds and mutual exclusion. Between the thresholds lies a grey zone: with a single 95 %
threshold one correct sighting in twenty would spawn a duplicate.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import kernel, wrapped
from slam.observation import expected, innovation, jacobian, variances

NEW = -1
IGNORED = -2
INVALID = -3
OVER_LIMIT = -4

MAX_RANGE_M = 1e6
MAX_BEARING_RAD = 1e6
"""Beyond these no sensor measures, and their squares and wraps lose all digits."""


@kernel
def usable(range_m: float, bearing_rad: float) -> bool:
    """Whether an observation is one: finite, and its range above zero."""
    return 0.0 < range_m < MAX_RANGE_M and abs(bearing_rad) < MAX_BEARING_RAD


@kernel
def projected(
    P: Floats, j: int, a: float, b: float, c: float, d: float
) -> tuple[float, float, float]:
    """H P H^T of the landmark at column j: range-range, range-bearing, bearing-bearing."""
    # Covariance of (landmark - car) and of the heading with it, from the lower half.
    xx = P[j, j] - 2.0 * P[j, 0] + P[0, 0]
    yy = P[j + 1, j + 1] - 2.0 * P[j + 1, 1] + P[1, 1]
    xy = P[j + 1, j] - P[j, 1] - P[j + 1, 0] + P[1, 0]
    xh, yh = P[j, 2] - P[2, 0], P[j + 1, 2] - P[2, 1]
    return (
        a * a * xx + 2.0 * a * b * xy + b * b * yy,
        a * c * xx + (a * d + b * c) * xy + b * d * yy - a * xh - b * yh,
        c * c * xx + 2.0 * c * d * xy + d * d * yy - 2.0 * (c * xh + d * yh) + P[2, 2],
    )


@kernel
def squared_norm(nu_r: float, nu_b: float, s_rr: float, s_rb: float, s_bb: float) -> float:
    """nu^T S^-1 nu of a 2-vector."""
    weighted = s_bb * nu_r * nu_r - 2.0 * s_rb * nu_r * nu_b + s_rr * nu_b * nu_b
    norm: float = weighted / (s_rr * s_bb - s_rb * s_rb)
    return norm


@kernel
def squared_distance(
    x: Floats, P: Floats, slot: int, range_m: float, bearing_rad: float, noise: Floats
) -> float:
    """Squared Mahalanobis distance of one observation from one landmark of the state.

    x : (3 + 2n,), P : its covariance, lower half authoritative; noise : `observation.noise_array`.
    """
    j = 3 + 2 * slot
    nu_r, nu_b, expected_m, dx, dy = innovation(x, x[j], x[j + 1], range_m, bearing_rad)
    a, b, c, d = jacobian(expected_m, dx, dy)
    s_rr, s_rb, s_bb = projected(P, j, a, b, c, d)
    var_r, var_b = variances(range_m, noise)
    return squared_norm(nu_r, nu_b, s_rr + var_r, s_rb, s_bb + var_b)


@kernel
def expectations(x: Floats, P: Floats, n: int) -> Floats:
    """(n, 5): range and bearing at which each landmark is due, and H P H^T as rr, rb, bb."""
    due = np.empty((n, 5))
    for slot in range(n):
        j = 3 + 2 * slot
        due[slot, 0], due[slot, 1], dx, dy = expected(x, x[j], x[j + 1])
        a, b, c, d = jacobian(due[slot, 0], dx, dy)
        due[slot, 2], due[slot, 3], due[slot, 4] = projected(P, j, a, b, c, d)
    return due


@kernel
def squared_distances(due: Floats, range_m: Floats, bearing_rad: Floats, noise: Floats) -> Floats:
    """(m, n): squared Mahalanobis distances of m observations from n landmarks.

    due : from `expectations`. An observation that is not `usable` is NaN away from everything.
    """
    distances = np.full((range_m.size, due.shape[0]), np.nan)
    for i in range(range_m.size):
        if not usable(range_m[i], bearing_rad[i]):
            continue
        var_r, var_b = variances(range_m[i], noise)
        for slot in range(due.shape[0]):
            nu_r, nu_b = range_m[i] - due[slot, 0], wrapped(bearing_rad[i] - due[slot, 1])
            distances[i, slot] = squared_norm(
                nu_r, nu_b, due[slot, 2] + var_r, due[slot, 3], due[slot, 4] + var_b
            )
    return distances


@kernel
def nearest_compatible(
    distances: Floats, accept_gate: float, spawn_gate: float
) -> npt.NDArray[np.int64]:
    """(m,): the landmark of each observation, or `NEW`, or `IGNORED`.

    distances : (m, n). The closest pair is taken first and both leave the contest. An observation
    whose landmark went to a better one is ignored, not new, while any landmark is within the
    spawn gate: it saw something that is in the map already.
    """
    m, n = distances.shape
    chosen = np.full(m, NEW, dtype=np.int64)
    taken = np.zeros(n, dtype=np.bool_)
    for _ in range(min(m, n)):
        best, best_i, best_j = accept_gate, -1, -1
        for i in range(m):
            if chosen[i] != NEW:
                continue
            for j in range(n):
                if not taken[j] and distances[i, j] <= best:
                    best, best_i, best_j = distances[i, j], i, j
        if best_i < 0:
            break
        chosen[best_i] = best_j
        taken[best_j] = True
    mark_grey(chosen, distances, spawn_gate)
    return chosen


@kernel
def mark_grey(chosen: npt.NDArray[np.int64], distances: Floats, spawn_gate: float) -> None:
    """Turn `NEW` into `IGNORED`, in place, where any landmark is within the spawn gate."""
    for i in range(chosen.size):
        if chosen[i] == NEW:
            for j in range(distances.shape[1]):
                if distances[i, j] <= spawn_gate:
                    chosen[i] = IGNORED
                    break
