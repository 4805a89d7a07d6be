"""The inner loops of a FastSLAM 1.0 update: association, landmark filters, weights, evidence.

Montemerlo, Thrun, Koller, Wegbreit, AAAI 2002; Thrun, Burgard, Fox 2005, table 13.1. Given a
particle's pose an observation is a point in the map with covariance R (the polar noise turned into
the line of sight), and its landmark's filter is linear: S = C + R, no Jacobian, no bearing to wrap.
To first order in the bearing noise that is the extended Kalman filter of the book; the likelihood
per metre and radian is the one per square metre times the range.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.fastslam.association import associate, landmarks_within_reach
from slam.fastslam.cloud import Cloud
from slam.fastslam.evidence import absences, due
from slam.fastslam.scan import (
    NEW,
    REFUSED,
    REJECTED,
    Decisions,
    Rules,
    Scan,
    Scratch,
    Watch,
    squared_distance,
)
from slam.kernels import inlined, kernel


@kernel
def update(
    cloud: Cloud,
    scan: Scan,
    rules: Rules,
    watch: Watch,
    slots: Decisions,
    known: bool,
    scratch: Scratch,
    decisions: Decisions,
    removed: Decisions,
    birth: int,
    added: npt.NDArray[np.bool_],
) -> None:
    """Let every particle take the scan, in place.

    slots : (m,), if known: a decision for all particles. If not, each finds out for itself, and
    landmarks can be missed. decisions : (N, m), filled: a landmark or `NEW`, `IGNORED`, `REJECTED`,
    `REFUSED`; removed : (N,), filled, landmarks given up. An observation i that becomes a landmark
    gets the birth `birth + i`; `added` (m,) tells whether any did.
    """
    for p in range(cloud.x.size):
        chosen = decisions[p]
        removed[p] = 0
        _project(cloud, p, scan, scratch.place)
        if known:
            for i in range(chosen.size):
                chosen[i] = slots[i]
            _filter(cloud, p, scan, rules, scratch.place, chosen, birth, added)
        else:
            within = landmarks_within_reach(cloud, p, rules.reach_m, scratch)
            associate(cloud, p, scan, rules, scratch, within, chosen)
            _filter(cloud, p, scan, rules, scratch.place, chosen, birth, added)
            if rules.absence and (
                p == watch.observer
                or due(scratch.busy, scratch.square_m2, within, rules.nearest_m2, rules.farthest_m2)
            ):
                removed[p] = absences(cloud, p, scan, watch, scratch, within)
        for i in range(chosen.size):
            if chosen[i] == NEW and cloud.landmarks[p] < rules.max_landmarks:
                cloud.landmarks[p] += 1
                _put(cloud, p, cloud.landmarks[p] - 1, scratch.place[i], rules.start, birth + i)
                added[i] = True
            elif chosen[i] == NEW:
                chosen[i] = REFUSED


@inlined
def _project(cloud: Cloud, p: int, scan: Scan, place: Floats) -> None:
    """Fills place (m, 5): the observations in the map of the particle, and their covariances."""
    cos, sin = math.cos(cloud.heading[p]), math.sin(cloud.heading[p])
    for i in range(scan.cos.size):
        ux = cos * scan.cos[i] - sin * scan.sin[i]
        uy = sin * scan.cos[i] + cos * scan.sin[i]
        across = scan.var_across[i]
        more = scan.var_along[i] - across
        place[i, 0] = cloud.x[p] + scan.range_m[i] * ux
        place[i, 1] = cloud.y[p] + scan.range_m[i] * uy
        place[i, 2] = across + more * ux * ux
        place[i, 3] = more * ux * uy
        place[i, 4] = across + more * uy * uy


@inlined
def _filter(
    cloud: Cloud,
    p: int,
    scan: Scan,
    rules: Rules,
    places: Floats,
    chosen: Decisions,
    birth: int,
    added: npt.NDArray[np.bool_],
) -> None:
    """Kalman update of the chosen landmarks, and what the scan does to the particle's weight."""
    log_weight, ratios = 0.0, 1.0
    for i in range(chosen.size):
        j = chosen[i]
        if j < 0:
            log_weight += rules.log_new
            continue
        dx = places[i, 0] - cloud.landmark_x[p, j]
        dy = places[i, 1] - cloud.landmark_y[p, j]
        rxx, rxy, ryy = places[i, 2], places[i, 3], places[i, 4]
        xx, xy = cloud.covariance[p, j, 0], cloud.covariance[p, j, 1]
        yy = cloud.covariance[p, j, 2]
        distance, determinant = squared_distance(dx, dy, xx + rxx, xy + rxy, yy + ryy)
        if distance > rules.innovation:
            log_weight += rules.log_new
            chosen[i] = REJECTED
            added[i] = _contradict(cloud, p, j, places[i], rules, birth + i) or added[i]
            continue
        f = max(1.0, distance / rules.tail)
        rxx, rxy, ryy = f * rxx, f * rxy, f * ryy
        if f > 1.0:
            distance, determinant = squared_distance(dx, dy, xx + rxx, xy + rxy, yy + ryy)
        likelihood = scan.log_peak[i] - 0.5 * distance
        ratio = determinant / (scan.var_along[i] * scan.var_across[i])
        hit = scan.gain[i]
        if rules.clutter:
            likelihood -= 0.5 * math.log(ratio)
            hit += likelihood
        else:
            ratios *= ratio
            if ratios > 1e200:  # one logarithm for all, before they overflow
                log_weight -= 0.5 * math.log(ratios)
                ratios = 1.0
        _learn(cloud, p, j, _fused(dx, dy, xx, xy, yy, rxx, rxy, ryy), hit, rules.most)
        log_weight += likelihood
    cloud.log_weight[p] += log_weight - 0.5 * math.log(ratios)


