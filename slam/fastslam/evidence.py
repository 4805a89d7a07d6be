"""Evidence on the landmarks of one particle, by the rules of `slam.landmarks`.

Given its path a particle does not doubt where a landmark is due, so that the rules need no margin.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.eyesight import SECTORS, note, sector, share
from slam.fastslam.cloud import Cloud, copy_landmark
from slam.fastslam.scan import Scan, Scratch, Watch
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
def due(
    busy: npt.NDArray[np.bool_],
    square_m2: Floats,
    within: int,
    nearest_m2: float,
    farthest_m2: float,
) -> bool:
    """Whether any landmark within reach of the sensor was not seen: mostly there is none."""
    for t in range(within):  # noqa: SIM110  numba compiles no generator expression
        if not busy[t] and nearest_m2 <= square_m2[t] <= farthest_m2:
            return True
    return False


@kernel
def absences(cloud: Cloud, p: int, scan: Scan, watch: Watch, scratch: Scratch, within: int) -> int:
    """Evidence against the landmarks that should have been seen; those with too little go.

    within : how many landmarks `near` holds, of which `busy` were seen. Gives how many went.
    """
    # Taken out once: each look into these tuples within the loop would count references.
    law, observes = watch.law, p == watch.observer
    busy, square_m2, near = scratch.busy, scratch.square_m2, scratch.near
    due_x, due_y, evidence = scratch.x, scratch.y, cloud.evidence
    nearest, farthest = law[NEAR_POSSIBLE] ** 2, law[FAR_POSSIBLE] ** 2
    x, y, heading = cloud.x[p], cloud.y[p], cloud.heading[p]
    doomed = False
    for t in range(within):
        if (busy[t] and not observes) or not nearest <= square_m2[t] <= farthest:
            continue
        j, east, north = near[t], due_x[t] - x, due_y[t] - y
        believed = evidence[p, j] >= law[CONFIRM]
        probability, bearing_rad = _chance_of_sight(
            law, believed, square_m2[t], east, north, heading
        )
        if busy[t] and believed and probability > 0.0:
            note(watch.next_eye, bearing_rad, True)
        if busy[t] or probability <= 0.0:
            continue
        other = _twin(law[SPACING], due_x, due_y, busy, t, within)
        if other >= 0:
            gone = j if cloud.seen[p, j] <= cloud.seen[p, near[other]] else near[other]
            evidence[p, gone] = -math.inf
        elif not _hidden(law[OCCLUDER], scan.range_m, scratch.place, x, y, east, north):
            if believed and observes:
                note(watch.next_eye, bearing_rad, False)
            evidence[p, j] -= _absence(
                law, watch.believed_losses, watch.eye, probability, bearing_rad, believed
            )
        else:
            continue
        doomed = doomed or other >= 0 or evidence[p, j] < law[REMOVE_BELOW]
    return _swept(cloud, p, law[REMOVE_BELOW], scratch, within) if doomed else 0


@kernel
def believed_losses(eye: Floats, law: Floats) -> Floats:
    """(SECTORS,): what absence takes from a believed landmark in sure reach, by direction.

    Made once a scan, as a logarithm for each landmark of each particle would cost half the update.
    """
    losses = np.empty(SECTORS)
    for place in range(SECTORS):
        probability = law[DETECTION]
        if law[LEARNS] > 0.0:
            bearing_rad = math.tau * ((place + 0.5) / SECTORS - 0.5)
            probability *= share(eye, bearing_rad, True)
        losses[place] = loss(probability, law)
    return losses


@kernel
def _absence(
    law: Floats,
    sure: Floats,
    eye: Floats,
    probability: float,
    bearing_rad: float,
    believed: bool,
) -> float:
    """What the absence of a landmark takes from its evidence; sure : from `believed_losses`."""
    learns = law[LEARNS] > 0.0
    taken: float
    if believed or (not learns and probability == law[DETECTION]):
        taken = sure[sector(bearing_rad) if learns else 0]
        return taken
    if learns:
        probability *= share(eye, bearing_rad, False)
    taken = loss(probability, law)
    return taken


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
    law: Floats, believed: bool, square_m2: float, east: float, north: float, heading: float
) -> tuple[float, float]:
    """How likely it is detected by the rules, and the bearing at which it is due."""
    range_m, bearing_rad = math.sqrt(square_m2), 0.0
    if law[FIELD_OF_VIEW] < math.tau or law[LEARNS] > 0.0:
        bearing_rad = wrapped(math.atan2(north, east) - heading)
        if abs(bearing_rad) > 0.5 * law[FIELD_OF_VIEW]:
            return 0.0, bearing_rad
    if not believed:
        return detection_probability(range_m, law), bearing_rad
    certain = law[NEAR_CERTAIN] <= range_m <= law[FAR_CERTAIN]
    return law[DETECTION] if certain else 0.0, bearing_rad


@kernel
def _twin(
    spacing_m: float, x: Floats, y: Floats, busy: npt.NDArray[np.bool_], t: int, within: int
) -> int:
    """A landmark that was seen and stands too near to be another one, or -1."""
    if spacing_m <= 0.0:
        return -1
    for other in range(within):
        dx, dy = x[other] - x[t], y[other] - y[t]
        if busy[other] and dx * dx + dy * dy < spacing_m * spacing_m:
            return other
    return -1


@kernel
def _hidden(
    radius_m: float, range_m: Floats, places: Floats, x: float, y: float, east: float, north: float
) -> bool:
    """Whether what was seen may hide a landmark: in front of it, near the line of sight."""
    if radius_m <= 0.0:
        return False
    due_m = math.sqrt(east * east + north * north)
    for i in range(range_m.size):
        dx, dy = places[i, 0] - x, places[i, 1] - y
        ahead, aside = east * dx + north * dy, east * dy - north * dx
        if ahead > 0.0 and range_m[i] <= due_m - radius_m and abs(aside) <= radius_m * due_m:
            return True
    return False


@kernel
def _remove(cloud: Cloud, p: int, j: int) -> None:
    """Move the last landmark, with everything known of it, into the place of j."""
    last = cloud.landmarks[p] - 1
    copy_landmark(cloud, p, last, p, j)
    cloud.landmarks[p] = last
