"""Which observation belongs to which landmark.

Individual compatibility nearest neighbour: the gate of Neira and Tardos (IEEE T-RA 17, 2001) with
two thresholds and mutual exclusion. Between the thresholds lies a grey zone: with a single 95 %
threshold one correct sighting in twenty would spawn a duplicate.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import kernel
from slam.observation import innovation, jacobian, variances

NEW = -1
IGNORED = -2


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
    var_r, var_b = variances(range_m, noise)
    # Covariance of (landmark - car) and of the heading with it, from the lower half.
    xx = P[j, j] - 2.0 * P[j, 0] + P[0, 0]
    yy = P[j + 1, j + 1] - 2.0 * P[j + 1, 1] + P[1, 1]
    xy = P[j + 1, j] - P[j, 1] - P[j + 1, 0] + P[1, 0]
    xh, yh = P[j, 2] - P[2, 0], P[j + 1, 2] - P[2, 1]
    s_rr = a * a * xx + 2.0 * a * b * xy + b * b * yy + var_r
    s_rb = a * c * xx + (a * d + b * c) * xy + b * d * yy - a * xh - b * yh
    s_bb = c * c * xx + 2.0 * c * d * xy + d * d * yy - 2.0 * (c * xh + d * yh) + P[2, 2] + var_b
    weighted = s_bb * nu_r * nu_r - 2.0 * s_rb * nu_r * nu_b + s_rr * nu_b * nu_b
    distance: float = weighted / (s_rr * s_bb - s_rb * s_rb)
    return distance


@kernel
def squared_distances(
    x: Floats, P: Floats, n: int, range_m: Floats, bearing_rad: Floats, noise: Floats
) -> Floats:
    """(m, n): squared Mahalanobis distances of m observations from n landmarks."""
    distances = np.empty((range_m.size, n))
    for i in range(range_m.size):
        for slot in range(n):
            distances[i, slot] = squared_distance(x, P, slot, range_m[i], bearing_rad[i], noise)
    return distances


@kernel
def own_distances(
    x: Floats,
    P: Floats,
    slots: npt.NDArray[np.int64],
    range_m: Floats,
    bearing_rad: Floats,
    noise: Floats,
) -> Floats:
    """(m,): squared Mahalanobis distance of each observation from its landmark; 0 without one."""
    distances = np.zeros(slots.size)
    for i in range(slots.size):
        if slots[i] >= 0:
            distances[i] = squared_distance(x, P, slots[i], range_m[i], bearing_rad[i], noise)
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
    for i in range(m):
        if chosen[i] == NEW:
            for j in range(n):
                if distances[i, j] <= spawn_gate:
                    chosen[i] = IGNORED
                    break
    return chosen
