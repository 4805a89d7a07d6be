"""Per-particle maximum likelihood association with mutual exclusion.

Candidates are gathered once per particle, before any Mahalanobis distance is formed.
"""

from __future__ import annotations

import math

from slam.fastslam.cloud import Cloud
from slam.fastslam.scan import IGNORED, NEW, Decisions, Rules, Scan, Scratch, squared_distance
from slam.kernels import inlined


@inlined
def landmarks_within_reach(cloud: Cloud, p: int, reach_m: float, scratch: Scratch) -> int:
    """Fills near to busy of the scratch; gives how many landmarks there are."""
    x, y, limit = cloud.x[p], cloud.y[p], reach_m * reach_m
    map_x, map_y, covariance = cloud.landmark_x, cloud.landmark_y, cloud.covariance
    within = 0
    for j in range(cloud.landmarks[p]):
        dx, dy = map_x[p, j] - x, map_y[p, j] - y
        square = dx * dx + dy * dy
        # Written whether it counts or not: a branch would be guessed wrong half the time.
        scratch.near[within], scratch.busy[within] = j, False
        scratch.x[within], scratch.y[within] = map_x[p, j], map_y[p, j]
        scratch.trace[within] = covariance[p, j, 0] + covariance[p, j, 2]
        scratch.square_m2[within] = square
        within += int(square <= limit)
    return within


@inlined
def _possible(
    scratch: Scratch, within: int, x: float, y: float, variance: float, widest: float
) -> int:
    """Fills possible with the landmarks within the gate `widest`, and maybe a few more.

    The trace bounds the greatest eigenvalue of S: a cheap no that is never wrong.
    """
    found = 0
    for t in range(within):
        dx, dy = x - scratch.x[t], y - scratch.y[t]
        scratch.possible[found] = t
        found += int(dx * dx + dy * dy <= widest * (scratch.trace[t] + variance))
    return found


@inlined
def associate(
    cloud: Cloud,
    p: int,
    scan: Scan,
    rules: Rules,
    scratch: Scratch,
    within: int,
    chosen: Decisions,
) -> None:
    """Most likely landmark of each observation, each landmark at most once: fills chosen (m,)."""
    pairs, contested, places = 0, False, scratch.place
    for i in range(chosen.size):
        x, y, likely = places[i, 0], places[i, 1], scan.likely[i]
        rxx, rxy, ryy = places[i, 2], places[i, 3], places[i, 4]
        chosen[i], before = NEW, pairs
        for k in range(_possible(scratch, within, x, y, rxx + ryy, scan.widest[i])):
            t = scratch.possible[k]
            j = scratch.near[t]
            xx, yy = cloud.covariance[p, j, 0] + rxx, cloud.covariance[p, j, 2] + ryy
            xy = cloud.covariance[p, j, 1] + rxy
            distance, determinant = squared_distance(x - scratch.x[t], y - scratch.y[t], xx, xy, yy)
            if distance <= rules.spawn:
                chosen[i] = IGNORED
            ratio = determinant / (scan.var_along[i] * scan.var_across[i])
            # log(ratio) <= ratio - 1 spares most logarithms.
            if distance <= rules.accept and (
                distance + ratio - 1.0 <= likely or distance + math.log(ratio) <= likely
            ):
                for earlier in range(before):
                    contested = contested or scratch.pair_landmark[earlier] == t
                scratch.pair_observation[pairs], scratch.pair_landmark[pairs] = i, t
                scratch.pair_distance[pairs], scratch.pair_ratio[pairs] = distance, ratio
                pairs += 1
        contested = contested or pairs > before + 1
    if contested:
        pairs = _most_likely_first(scratch, pairs)
    for k in range(pairs):
        t = scratch.pair_landmark[k]
        chosen[scratch.pair_observation[k]] = scratch.near[t]
        scratch.busy[t] = True


@inlined
def _most_likely_first(scratch: Scratch, pairs: int) -> int:
    """Keep, at the front, the likeliest pair, then the likeliest of what it leaves, and so on."""
    observation, landmark = scratch.pair_observation, scratch.pair_landmark
    score = scratch.pair_distance
    for k in range(pairs):
        score[k] += math.log(scratch.pair_ratio[k])
    kept = 0
    while kept < pairs:
        best = kept
        for k in range(kept + 1, pairs):
            if score[k] < score[best]:
                best = k
        i, t = observation[best], landmark[best]
        observation[best], landmark[best] = observation[kept], landmark[kept]
        score[best] = score[kept]
        observation[kept], landmark[kept] = i, t
        kept += 1
        left = kept
        for k in range(kept, pairs):
            if observation[k] != i and landmark[k] != t:
                observation[left], landmark[left] = observation[k], landmark[k]
                score[left] = score[k]
                left += 1
        pairs = left
    return kept