@kernel
def _fused(
    dx: float, dy: float, xx: float, xy: float, yy: float, rxx: float, rxy: float, ryy: float
) -> tuple[float, float, float, float, float]:
    """Kalman update: shift of the landmark and its covariance, from the innovation, C and R.

    (C^-1 + R^-1)^-1 = (det R C + det C R) / det S for 2x2: symmetric and positive as it stands.
    """
    sxx, sxy, syy = xx + rxx, xy + rxy, yy + ryy
    scale = 1.0 / (sxx * syy - sxy * sxy)
    wx, wy = (syy * dx - sxy * dy) * scale, (sxx * dy - sxy * dx) * scale
    own, other = (rxx * ryy - rxy * rxy) * scale, (xx * yy - xy * xy) * scale
    return (
        xx * wx + xy * wy,
        xy * wx + yy * wy,
        own * xx + other * rxx,
        own * xy + other * rxy,
        own * yy + other * ryy,
    )


@inlined
def _learn(
    cloud: Cloud,
    p: int,
    j: int,
    fused: tuple[float, float, float, float, float],
    hit: float,
    most: float,
) -> None:
    cloud.landmark_x[p, j] += fused[0]
    cloud.landmark_y[p, j] += fused[1]
    cloud.covariance[p, j, 0], cloud.covariance[p, j, 1] = fused[2], fused[3]
    cloud.covariance[p, j, 2] = fused[4]
    cloud.evidence[p, j] = min(cloud.evidence[p, j] + hit, most)
    cloud.seen[p, j] += 1


@inlined
def _contradict(cloud: Cloud, p: int, j: int, place: Floats, rules: Rules, birth: int) -> bool:
    """Evidence against a landmark; when it is enough it is placed anew, and True."""
    cloud.evidence[p, j] -= rules.miss
    if cloud.evidence[p, j] >= rules.below:
        return False
    _put(cloud, p, j, place, rules.start, birth)
    return True


@inlined
def _put(cloud: Cloud, p: int, j: int, place: Floats, evidence: float, birth: int) -> None:
    """A landmark at `place` with one sighting behind it."""
    cloud.landmark_x[p, j], cloud.landmark_y[p, j] = place[0], place[1]
    cloud.covariance[p, j, 0], cloud.covariance[p, j, 1] = place[2], place[3]
    cloud.covariance[p, j, 2] = place[4]
    cloud.evidence[p, j], cloud.seen[p, j], cloud.birth[p, j] = evidence, 1, birth
