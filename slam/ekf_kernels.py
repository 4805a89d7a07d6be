"""The inner loops of EKF-SLAM on one preallocated state.

State x = (car x, y, heading, landmark 0 x, y, landmark 1 x, y, ...); of its covariance P only the
lower half (row >= column) is kept: half the memory traffic, and symmetric by construction.
Thrun, Burgard, Fox 2005, table 10.1, with three corrections that matter: new landmarks get their
full cross-covariance, all observations of a scan are one batch, and additions follow the batch.
"""

from __future__ import annotations

import math

import numpy as np

from geometry import Floats
from slam.association import IGNORED, INVALID, NEW, OVER_LIMIT, squared_distance, usable
from slam.kernels import kernel, wrapped
from slam.landmarks import Records, Slots, begin
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
def symmetric_columns(P: Floats, columns: Slots, dimension: int) -> Floats:
    """Columns of the whole symmetric matrix, from its lower half, as rows of (k, dimension)."""
    out = np.empty((columns.size, dimension))
    for c in range(columns.size):
        row, taken = P[columns[c]], out[c]
        for i in range(columns[c]):
            taken[i] = row[i]
    # Row by row: down one column after the other every element would be a miss of the cache.
    for i in range(dimension):
        row = P[i]
        for c in range(columns.size):
            if columns[c] <= i:
                out[c, i] = row[columns[c]]
    return out


@kernel
def seen_columns(P: Floats, dimension: int, slots: Slots) -> Floats:
    """Columns of car and seen landmarks as rows: x, y, heading, then x, y of each of `slots`."""
    columns = np.empty(3 + 2 * slots.size, dtype=np.int64)
    for i in range(3):
        columns[i] = i
    for i in range(slots.size):
        columns[3 + 2 * i], columns[4 + 2 * i] = 3 + 2 * slots[i], 4 + 2 * slots[i]
    return symmetric_columns(P, columns, dimension)


