"""The inner loops of a Gaussian filter that is told how to linearise (`slam.gaussian.sights`).

State, covariance and records are those of `slam.ekf_kernels`: only the lower half of P counts.
"""

from __future__ import annotations

import numpy as np

from geometry import Floats
from slam.association import IGNORED, INVALID, NEW, OVER_LIMIT, squared_norm, usable
from slam.ekf_kernels import correct, seen_columns, whiten
from slam.kernels import kernel, wrapped
from slam.landmarks import Records, Slots, begin
from slam.observation import variances


@kernel
def carry(P: Floats, dimension: int, fx: float, fy: float) -> None:
    """Let the error of the heading move the car's place: x by fx, y by fy of it, in place."""
    hx, hy, hh = P[2, 0], P[2, 1], P[2, 2]
    P[0, 0] += 2.0 * fx * hx + fx * fx * hh
    P[1, 0] += fx * hy + fy * hx + fx * fy * hh
    P[1, 1] += 2.0 * fy * hy + fy * fy * hh
    for i in range(2, dimension):
        P[i, 0] += fx * P[i, 2]
        P[i, 1] += fy * P[i, 2]


@kernel
def retell(P: Floats, dimension: int, x: Floats, before: Floats) -> None:
    """Tell all errors anew after an update has moved the state from `before` to x, in place.

    Turning car and map together by the error of the heading moves each place by that times its
    offset from the origin, turned by 90 degrees; the offsets have changed.
    """
    shift = np.zeros(dimension)
    for i in range(dimension):
        if i < 2 or i > 2:
            first = i if i < 2 else i - 3
            other = i + 1 if first % 2 == 0 else i - 1
            sign = -1.0 if first % 2 == 0 else 1.0
            shift[i] = sign * (x[other] - before[other])
    to_heading = np.empty(dimension)
    for i in range(dimension):
        to_heading[i] = P[i, 2] if i >= 2 else P[2, i]
    for i in range(dimension):
        row, own = P[i], shift[i]
        factor = to_heading[i] + own * to_heading[2]
        for j in range(i + 1):
            row[j] += own * to_heading[j] + factor * shift[j]


