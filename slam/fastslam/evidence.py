"""Evidence on the landmarks of one particle, by the rules of `slam.landmarks`.

Given its path a particle does not doubt where a landmark is due, so that the rules need no margin.
"""

from __future__ import annotations

import math

from slam.eyesight import note, share
from slam.fastslam.cloud import Cloud
from slam.fastslam.scan import Rules, Scan, Scratch
from slam.kernels import kernel, wrapped
from slam.landmarks import (
    CONFIRM,
    DETECTION,
    FAR_CERTAIN,
    FAR_POSSIBLE,
    FIELD_OF_VIEW,
    LEARNS,
    NEAR_CERTAIN,
    NEAR_POSSIBLE,
    OCCLUDER,
    REMOVE_BELOW,
    SPACING,
    detection_probability,
    loss,
)


@kernel
def absences(cloud: Cloud, p: int, scan: Scan, rules: Rules, scratch: Scratch, within: int) -> int:
    """Evidence against the landmarks that should have been seen; those with too little go.

    within : how many landmarks `near` holds, of which `busy` were seen. Gives how many went.
    """
    law = rules.landmarks
    nearest, farthest = law[NEAR_POSSIBLE] ** 2, law[FAR_POSSIBLE] ** 2
    doomed = False
    for t in range(within):
        busy = scratch.busy[t]
        if (busy and p != rules.observer) or not nearest <= scratch.square_m2[t] <= farthest:
            continue
        j = scratch.near[t]
        probability, bearing_rad = _chance_of_sight(cloud, p, rules, scratch, t)
        believed = cloud.evidence[p, j] >= law[CONFIRM]
        if busy and believed and probability > 0.0:
            note(rules.next_eye, bearing_rad, True)
        if busy or probability <= 0.0:
            continue
        other = _twin(rules, scratch, t, within)
        if other >= 0:
            k = scratch.near[other]
            gone = j if cloud.seen[p, j] <= cloud.seen[p, k] else k
            cloud.evidence[p, gone] = -math.inf
        elif not _hidden(cloud, p, scan, rules, scratch, t):
            if believed and p == rules.observer:
                note(rules.next_eye, bearing_rad, False)
            if law[LEARNS] > 0.0:
                probability *= share(rules.eye, bearing_rad, believed)
            cloud.evidence[p, j] -= loss(probability, law)
        else:
            continue
        doomed = doomed or other >= 0 or cloud.evidence[p, j] < law[REMOVE_BELOW]
    return _swept(cloud, p, law[REMOVE_BELOW], scratch, within) if doomed else 0


@kernel
def _swept(cloud: Cloud, p: int, below: float, scratch: Scratch, within: int) -> int:
    removed = 0
    # From the back, so that the last landmark, moved into the gap, has been judged already.
    for t in range(within - 1, -1, -1):
        if cloud.evidence[p, scratch.near[t]] < below:
            _remove(cloud, p, scratch.near[t])
            removed += 1
    return removed


@kernel
def _chance_of_sight(
    cloud: Cloud, p: int, rules: Rules, scratch: Scratch, t: int
) -> tuple[float, float]:
    """How likely it is detected by the rules, and the bearing at which it is due."""
    law, range_m, bearing_rad = rules.landmarks, math.sqrt(scratch.square_m2[t]), 0.0
    if law[FIELD_OF_VIEW] < math.tau or law[LEARNS] > 0.0:
        direction = math.atan2(scratch.y[t] - cloud.y[p], scratch.x[t] - cloud.x[p])
        bearing_rad = wrapped(direction - cloud.heading[p])
        if abs(bearing_rad) > 0.5 * law[FIELD_OF_VIEW]:
            return 0.0, bearing_rad
    if cloud.evidence[p, scratch.near[t]] < law[CONFIRM]:
        return detection_probability(range_m, law), bearing_rad
    certain = law[NEAR_CERTAIN] <= range_m <= law[FAR_CERTAIN]
    return law[DETECTION] if certain else 0.0, bearing_rad


@kernel
def _twin(rules: Rules, scratch: Scratch, t: int, within: int) -> int:
    """A landmark that was seen and stands too near to be another one, or -1."""
    limit = rules.landmarks[SPACING] ** 2
    for other in range(within):
        dx, dy = scratch.x[other] - scratch.x[t], scratch.y[other] - scratch.y[t]
        if scratch.busy[other] and dx * dx + dy * dy < limit:
            return other
    return -1


@kernel
def _hidden(cloud: Cloud, p: int, scan: Scan, rules: Rules, scratch: Scratch, t: int) -> bool:
    """Whether what was seen may hide a landmark: in front of it, near the line of sight."""
    radius = rules.landmarks[OCCLUDER]
    if radius <= 0.0:
        return False
    range_m = math.sqrt(scratch.square_m2[t])
    east, north = scratch.x[t] - cloud.x[p], scratch.y[t] - cloud.y[p]
    for i in range(scan.range_m.size):
        dx, dy = scratch.place[i, 0] - cloud.x[p], scratch.place[i, 1] - cloud.y[p]
        ahead, aside = east * dx + north * dy, east * dy - north * dx
        before = ahead > 0.0 and scan.range_m[i] <= range_m - radius
        if before and abs(aside) <= radius * range_m:
            return True
    return False


@kernel
def _remove(cloud: Cloud, p: int, j: int) -> None:
    """Move the last landmark, with everything known of it, into the place of j."""
    last = cloud.landmarks[p] - 1
    cloud.landmark_x[p, j] = cloud.landmark_x[p, last]
    cloud.landmark_y[p, j] = cloud.landmark_y[p, last]
    cloud.covariance[p, j, 0] = cloud.covariance[p, last, 0]
    cloud.covariance[p, j, 1] = cloud.covariance[p, last, 1]
    cloud.covariance[p, j, 2] = cloud.covariance[p, last, 2]
    cloud.evidence[p, j] = cloud.evidence[p, last]
    cloud.seen[p, j] = cloud.seen[p, last]
    cloud.birth[p, j] = cloud.birth[p, last]
    cloud.landmarks[p] = last
