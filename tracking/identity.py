"""Which ring is which: by place for those that stand, by each other for those on the car.

Rings look alike. A match is therefore made only where no other is nearly as good; where two are,
none is made, and the marker is lost rather than confused with its neighbour.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
import numpy.typing as npt

from geometry import Floats, wrap
from tracking.errors import TrackingError

NOBODY = -1
_CLEARLY = 2.5
"""The second nearest must be so many times further away than the nearest."""

_HEADING_GATE_RAD = np.pi / 3.0
"""The other way round is then at least 120 degrees off."""


@dataclass(frozen=True)
class RingPair:
    """Two rings on one rigid car, by their indices among the markers, so far apart."""

    front: int
    rear: int
    distance_m: float
    tolerance_m: float = 0.02


def unique_matches(expected: Floats, gates_m: Floats, found: Floats) -> npt.NDArray[np.int64]:
    """For each expected place (n, 2) the one found ring that can only be it, or -1.

    found : (m, 2), or (n, m, 2) where each expects the rings elsewhere (at its height). gates_m :
    (n,) how far from its place each may be. Nearest to each other, within the gate, and no other
    ring or place nearly as near.
    """
    matches = np.full(len(expected), NOBODY, np.int64)
    apart = np.linalg.norm(expected[:, None] - found, axis=2)
    if not apart.size:
        return matches
    apart = np.where(np.isfinite(apart), apart, np.inf)
    for i, row in enumerate(apart):
        j = int(row.argmin())
        if row[j] > gates_m[i] or apart[:, j].argmin() != i:
            continue
        rivals = np.concatenate([np.delete(row, j), np.delete(apart[:, j], i)])
        # A rival outside of every gate is none; one that is nearly as near is one.
        if (rivals > np.minimum(_CLEARLY * row[j] + 1e-9, gates_m[i])).all():
            matches[i] = j
    return matches


@dataclass(frozen=True, eq=False)
class CarMemory:
    """Which way the car pointed, and where the middle of its rings was (2,), NaN if unknown."""

    heading_rad: float
    middle_xy: Floats

    def heading_at(self, middle_xy: Floats, still_m: float) -> float:
        """Which way it should point at another place.

        A car rolls: on an arc the chord halves the turn, forwards or backwards alike. Nearer than
        `still_m` it has not turned.
        """
        x, y = middle_xy - self.middle_xy
        if not np.hypot(x, y) > still_m:
            return self.heading_rad
        return float(wrap(2.0 * np.arctan2(y, x) - self.heading_rad))


def pair_match(
    pair: RingPair, expected: Floats, gate_m: float, found: Floats, memory: CarMemory | None
) -> tuple[int, int] | None:
    """Indices of the found rings (m, 2) that are front and rear of the car, or None if not sure.

    expected : (2, 2) where front and rear should be, NaN where unknown. Without a memory of its
    heading front and rear look the same, and the answer is None.
    """
    if memory is None:
        return None
    fits = []
    for i, j in permutations(range(len(found)), 2):
        along = found[i] - found[j]
        if not abs(float(np.hypot(*along)) - pair.distance_m) <= pair.tolerance_m:
            continue
        heading = memory.heading_at((found[i] + found[j]) / 2.0, pair.distance_m)
        if abs(float(wrap(heading_between(found[i], found[j]) - heading))) > _HEADING_GATE_RAD:
            continue
        off = np.linalg.norm(found[[i, j]] - expected, axis=1)
        if (np.isnan(off) | (off <= gate_m)).all():
            fits.append((i, j))
    return fits[0] if len(fits) == 1 else None


def heading_between(front_xy: Floats, rear_xy: Floats) -> float:
    """The direction from rear to front, (-pi, pi]."""
    x, y = front_xy - rear_xy
    return float(wrap(np.arctan2(y, x)))


def car_pose(
    front_xy: Floats,
    rear_xy: Floats,
    front_covariance: Floats,
    rear_covariance: Floats,
    front_x_m: float,
    rear_x_m: float,
) -> tuple[Floats, Floats]:
    """Pose (3,) of base_link and its covariance (3, 3) from the two rings on the car's middle line.

    front_x_m, rear_x_m : the lever arms, how far ahead of base_link the rings are. Raises
    `TrackingError` unless the front ring is ahead of the rear one.
    """
    if not front_x_m > rear_x_m:
        raise TrackingError(
            f"the front ring must be ahead of the rear one, got {front_x_m} and {rear_x_m} m"
        )
    heading = heading_between(front_xy, rear_xy)
    forward = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-forward[1], forward[0]])
    middle_x = (front_x_m + rear_x_m) / 2.0
    xy = (front_xy + rear_xy) / 2.0 - middle_x * forward
    turn = left / float(np.hypot(*(front_xy - rear_xy)))
    # d (x, y, heading) / d (front, rear).
    to_front = np.vstack([np.eye(2) / 2.0 - middle_x * np.outer(left, turn), turn])
    to_rear = np.vstack([np.eye(2) / 2.0 + middle_x * np.outer(left, turn), -turn])
    covariance = to_front @ front_covariance @ to_front.T + to_rear @ rear_covariance @ to_rear.T
    return np.array([*xy, heading]), covariance
