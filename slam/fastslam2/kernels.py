"""The proposal of FastSLAM 2.0: where a particle may be, given the motion and the scan.

Montemerlo, Thrun, Koller, Wegbreit, IJCAI 2003; Thrun, Burgard, Fox 2005, table 13.3. As in
`slam.fastslam.kernels` an observation is a point in the map with the covariance R; the particle's
pose, a Gaussian as long as it is not drawn, moves that point along.
"""

from __future__ import annotations

import math

from geometry import Floats
from slam.fastslam.association import landmarks_within_reach
from slam.fastslam.cloud import Cloud
from slam.fastslam.scan import Decisions, Rules, Scan, Scratch, squared_distance
from slam.kernels import kernel, wrapped


@kernel
def propose(
    cloud: Cloud,
    motion: Floats,
    spread: Floats,
    scan: Scan,
    rules: Rules,
    slots: Decisions,
    known: bool,
    scratch: Scratch,
    roots: Floats,
) -> None:
    """Move every particle to the mean of its proposal and weigh it, in place.

    motion (3,) and spread (3, 3) are the motion since the last scan and its covariance, in the
    frame of a particle before it. slots : (m,), if known, a decision for all particles. Fills roots
    (N, 3, 3), a square root of each proposal's covariance. The log weight grows by the log density
    of the scan given the path up to the last: wherever in its proposal the particle is drawn.
    """
    for p in range(cloud.x.size):
        P = roots[p]
        _drive(cloud, p, motion, spread, P)
        pairs = 0
        if known:
            for i in range(slots.size):
                if slots[i] >= 0:
                    scratch.pair_observation[pairs], scratch.pair_landmark[pairs] = i, slots[i]
                    pairs += 1
        else:
            pairs = _gather(cloud, p, scan, rules, P, scratch)
        cloud.log_weight[p] += _look(cloud, p, scan, rules, P, scratch, pairs, known)
        root_in_place(P)


@kernel
def _gather(cloud: Cloud, p: int, scan: Scan, rules: Rules, P: Floats, scratch: Scratch) -> int:
    """Fills the pairs of observation and landmark that may be; gives how many."""
    pairs, farthest = 0, 0.0
    for i in range(scan.cos.size):
        doubt = P[0, 0] + P[1, 1] + scan.range_m[i] ** 2 * P[2, 2]
        farthest = max(farthest, scan.widest[i] * doubt)
    cos, sin = math.cos(cloud.heading[p]), math.sin(cloud.heading[p])
    within = landmarks_within_reach(cloud, p, rules.reach_m + math.sqrt(farthest), scratch)
    for i in range(scan.cos.size):
        for t in range(within):
            j = scratch.near[t]
            if _innovation(cloud, p, scan, i, j, P, cos, sin, 1.0)[0] <= scan.widest[i]:
                scratch.pair_observation[pairs], scratch.pair_landmark[pairs] = i, j
                pairs += 1
    return pairs


@kernel
def _look(
    cloud: Cloud, p: int, scan: Scan, rules: Rules, P: Floats, scratch: Scratch, pairs: int,
    known: bool,
) -> float:  # fmt: skip
    """Narrow the pose by the likeliest pair, then by the likeliest of what that leaves, and so on.

    What is known best comes first: whose a doubtful sighting is, is asked when the others have
    told where the car is. Gives the log density of the scan.
    """
    observation, landmark = scratch.pair_observation, scratch.pair_landmark
    log_weight, taken = 0.0, 0
    while True:
        best, least = -1, math.inf
        cos, sin = math.cos(cloud.heading[p]), math.sin(cloud.heading[p])
        for k in range(pairs):
            i = observation[k]
            distance, determinant = _innovation(cloud, p, scan, i, landmark[k], P, cos, sin, 1.0)[
                :2
            ]
            score = distance + math.log(determinant / (scan.var_along[i] * scan.var_across[i]))
            if known:
                possible = distance <= rules.innovation
            else:
                possible = distance <= rules.accept and score <= scan.likely[i]
            if possible and score < least:
                best, least = k, score
        if best < 0:
            return log_weight + (scan.cos.size - taken) * rules.log_new
        i, j = observation[best], landmark[best]
        log_weight += _see(cloud, p, scan, rules, i, j, P)
        taken += 1
        left = 0
        for k in range(pairs):
            if observation[k] != i and landmark[k] != j:
                observation[left], landmark[left] = observation[k], landmark[k]
                left += 1
        pairs = left


@kernel
def _drive(cloud: Cloud, p: int, motion: Floats, spread: Floats, P: Floats) -> None:
    """Move the particle, and fill P (3, 3) with the covariance of that in the map."""
    cos, sin = math.cos(cloud.heading[p]), math.sin(cloud.heading[p])
    cloud.x[p] += cos * motion[0] - sin * motion[1]
    cloud.y[p] += sin * motion[0] + cos * motion[1]
    cloud.heading[p] = wrapped(cloud.heading[p] + motion[2])
    xx, xy, yy = spread[0, 0], spread[0, 1], spread[1, 1]
    P[0, 0] = cos * cos * xx - 2.0 * cos * sin * xy + sin * sin * yy
    P[1, 0] = P[0, 1] = cos * sin * (xx - yy) + (cos * cos - sin * sin) * xy
    P[1, 1] = sin * sin * xx + 2.0 * cos * sin * xy + cos * cos * yy
    P[2, 0] = P[0, 2] = cos * spread[0, 2] - sin * spread[1, 2]
    P[2, 1] = P[1, 2] = sin * spread[0, 2] + cos * spread[1, 2]
    P[2, 2] = spread[2, 2]


