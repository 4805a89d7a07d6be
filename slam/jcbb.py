"""Joint compatibility branch and bound: the pairing of a whole scan that agrees with itself.

Neira and Tardos, IEEE T-RA 17 (2001): among all pairings whose joint innovation is plausible, the
one with most pairs, and of those the one of least joint distance. The Cholesky factor of the joint
innovation covariance grows by two rows per pair, so that going one branch deeper costs O(k^2).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.association import NEW, mark_grey
from slam.kernels import kernel
from slam.observation import innovation, jacobian, variances

Slots = npt.NDArray[np.int64]


@kernel
def joint_gates(probability: float, most: int) -> Floats:
    """(most + 1,): chi-square quantiles for 0, 2, 4, ... 2 * most degrees of freedom.

    With 2k degrees the tail is exp(-h) (1 + h + ... + h^(k-1) / (k-1)!) at h = x / 2.
    """
    gates = np.zeros(most + 1)
    for k in range(1, most + 1):
        low, high = 0.5 * gates[k - 1], k + 40.0 + 10.0 * math.sqrt(k)
        for _ in range(60):
            h = 0.5 * (low + high)
            term = math.exp(-h)
            tail = term
            for i in range(1, k):
                term *= h / i
                tail += term
            if tail > 1.0 - probability:
                low = h
            else:
                high = h
        gates[k] = 2.0 * high
    return gates


@kernel
def candidate_pairs(distances: Floats, accept_gate: float) -> tuple[Slots, Slots, Slots]:
    """The observations that have candidates, fewest first; their first pair; slots of the pairs.

    Shapes (k,), (k + 1,), (p,). The pairs of one observation stand closest first.
    """
    m, n = distances.shape
    count = np.zeros(m, dtype=np.int64)
    for i in range(m):
        for j in range(n):
            count[i] += distances[i, j] <= accept_gate
    order = np.argsort(count, kind="mergesort")
    order = order[count[order] > 0]
    first = np.zeros(order.size + 1, dtype=np.int64)
    slots = np.empty(count.sum(), dtype=np.int64)
    for position in range(order.size):
        i, end = order[position], first[position]
        for j in range(n):
            if distances[i, j] <= accept_gate:
                at = end
                while at > first[position] and distances[i, slots[at - 1]] > distances[i, j]:
                    slots[at] = slots[at - 1]
                    at -= 1
                slots[at] = j
                end += 1
        first[position + 1] = end
    return order, first, slots


@kernel
def linearised_pairs(
    x: Floats, order: Slots, first: Slots, slots: Slots, range_m: Floats, bearing_rad: Floats,
    noise: Floats,
) -> Floats:  # fmt: skip
    """(p, 8) of each pair: innovation, landmark Jacobian row by row, variances."""
    pairs = np.empty((slots.size, 8))
    for position in range(order.size):
        i = order[position]
        for pair in range(first[position], first[position + 1]):
            row, j = pairs[pair], 3 + 2 * slots[pair]
            row[0], row[1], expected_m, dx, dy = innovation(
                x, x[j], x[j + 1], range_m[i], bearing_rad[i]
            )
            row[2], row[3], row[4], row[5] = jacobian(expected_m, dx, dy)
            row[6], row[7] = variances(range_m[i], noise)
    return pairs


@kernel
def cross_covariance(
    P: Floats, j: int, k: int, one: Floats, other: Floats
) -> tuple[float, float, float, float]:
    """H_j P H_k^T of landmarks at columns j >= k, row by row; one, other : their pairs."""
    a, b, c, d = one[2], one[3], one[4], one[5]
    e, f, g, h = other[2], other[3], other[4], other[5]
    xy_upper = P[j, k + 1] if j > k else P[j + 1, k]
    xx = P[j, k] - P[j, 0] - P[k, 0] + P[0, 0]
    xy = xy_upper - P[j, 1] - P[k + 1, 0] + P[1, 0]
    yx = P[j + 1, k] - P[j + 1, 0] - P[k, 1] + P[1, 0]
    yy = P[j + 1, k + 1] - P[j + 1, 1] - P[k + 1, 1] + P[1, 1]
    j_xh, j_yh = P[j, 2] - P[2, 0], P[j + 1, 2] - P[2, 1]
    k_xh, k_yh = P[k, 2] - P[2, 0], P[k + 1, 2] - P[2, 1]
    to_range_x, to_range_y = xx * e + xy * f, yx * e + yy * f
    to_bearing_x, to_bearing_y = xx * g + xy * h, yx * g + yy * h
    return (
        a * to_range_x + b * to_range_y,
        a * to_bearing_x + b * to_bearing_y - a * j_xh - b * j_yh,
        c * to_range_x + d * to_range_y - e * k_xh - f * k_yh,
        c * to_bearing_x + d * to_bearing_y - c * j_xh - d * j_yh - g * k_xh - h * k_yh + P[2, 2],
    )


@kernel
def joint_rows(
    P: Floats, pairs: Floats, slots: Slots, taken: Slots, k: int, pair: int, upper: Floats,
    lower: Floats,
) -> None:  # fmt: skip
    """Fill the two rows of H P H^T of one pair with the k pairs in `taken` and with itself."""
    new, j = pairs[pair], 3 + 2 * slots[pair]
    for q in range(k + 1):
        old = taken[q] if q < k else pair
        at = 3 + 2 * slots[old]
        if at <= j:
            rr, rb, br, bb = cross_covariance(P, j, at, new, pairs[old])
        else:
            rr, br, rb, bb = cross_covariance(P, at, j, pairs[old], new)
        upper[2 * q], upper[2 * q + 1] = rr, rb
        lower[2 * q], lower[2 * q + 1] = br, bb


@kernel
def extended(
    P: Floats, factor: Floats, whitened: Floats, pairs: Floats, slots: Slots, taken: Slots, k: int,
    pair: int,
) -> float:  # fmt: skip
    """How much the joint distance grows with one more pair; infinite where S is not positive.

    factor, whitened : L of S = L L^T and L^-1 nu of the k pairs in `taken`; two rows are added.
    """
    rows, new = 2 * k, pairs[pair]
    upper, lower = factor[rows], factor[rows + 1]
    joint_rows(P, pairs, slots, taken, k, pair, upper, lower)
    s_rr, s_br, s_bb = upper[rows] + new[6], lower[rows], lower[rows + 1] + new[7]
    nu_r, nu_b = new[0], new[1]
    for column in range(rows):
        row = factor[column]
        for i in range(column):
            upper[column] -= upper[i] * row[i]
            lower[column] -= lower[i] * row[i]
        upper[column] /= row[column]
        lower[column] /= row[column]
        nu_r -= upper[column] * whitened[column]
        nu_b -= lower[column] * whitened[column]
        s_rr -= upper[column] * upper[column]
        s_br -= upper[column] * lower[column]
        s_bb -= lower[column] * lower[column]
    if not s_rr > 0.0:
        return math.inf
    upper[rows] = math.sqrt(s_rr)
    lower[rows] = s_br / upper[rows]
    s_bb -= lower[rows] * lower[rows]
    if not s_bb > 0.0:
        return math.inf
    lower[rows + 1] = math.sqrt(s_bb)
    whitened[rows] = nu_r / upper[rows]
    whitened[rows + 1] = (nu_b - lower[rows] * whitened[rows]) / lower[rows + 1]
    growth: float = whitened[rows] ** 2 + whitened[rows + 1] ** 2
    return growth


@kernel
def search(
    P: Floats, pairs: Floats, slots: Slots, first: Slots, gates: Floats, most_nodes: int
) -> tuple[Slots, bool]:
    """The pair taken by each observation, or -1; and whether the search was cut short.

    Depth first, the closest landmark before the others, no landmark last. A branch ends where it
    cannot win any more: the joint distance only grows.
    """
    depths = first.size - 1
    factor, whitened = np.empty((2 * depths, 2 * depths)), np.empty(2 * depths)
    taken, at_depth = np.empty(depths, dtype=np.int64), np.full(depths, -1, dtype=np.int64)
    following, distance = first.copy(), np.zeros(depths + 1)
    best, best_k, best_distance = at_depth.copy(), 0, math.inf
    depth, k, nodes = 0, 0, 0
    while depth >= 0:
        if (k, -distance[k]) > (best_k, -best_distance):
            best, best_k, best_distance = at_depth.copy(), k, distance[k]
        hopeless = (k + depths - depth, -distance[k]) <= (best_k, -best_distance)
        if hopeless or depth == depths or following[depth] > first[depth + 1]:
            depth -= 1
            if depth >= 0 and at_depth[depth] >= 0:
                at_depth[depth] = -1
                k -= 1
            continue
        pair, following[depth] = following[depth], following[depth] + 1
        if pair < first[depth + 1]:
            if nodes == most_nodes:
                return best, True
            if is_taken(slots, taken, k, slots[pair]):
                continue
            nodes += 1
            growth = extended(P, factor, whitened, pairs, slots, taken, k, pair)
            if not distance[k] + growth <= gates[k + 1]:
                continue
            distance[k + 1] = distance[k] + growth
            taken[k], at_depth[depth] = pair, pair
            k += 1
        depth += 1
        following[depth] = first[depth]
    return best, False


@kernel
def is_taken(slots: Slots, taken: Slots, k: int, slot: int) -> bool:
    """Whether one of the k pairs in `taken` has the landmark already."""
    for q in range(k):  # noqa: SIM110  # numba knows no generators
        if slots[taken[q]] == slot:
            return True
    return False


@kernel
def joint_compatible(
    x: Floats, P: Floats, distances: Floats, range_m: Floats, bearing_rad: Floats, noise: Floats,
    accept_gate: float, spawn_gate: float, gates: Floats, most_nodes: int,
) -> tuple[Slots, bool]:  # fmt: skip
    """(m,): the landmark of each observation, or `NEW`, or `IGNORED`; whether it was cut short.

    distances : (m, n) individual ones; gates : `joint_gates` for at least m pairs. What is left
    without a landmark is new or ignored by the same rule as with the nearest neighbour.
    """
    order, first, slots = candidate_pairs(distances, accept_gate)
    pairs = linearised_pairs(x, order, first, slots, range_m, bearing_rad, noise)
    best, cut_short = search(P, pairs, slots, first, gates, most_nodes)
    chosen = np.full(range_m.size, NEW, dtype=np.int64)
    for position in range(order.size):
        if best[position] >= 0:
            chosen[order[position]] = slots[best[position]]
    mark_grey(chosen, distances, spawn_gate)
    return chosen, cut_short
