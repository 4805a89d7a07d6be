"""What is kept of a landmark beside its place, and when it is believed or given up.

Existence is a log-odds, `slam.config.LandmarkRules` tells of what: sightings add to it, absence
takes from it, but only where the sensor could have seen the landmark. Counting misses within a
radius would delete the cones right beside the car, in the blind zone of a detector that needs four
to ten hits.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps
from slam.association import IGNORED, OVER_LIMIT, usable
from slam.config import LandmarkRules
from slam.eyesight import note, share
from slam.kernels import kernel, wrapped
from slam.observation import variances

RECORD = np.dtype(
    [
        ("landmark_id", np.int64),
        ("t_added_ns", np.int64),
        ("n_seen", np.int64),
        ("rejected_in_a_row", np.int64),
        ("x_added_m", np.float64),
        ("y_added_m", np.float64),
        ("range_added_m", np.float64),
        ("log_odds", np.float64),
    ]
)
Records = npt.NDArray[np.void]
Slots = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

(
    START, CONFIRM, REMOVE_BELOW, MOST, CLUTTER, DETECTION, FALSE_MATCH, NEAR_POSSIBLE,
    NEAR_CERTAIN, FAR_CERTAIN, FAR_POSSIBLE, FIELD_OF_VIEW, LEARNS, OCCLUDER, SPACING,
) = range(15)  # fmt: skip
"""Where each rule stands in `rules_array`."""


def rules_array(rules: LandmarkRules) -> Floats:
    """The rules as the kernels take them, (15,)."""
    return np.array(
        [
            rules.start_log_odds,
            rules.confirm_log_odds,
            rules.remove_below_log_odds,
            rules.max_log_odds,
            rules.clutter_density_per_m_rad,
            rules.detection_probability,
            rules.false_match_probability,
            rules.near_possible_m,
            rules.near_certain_m,
            rules.far_certain_m,
            rules.far_possible_m,
            rules.field_of_view_rad,
            float(rules.learns_field_of_view),
            rules.occluder_radius_m,
            rules.spacing_m,
        ]
    )


@kernel
def begin(record, name: int, range_m: float, t_ns: int, x: Floats) -> None:  # type: ignore[no-untyped-def]  # numba's record
    """What is kept of a landmark that is seen for the first time, by a car at x."""
    record.landmark_id, record.t_added_ns, record.n_seen = name, t_ns, 1
    record.rejected_in_a_row = 0
    record.x_added_m, record.y_added_m = x[0], x[1]
    record.range_added_m, record.log_odds = range_m, 0.0


@kernel
def detection_probability(range_m: float, rules: Floats) -> float:
    """How likely a landmark at this range is detected when nothing is in the way."""
    near_possible, near_certain = rules[NEAR_POSSIBLE], rules[NEAR_CERTAIN]
    far_certain, far_possible = rules[FAR_CERTAIN], rules[FAR_POSSIBLE]
    probability: float = rules[DETECTION]
    if range_m <= near_possible or range_m >= far_possible:
        probability = 0.0
    elif range_m < near_certain:
        probability *= (range_m - near_possible) / (near_certain - near_possible)
    elif range_m > far_certain:
        probability *= (far_possible - range_m) / (far_possible - far_certain)
    return probability


@kernel
def chance_of_sight(due: Floats, believed: bool, rules: Floats) -> float:
    """How likely what is due there is detected; of what is believed the least, within two sigma.

    due : (5,), a row of `association.expectations`.
    """
    doubt_m, doubt_rad = 2.0 * math.sqrt(max(due[2], 0.0)), 2.0 * math.sqrt(max(due[4], 0.0))
    if rules[FIELD_OF_VIEW] < math.tau and abs(due[1]) + doubt_rad > 0.5 * rules[FIELD_OF_VIEW]:
        return 0.0
    if not believed:
        return detection_probability(due[0], rules)
    if due[0] - doubt_m < rules[NEAR_CERTAIN] or due[0] + doubt_m > rules[FAR_CERTAIN]:
        return 0.0
    probability: float = rules[DETECTION]
    return probability


@kernel
def gain(log_likelihood: float, range_m: float, rules: Floats) -> float:
    """What a sighting adds to the log-odds; log_likelihood : per metre and radian."""
    if rules[CLUTTER] > 0.0:
        seen = max(detection_probability(range_m, rules), rules[FALSE_MATCH])
        return log_likelihood + math.log(seen / rules[CLUTTER])
    return math.log(max(rules[DETECTION], rules[FALSE_MATCH]) / rules[FALSE_MATCH])


@kernel
def gains(range_m: Floats, rules: Floats) -> Floats:
    """(m,): `gain` at these ranges of sightings whose log-likelihood is 0."""
    out = np.empty(range_m.size)
    for i in range(range_m.size):
        out[i] = gain(0.0, range_m[i], rules)
    return out


@kernel
def loss(probability: float, rules: Floats) -> float:
    """What the absence of a landmark, seen with this probability, takes from its log-odds, >= 0."""
    if rules[CLUTTER] > 0.0:
        return -math.log(1.0 - probability)
    return max(math.log((1.0 - rules[FALSE_MATCH]) / (1.0 - probability)), 0.0)


@kernel
def hides(
    range_m: float, bearing_rad: float, due_range_m: float, due_bearing_rad: float, radius_m: float
) -> bool:
    """Whether something seen here stands before, and near the line of sight to, what is due."""
    turn = wrapped(due_bearing_rad - bearing_rad)
    if range_m > due_range_m - radius_m or abs(turn) > 0.5 * math.pi:
        return False
    return range_m * math.sin(abs(turn)) <= radius_m


@kernel
def hidden(slot: int, due: Floats, range_m: Floats, bearing_rad: Floats, radius_m: float) -> bool:
    """Whether an observation or another landmark may hide the landmark of `slot`."""
    if radius_m <= 0.0:
        return False
    at_m, at_rad = due[slot, 0], due[slot, 1]
    for i in range(range_m.size):
        if usable(range_m[i], bearing_rad[i]) and hides(
            range_m[i], bearing_rad[i], at_m, at_rad, radius_m
        ):
            return True
    for other in range(due.shape[0]):
        if other != slot and hides(due[other, 0], due[other, 1], at_m, at_rad, radius_m):
            return True
    return False


@kernel
def twin(x: Floats, slot: int, seen: Flags, spacing_m: float) -> int:
    """A landmark that was seen and stands too near to `slot` to be another one, or -1."""
    for other in range(seen.size):
        if seen[other] and other != slot:
            dx, dy = x[3 + 2 * other] - x[3 + 2 * slot], x[4 + 2 * other] - x[4 + 2 * slot]
            if dx * dx + dy * dy < spacing_m * spacing_m:
                return other
    return -1


@kernel
def log_likelihood(distance: float, due: Floats, range_m: float, noise: Floats) -> float:
    """Of a sighting at this squared distance of what is due there, per metre and radian."""
    var_r, var_b = variances(range_m, noise)
    determinant = (due[2] + var_r) * (due[4] + var_b) - due[3] * due[3]
    return -0.5 * (distance + math.log(determinant)) - math.log(math.tau)


@kernel
def reward(
    records: Records, slots: Slots, due: Floats, distances: Floats, range_m: Floats, noise: Floats,
    rules: Floats,
) -> None:  # fmt: skip
    """Evidence for what was seen, in place; slots beyond `due` are new."""
    for i in range(slots.size):
        slot = slots[i]
        if slot >= due.shape[0]:
            records[slot].log_odds = rules[START]
        elif slot >= 0:
            likelihood = log_likelihood(distances[i, slot], due[slot], range_m[i], noise)
            odds = records[slot].log_odds + gain(likelihood, range_m[i], rules)
            records[slot].log_odds = min(odds, rules[MOST])


@kernel
def weigh(
    x: Floats, records: Records, n: int, slots: Slots, due: Floats, distances: Floats,
    range_m: Floats, bearing_rad: Floats, noise: Floats, spawn_gate: float, rules: Floats,
    eye: Floats,
) -> Slots:  # fmt: skip
    """Take one scan's evidence on the n landmarks; gives the slots to give up, ascending.

    slots : (m,) of the observations, new ones >= due.shape[0]; due, distances : before the scan;
    eye : from `eyesight.new_eye`, learns in place. A believed landmark is excused when an ignored
    observation lies in its grey zone. Another is not: a ghost between two cones would keep both
    out of the map and be excused by both, for ever.
    """
    before = due.shape[0]
    reward(records, slots, due, distances, range_m, noise, rules)
    seen, excused = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    for i in range(slots.size):
        if slots[i] >= 0:
            seen[slots[i]] = True
        elif slots[i] == IGNORED or slots[i] == OVER_LIMIT:
            for slot in range(before):
                believed = records[slot].log_odds >= rules[CONFIRM]
                if believed and distances[i, slot] <= spawn_gate:
                    excused[slot] = True
    gone, known = np.zeros(n, dtype=np.bool_), eye.copy()
    for slot in range(before):
        record, bearing = records[slot], due[slot, 1]
        believed = record.log_odds >= rules[CONFIRM]
        probability = chance_of_sight(due[slot], believed, rules)
        if probability <= 0.0:
            continue
        if seen[slot]:
            if believed:
                note(eye, bearing, True)
            continue
        other = twin(x, slot, seen, rules[SPACING])
        if other >= 0:
            gone[slot if record.n_seen <= records[other].n_seen else other] = True
        elif not excused[slot] and not hidden(slot, due, range_m, bearing_rad, rules[OCCLUDER]):
            if believed:
                note(eye, bearing, False)
            if rules[LEARNS] > 0.0:
                probability *= share(known, bearing, believed)
            record.log_odds -= loss(probability, rules)
            gone[slot] = record.log_odds < rules[REMOVE_BELOW]
    return np.flatnonzero(gone)


class Departed:
    """Where landmarks stood that were given up, and since when: what `t_first_ns` is made of."""

    MOST = 10_000

    def __init__(self, same_place_m: float) -> None:
        self._same_place_m = same_place_m
        self._positions = np.empty((0, 2))
        self._t_ns = np.empty(0, dtype=np.int64)

    def add(self, x_m: float, y_m: float, t_ns: int) -> None:
        """Remember one; places that coincide are one, so that their number is bounded."""
        near = self._near(np.array([x_m, y_m]))
        if near.any():
            first = int(np.argmax(near))
            self._t_ns[first] = min(int(self._t_ns[first]), t_ns)
        elif self._t_ns.size < self.MOST:
            self._positions = np.append(self._positions, [[x_m, y_m]], axis=0)
            self._t_ns = np.append(self._t_ns, t_ns)

    def first_times(self, positions: Floats, t_added_ns: Stamps) -> Stamps:
        """(n,): when any landmark first stood at the places of these."""
        first = t_added_ns.copy()
        for i, position in enumerate(positions):
            first[i] = min([int(first[i]), *self._t_ns[self._near(position)].tolist()])
        return first

    def _near(self, position: Floats) -> npt.NDArray[np.bool_]:
        offset = self._positions - position
        near: npt.NDArray[np.bool_] = np.hypot(offset[:, 0], offset[:, 1]) <= self._same_place_m
        return near