@kernel
def _point(scan: Scan, i: int, cos: float, sin: float) -> tuple[float, float, float, float, float]:
    """An observation in the map: its offset from the car, and its covariance xx, xy, yy.

    cos, sin : of the heading.
    """
    ux = cos * scan.cos[i] - sin * scan.sin[i]
    uy = sin * scan.cos[i] + cos * scan.sin[i]
    across = scan.var_across[i]
    more = scan.var_along[i] - across
    east, north = scan.range_m[i] * ux, scan.range_m[i] * uy
    return east, north, across + more * ux * ux, more * ux * uy, across + more * uy * uy


@kernel
def _moved_along(P: Floats, east: float, north: float) -> tuple[float, float, float]:
    """Covariance xx, xy, yy of a point at this offset from a car whose pose has P."""
    xh, yh, hh = P[0, 2], P[1, 2], P[2, 2]
    return (
        P[0, 0] - 2.0 * north * xh + north * north * hh,
        P[0, 1] + east * xh - north * yh - east * north * hh,
        P[1, 1] + 2.0 * east * yh + east * east * hh,
    )


@kernel
def _innovation(
    cloud: Cloud, p: int, scan: Scan, i: int, j: int, P: Floats, cos: float, sin: float, f: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Squared distance of an observation from the landmark j, and the determinant of S.

    Then where it sees the landmark less where that is, dx, dy; S as xx, xy, yy; and how far from
    the car, east, north. f : of the noise.
    """
    east, north, rxx, rxy, ryy = _point(scan, i, cos, sin)
    dx = cloud.x[p] + east - cloud.landmark_x[p, j]
    dy = cloud.y[p] + north - cloud.landmark_y[p, j]
    xx, xy, yy = _moved_along(P, east, north)
    sxx = xx + cloud.covariance[p, j, 0] + f * rxx
    sxy = xy + cloud.covariance[p, j, 1] + f * rxy
    syy = yy + cloud.covariance[p, j, 2] + f * ryy
    distance, determinant = squared_distance(dx, dy, sxx, sxy, syy)
    return distance, determinant, dx, dy, sxx, sxy, syy, east, north


@kernel
def _see(cloud: Cloud, p: int, scan: Scan, rules: Rules, i: int, j: int, P: Floats) -> float:
    """Kalman update of the pose by one sighting of the landmark j; its log density before."""
    cos, sin = math.cos(cloud.heading[p]), math.sin(cloud.heading[p])
    f = max(1.0, _innovation(cloud, p, scan, i, j, P, cos, sin, 1.0)[0] / rules.tail)
    distance, determinant, dx, dy, sxx, sxy, syy, east, north = _innovation(
        cloud, p, scan, i, j, P, cos, sin, f
    )
    wx, wy = (syy * dx - sxy * dy) / determinant, (sxx * dy - sxy * dx) / determinant
    a0, a1, a2 = P[0, 0] - north * P[0, 2], P[1, 0] - north * P[1, 2], P[2, 0] - north * P[2, 2]
    b0, b1, b2 = P[0, 1] + east * P[0, 2], P[1, 1] + east * P[1, 2], P[2, 1] + east * P[2, 2]
    cloud.x[p] -= a0 * wx + b0 * wy
    cloud.y[p] -= a1 * wx + b1 * wy
    cloud.heading[p] = wrapped(cloud.heading[p] - a2 * wx - b2 * wy)
    a, b = (a0, a1, a2), (b0, b1, b2)
    for r in range(3):
        ka, kb = (syy * a[r] - sxy * b[r]) / determinant, (sxx * b[r] - sxy * a[r]) / determinant
        for c in range(r + 1):
            P[r, c] -= ka * a[c] + kb * b[c]
            P[c, r] = P[r, c]
    ratio = determinant / (scan.var_along[i] * scan.var_across[i])
    log_density: float = scan.log_peak[i] - 0.5 * (distance + math.log(ratio))
    return log_density


@kernel
def root_in_place(P: Floats) -> None:
    """Make P (3, 3), which may be singular, its lower Cholesky factor."""
    for c in range(3):
        for s in range(c):
            for r in range(c, 3):
                P[r, c] -= P[r, s] * P[c, s]
        P[c, c] = math.sqrt(max(P[c, c], 0.0))
        for r in range(c):
            P[r, c] = 0.0
        for r in range(c + 1, 3):
            P[r, c] = P[r, c] / P[c, c] if P[c, c] > 0.0 else 0.0


@kernel
def draw(cloud: Cloud, roots: Floats, normals: Floats) -> None:
    """Draw every particle from its proposal, in place; normals : (N, 3) standard normal draws."""
    for p in range(cloud.x.size):
        root, n = roots[p], normals[p]
        cloud.x[p] += root[0, 0] * n[0]
        cloud.y[p] += root[1, 0] * n[0] + root[1, 1] * n[1]
        turned = root[2, 0] * n[0] + root[2, 1] * n[1] + root[2, 2] * n[2]
        cloud.heading[p] = wrapped(cloud.heading[p] + turned)
