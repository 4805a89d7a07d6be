"""What is kept of a landmark beside its place, and when it is believed or given up.

Existence is a log-odds, as a cell of an occupancy grid has it (Thrun, Burgard, Fox 2005, section
9.2): sightings add to it, absence takes from it, but only where the sensor could have seen the
landmark. Counting misses within a radius would delete the cones right beside the car, in the blind
zone of a detector that needs four to ten hits.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps
from slam.association import IGNORED, OVER_LIMIT, usable
from slam.config import LandmarkRules
from slam.kernels import kernel, wrapped

RECORD = np.dtype(
    [
        ("landmark_id", np.int64),
        ("t_added_ns", np.int64),
        ("n_seen", np.int64),
        ("rejected_in_a_row", np.int64),
        ("sightings", np.int64),
        ("confirmed", np.int64),
        ("x_added_m", np.float64),
        ("y_added_m", np.float64),
        ("range_added_m", np.float64),
        ("log_odds", np.float64),
    ]
)
"""`sightings`: the last scans that could have seen it, newest in the lowest bit, 1 where it was."""

Records = npt.NDArray[np.void]
Slots = npt.NDArray[np.int64]

EXPECTED = 0.5
"""From this detection probability on a miss counts among the scans that could have seen it."""


def rules_array(rules: LandmarkRules) -> Floats:
    """The rules as the kernels take them, (13,)."""
    return np.array(
        [
            rules.confirm_hits,
            (1 << rules.confirm_window) - 1,
            rules.confirm_count,
            rules.detection_probability,
            rules.false_match_probability,
            rules.near_possible_m,
            rules.near_certain_m,
            rules.far_certain_m,
            rules.far_possible_m,
            rules.field_of_view_rad,
            rules.occluder_radius_m,
            rules.remove_below_log_odds,
            rules.max_log_odds,
        ],
        dtype=np.float64,
    )


@kernel
def detection_probability(range_m: float, rules: Floats) -> float:
    """How likely a landmark at this range is detected when nothing is in the way."""
    near_possible, near_certain, far_certain, far_possible = rules[5], rules[6], rules[7], rules[8]
    probability: float = rules[3]
    if range_m <= near_possible or range_m >= far_possible:
        probability = 0.0
    elif range_m < near_certain:
        probability *= (range_m - near_possible) / (near_certain - near_possible)
    elif range_m > far_certain:
        probability *= (far_possible - range_m) / (far_possible - far_certain)
    return probability


@kernel
def lenient_probability(due: Floats, rules: Floats) -> float:
    """The least detection probability within two sigma of where a landmark is due."""
    doubt_m, doubt_rad = 2.0 * math.sqrt(max(due[2], 0.0)), 2.0 * math.sqrt(max(due[4], 0.0))
    if rules[9] < math.tau and abs(due[1]) + doubt_rad > 0.5 * rules[9]:
        return 0.0
    return min(
        detection_probability(due[0] - doubt_m, rules),
        detection_probability(due[0], rules),
        detection_probability(due[0] + doubt_m, rules),
    )


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
def sighted(record, rules: Floats) -> None:  # type: ignore[no-untyped-def]  # numba's record
    """Count one sighting for a landmark."""
    record.sightings = ((record.sightings << 1) | 1) & np.int64(rules[1])
    gain = math.log(max(rules[3], rules[4]) / rules[4])
    record.log_odds = min(record.log_odds + gain, rules[12])
    hits, bits = 0, record.sightings
    while bits > 0:
        hits += bits & 1
        bits >>= 1
    if hits >= rules[0] or record.n_seen >= rules[2]:
        record.confirmed = 1


@kernel
def missed(record, probability: float, rules: Floats) -> None:  # type: ignore[no-untyped-def]
    """Count one absence where the landmark would have been seen with this probability."""
    if probability >= EXPECTED:
        record.sightings = (record.sightings << 1) & np.int64(rules[1])
    record.log_odds += min(math.log((1.0 - probability) / (1.0 - rules[4])), 0.0)


@kernel
def weigh(
    records: Records, n: int, slots: Slots, due: Floats, distances: Floats,
    range_m: Floats, bearing_rad: Floats, spawn_gate: float, rules: Floats,
) -> Slots:  # fmt: skip
    """Take one scan's evidence on the n landmarks; gives the slots to give up, ascending.

    slots : (m,) of the observations, new ones >= due.shape[0]; due, distances : before the scan.
    A landmark is excused when an ignored observation lies in its grey zone.
    """
    before = due.shape[0]
    seen, excused = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    for i in range(slots.size):
        if slots[i] >= 0:
            seen[slots[i]] = True
        elif slots[i] == IGNORED or slots[i] == OVER_LIMIT:
            for slot in range(before):
                if distances[i, slot] <= spawn_gate:
                    excused[slot] = True
    gone = np.empty(before, dtype=np.int64)
    count = 0
    for slot in range(n):
        if seen[slot]:
            sighted(records[slot], rules)
        elif not excused[slot] and rules[3] > 0.0:
            probability = lenient_probability(due[slot], rules)
            if probability > 0.0 and not hidden(slot, due, range_m, bearing_rad, rules[10]):
                missed(records[slot], probability, rules)
                if records[slot].log_odds < rules[11]:
                    gone[count] = slot
                    count += 1
    return gone[:count]


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