@kernel
def seen_rows(P: Floats, dimension: int, slots: Slots, sights: Floats) -> Floats:
    """H P of the sights of m landmarks: 2m rows and, up to a multiple of four, rows of zeros."""
    m = slots.size
    HP = np.zeros((4 * ((m + 1) // 2), dimension))
    taken = seen_columns(P, dimension, slots)
    for i in range(m):
        s = sights[slots[i]]
        a, b, c, d, turn_r, turn_b = s[2], s[3], s[4], s[5], s[9], s[10]
        to_x, to_y = taken[3 + 2 * i], taken[4 + 2 * i]
        for k in range(dimension):
            x_offset, y_offset = to_x[k] - taken[0, k], to_y[k] - taken[1, k]
            HP[2 * i, k] = a * x_offset + b * y_offset + turn_r * taken[2, k]
            HP[2 * i + 1, k] = c * x_offset + d * y_offset + turn_b * taken[2, k]
    return HP


@kernel
def innovation_covariance(
    HP: Floats, slots: Slots, sights: Floats, range_m: Floats, noise: Floats, inflation: Floats
) -> Floats:
    """H P H^T, the excess, and R of observation i times `inflation[i]`: (2m, 2m), lower half."""
    rows = 2 * slots.size
    S = np.zeros((rows, rows))
    for i in range(slots.size):
        s, column = sights[slots[i]], 3 + 2 * slots[i]
        for k in range(2 * i, rows):
            row = HP[k]
            x_offset, y_offset = row[column] - row[0], row[column + 1] - row[1]
            S[k, 2 * i] = s[2] * x_offset + s[3] * y_offset + s[9] * row[2]
            S[k, 2 * i + 1] = s[4] * x_offset + s[5] * y_offset + s[10] * row[2]
        var_r, var_b = variances(range_m[i], noise)
        S[2 * i, 2 * i] += var_r * inflation[i] + s[6]
        S[2 * i + 1, 2 * i] += s[7]
        S[2 * i + 1, 2 * i + 1] += var_b * inflation[i] + s[8]
    return S


@kernel
def update(
    x: Floats, P: Floats, dimension: int, slots: Slots, sights: Floats, range_m: Floats,
    bearing_rad: Floats, noise: Floats, inflation: Floats,
) -> bool:  # fmt: skip
    """Take the observations (m,) of the landmarks in `slots` as one batch, in place.

    False (and x, P untouched) when the innovation covariance is not positive definite.
    """
    if slots.size == 0:
        return True
    W = seen_rows(P, dimension, slots, sights)
    S = innovation_covariance(W, slots, sights, range_m, noise, inflation)
    nu = np.empty(2 * slots.size)
    for i in range(slots.size):
        nu[2 * i] = range_m[i] - sights[slots[i], 0]
        nu[2 * i + 1] = wrapped(bearing_rad[i] - sights[slots[i], 1])
    if not whiten(S, W, nu):
        return False
    correct(x, P, W, nu)
    return True


@kernel
def take(
    x: Floats, P: Floats, records: Records, n: int, slots: Slots, sights: Floats, due: Floats,
    range_m: Floats, bearing_rad: Floats, noise: Floats, limits: Floats,
) -> tuple[int, Slots, int]:  # fmt: skip
    """Take those of a scan that have a landmark, in place: a batch.

    Gives how many were matched (-1: not positive definite), which observations were rejected, and
    how many are none; those are marked in `slots`. limits : as `slam.ekf_kernels.absorb`.
    """
    matched, rejected, invalid = 0, 0, 0
    used, against = np.empty(slots.size, dtype=np.int64), np.empty(slots.size, dtype=np.int64)
    inflation = np.empty(slots.size)
    for i in range(slots.size):
        if not usable(range_m[i], bearing_rad[i]):
            slots[i] = INVALID
            invalid += 1
        elif slots[i] >= 0:
            at, record = due[slots[i]], records[slots[i]]
            var_r, var_b = variances(range_m[i], noise)
            nu_r, nu_b = range_m[i] - at[0], wrapped(bearing_rad[i] - at[1])
            distance = squared_norm(nu_r, nu_b, at[2] + var_r, at[3], at[4] + var_b)
            if distance > limits[0]:
                record.rejected_in_a_row += 1
                against[rejected] = i
                rejected += 1
            else:
                record.rejected_in_a_row = 0
                record.n_seen += 1
                used[matched], inflation[matched] = i, max(distance / limits[1], 1.0)
                matched += 1
    used = used[:matched]
    if not update(
        x, P, 3 + 2 * n, slots[used], sights, range_m[used], bearing_rad[used], noise,
        inflation[:matched],
    ):  # fmt: skip
        matched = -1
    return matched, against[:rejected], invalid


@kernel
def enter(
    x: Floats, P: Floats, records: Records, n: int, slots: Slots, against: Slots, names: Slots,
    range_m: Floats, places: Floats, t_ns: int, limits: Floats, next_id: int,
) -> tuple[int, int, Slots]:  # fmt: skip
    """Enter the new landmarks while the map has room, and anew those contradicted too often.

    New ones are called by their name, or from `next_id` on if that is above zero; places : (m, 7),
    see `slam.gaussian.sights`. Gives how many are new, how many had no room, and the slots that now
    hold what they did not hold before.
    """
    added, over_limit, moved = 0, 0, 0
    entered = np.empty(slots.size, dtype=np.int64)
    for i in range(slots.size):
        if slots[i] != NEW:
            continue
        if n + added >= limits[3]:
            slots[i] = OVER_LIMIT
            over_limit += 1
            continue
        slots[i] = entered[added] = n + added
        name = next_id + added if next_id > 0 else names[i]
        added += 1
        begin(records[slots[i]], name, range_m[i], t_ns, x)
        place(x, P, 3 + 2 * (n + added), slots[i], places[i])
    for i in against:
        slot = slots[i]
        if 0.0 < limits[2] <= records[slot].rejected_in_a_row:
            begin(records[slot], records[slot].landmark_id, range_m[i], t_ns, x)
            place(x, P, 3 + 2 * (n + added), slot, places[i])
            entered[added + moved] = slot
            moved += 1
        slots[i] = IGNORED
    return added, over_limit, entered[: added + moved]


@kernel
def place(x: Floats, P: Floats, dimension: int, slot: int, placing: Floats) -> None:
    """Put the landmark of `slot` at the car plus the offset, with its full cross-covariance.

    `dimension` covers the slot; what the slot held before is forgotten.
    """
    j = 3 + 2 * slot
    fx, fy = placing[2], placing[3]
    x[j], x[j + 1] = x[0] + placing[0], x[1] + placing[1]
    for k in range(3, dimension):
        if k < j:
            P[j, k], P[j + 1, k] = P[k, 0] + fx * P[k, 2], P[k, 1] + fy * P[k, 2]
        elif k > j + 1:
            P[k, j], P[k, j + 1] = P[k, 0] + fx * P[k, 2], P[k, 1] + fy * P[k, 2]
    hx, hy, hh = P[2, 0], P[2, 1], P[2, 2]
    P[j, 0], P[j, 1], P[j, 2] = P[0, 0] + fx * hx, P[1, 0] + fx * hy, hx + fx * hh
    P[j + 1, 0], P[j + 1, 1], P[j + 1, 2] = P[1, 0] + fy * hx, P[1, 1] + fy * hy, hy + fy * hh
    P[j, j] = P[0, 0] + 2.0 * fx * hx + fx * fx * hh + placing[4]
    P[j + 1, j] = P[1, 0] + fx * hy + fy * hx + fx * fy * hh + placing[5]
    P[j + 1, j + 1] = P[1, 1] + 2.0 * fy * hy + fy * fy * hh + placing[6]