@kernel
def linearise(
    x: Floats,
    P: Floats,
    dimension: int,
    slots: Slots,
    range_m: Floats,
    bearing_rad: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Innovation (2m,), landmark Jacobian (2m, 2) and H P of m observations.

    H P has 2m rows and, up to a multiple of four, rows of zeros.
    """
    m = slots.size
    nu, H = np.empty(2 * m), np.empty((2 * m, 2))
    HP = np.empty((4 * ((m + 1) // 2), dimension))
    taken = seen_columns(P, dimension, slots)
    for i in range(m):
        j = 3 + 2 * slots[i]
        nu[2 * i], nu[2 * i + 1], expected_m, dx, dy = innovation(
            x, x[j], x[j + 1], range_m[i], bearing_rad[i]
        )
        a, b, c, d = jacobian(expected_m, dx, dy)
        H[2 * i, 0], H[2 * i, 1], H[2 * i + 1, 0], H[2 * i + 1, 1] = a, b, c, d
        to_x, to_y = taken[3 + 2 * i], taken[4 + 2 * i]
        for k in range(dimension):
            x_offset, y_offset = to_x[k] - taken[0, k], to_y[k] - taken[1, k]
            HP[2 * i, k] = a * x_offset + b * y_offset
            HP[2 * i + 1, k] = c * x_offset + d * y_offset - taken[2, k]
    for k in range(2 * m, HP.shape[0]):
        for i in range(dimension):
            HP[k, i] = 0.0
    return nu, H, HP


@kernel
def innovation_covariance(
    H: Floats,
    HP: Floats,
    slots: Slots,
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
    """P -= W^T W on the lower half, W (4k, dimension).

    Four rows of P by four of W: sixteen products for each four loads. The blocks on the diagonal
    spill into the upper half, which nobody reads.
    """
    rows, dimension = W.shape
    blocks = dimension - dimension % 4
    for i in range(0, blocks, 4):
        p0, p1, p2, p3 = P[i], P[i + 1], P[i + 2], P[i + 3]
        for k in range(0, rows, 4):
            w0, w1, w2, w3 = W[k], W[k + 1], W[k + 2], W[k + 3]
            a0, a1, a2, a3 = w0[i], w1[i], w2[i], w3[i]
            b0, b1, b2, b3 = w0[i + 1], w1[i + 1], w2[i + 1], w3[i + 1]
            c0, c1, c2, c3 = w0[i + 2], w1[i + 2], w2[i + 2], w3[i + 2]
            d0, d1, d2, d3 = w0[i + 3], w1[i + 3], w2[i + 3], w3[i + 3]
            for j in range(i + 4):
                v0, v1, v2, v3 = w0[j], w1[j], w2[j], w3[j]
                p0[j] -= a0 * v0 + a1 * v1 + a2 * v2 + a3 * v3
                p1[j] -= b0 * v0 + b1 * v1 + b2 * v2 + b3 * v3
                p2[j] -= c0 * v0 + c1 * v1 + c2 * v2 + c3 * v3
                p3[j] -= d0 * v0 + d1 * v1 + d2 * v2 + d3 * v3
    for i in range(blocks, dimension):
        row = P[i]
        for k in range(0, rows, 4):
            w0, w1, w2, w3 = W[k], W[k + 1], W[k + 2], W[k + 3]
            f0, f1, f2, f3 = w0[i], w1[i], w2[i], w3[i]
            for j in range(i + 1):
                row[j] -= f0 * w0[j] + f1 * w1[j] + f2 * w2[j] + f3 * w3[j]


@kernel
def correct(x: Floats, P: Floats, W: Floats, nu: Floats) -> None:
    """Move the state by the whitened innovation and take W^T W off P, in place; see `whiten`."""
    for k in range(nu.size):
        row, factor = W[k], nu[k]
        for i in range(W.shape[1]):
            x[i] += row[i] * factor
    x[2] = wrapped(x[2])
    subtract_outer(P, W)


@kernel
def update(
    x: Floats, P: Floats, dimension: int, slots: Slots, range_m: Floats, bearing_rad: Floats,
    noise: Floats, inflation: Floats,
) -> bool:  # fmt: skip
    """Take the observations (m,) of the landmarks in `slots` as one batch, in place.

    False (and x, P untouched) when the innovation covariance is not positive definite.
    """
    if slots.size == 0:
        return True
    nu, H, W = linearise(x, P, dimension, slots, range_m, bearing_rad)
    S = innovation_covariance(H, W, slots, range_m, noise, inflation)
    if not whiten(S, W, nu):
        return False
    correct(x, P, W, nu)
    return True


@kernel
def absorb(
    x: Floats, P: Floats, records: Records, n: int, slots: Slots, landmark_id: Slots,
    range_m: Floats, bearing_rad: Floats, t_ns: int, noise: Floats, limits: Floats, next_id: int,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    """Take one scan, in place: a batch of the matched, then the new; counts of what happened.

    Gives matched (-1: not positive definite), added, rejected, invalid, over_limit. `slots` becomes
    what each observation went to. New ones are called by their id, or from `next_id` on if that
    is above zero. limits : innovation_gate, tail_gate, relocate_after, max_landmarks.
    """
    matched, rejected, invalid = 0, 0, 0
    used, against = np.empty(slots.size, dtype=np.int64), np.empty(slots.size, dtype=np.int64)
    inflation = np.empty(slots.size)
    for i in range(slots.size):
        if not usable(range_m[i], bearing_rad[i]):
            slots[i] = INVALID
            invalid += 1
        elif slots[i] >= 0:
            distance = squared_distance(x, P, slots[i], range_m[i], bearing_rad[i], noise)
            if distance > limits[0]:
                records[slots[i]].rejected_in_a_row += 1
                against[rejected] = i
                rejected += 1
            else:
                records[slots[i]].rejected_in_a_row = 0
                records[slots[i]].n_seen += 1
                used[matched], inflation[matched] = i, max(distance / limits[1], 1.0)
                matched += 1
    used = used[:matched]
    if not update(
        x, P, 3 + 2 * n, slots[used], range_m[used], bearing_rad[used], noise, inflation[:matched]
    ):
        return -1, 0, 0, 0, 0
    added, over_limit = spawn(
        x, P, records, n, slots, landmark_id, range_m, bearing_rad, t_ns, noise, limits, next_id
    )
    relocate(x, P, records, n + added, slots, against[:rejected], range_m, bearing_rad, t_ns,
             noise, limits[2])  # fmt: skip
    return matched, added, rejected, invalid, over_limit


@kernel
def relocate(
    x: Floats, P: Floats, records: Records, n: int, slots: Slots, against: Slots, range_m: Floats,
    bearing_rad: Floats, t_ns: int, noise: Floats, after: float,
) -> None:  # fmt: skip
    """Enter landmarks anew that were contradicted too often in a row: they are off, not we."""
    for i in against:
        if 0.0 < after <= records[slots[i]].rejected_in_a_row:
            name = records[slots[i]].landmark_id
            enter(x, P, records, 3 + 2 * n, slots[i], name, range_m[i], bearing_rad[i], t_ns,
                  noise)  # fmt: skip
        slots[i] = IGNORED


@kernel
def absorb_named(
    x: Floats, P: Floats, records: Records, n: int, landmark_id: Slots, range_m: Floats,
    bearing_rad: Floats, t_ns: int, noise: Floats, limits: Floats,
) -> tuple[int, int, int, int, int]:  # fmt: skip
    """`absorb` where the sensor names its landmarks. No id, or one seen twice: ignored."""
    slots = named_slots(records, n, landmark_id)
    return absorb(
        x, P, records, n, slots, landmark_id, range_m, bearing_rad, t_ns, noise, limits, 0
    )


@kernel
def named_slots(records: Records, n: int, landmark_id: Slots) -> Slots:
    """(m,): the landmark of each id, or `NEW`, or `IGNORED` (no id, or one seen twice)."""
    slots = np.full(landmark_id.size, NEW, dtype=np.int64)
    for i in range(slots.size):
        name = landmark_id[i]
        if name < 0:
            slots[i] = IGNORED
        for earlier in range(i):
            if landmark_id[earlier] == name:
                slots[i] = IGNORED
        if slots[i] == NEW:
            for slot in range(n):
                if records[slot].landmark_id == name:
                    slots[i] = slot
                    break
    return slots


@kernel
def spawn(
    x: Floats, P: Floats, records: Records, n: int, slots: Slots, landmark_id: Slots,
    range_m: Floats, bearing_rad: Floats, t_ns: int, noise: Floats, limits: Floats, next_id: int,
) -> tuple[int, int]:  # fmt: skip
    """Enter the new landmarks while the map has room; how many were, and how many were not."""
    added, over_limit = 0, 0
    for i in range(slots.size):
        if slots[i] != NEW:
            continue
        if n + added >= limits[3]:
            slots[i] = OVER_LIMIT
            over_limit += 1
            continue
        slots[i] = n + added
        name = next_id + added if next_id > 0 else landmark_id[i]
        added += 1
        enter(x, P, records, 3 + 2 * (n + added), slots[i], name, range_m[i], bearing_rad[i],
              t_ns, noise)  # fmt: skip
    return added, over_limit


@kernel
def enter(
    x: Floats, P: Floats, records: Records, dimension: int, slot: int, name: int, range_m: float,
    bearing_rad: float, t_ns: int, noise: Floats,
) -> None:  # fmt: skip
    """Begin the landmark of a slot with the one observation that sees it now."""
    begin(records[slot], name, range_m, t_ns, x)
    place_landmark(x, P, dimension, slot, range_m, bearing_rad, noise)


@kernel
def remove(x: Floats, P: Floats, records: Records, n: int, slot: int) -> None:
    """Give up the landmark of a slot, in place: the last one moves there with all that it has."""
    last, j, end = n - 1, 3 + 2 * slot, 1 + 2 * n
    if slot == last:
        return
    records[slot] = records[last]
    for axis in range(2):
        row = P[end + axis]
        x[j + axis] = x[end + axis]
        for k in range(j):
            P[j + axis, k] = row[k]
        for k in range(j + 2, end):
            P[k, j + axis] = row[k]
        for k in range(axis + 1):
            P[j + axis, j + k] = row[end + k]


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
