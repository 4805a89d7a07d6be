"""When and from where landmarks entered the maps of the particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps
from slam.fastslam.cloud import Integers


@dataclass(frozen=True, eq=False)
class BirthRecord:
    """t_ns : (n,); car : (n, 2) where the mean of the cloud stood; range_m : (n,) as observed."""

    t_ns: Stamps
    car: Floats
    range_m: Floats


class Births:
    """One row per observation of every scan in which some particle added a landmark.

    A landmark carries only the number of its row, so that copying a particle stays cheap.
    """

    def __init__(self) -> None:
        self._t_ns = np.empty(0, dtype=np.int64)
        self._rows = np.empty((0, 5))
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def append(
        self,
        t_ns: int,
        pose: Floats,
        range_m: Floats,
        bearing_rad: Floats,
        added: npt.NDArray[np.bool_],
    ) -> None:
        """The m observations of a scan, of which those of `added` became a landmark somewhere."""
        start, end = self._length, self._length + range_m.size
        if end > self._t_ns.size:
            room = max(end, 2 * self._t_ns.size) - start
            self._t_ns = np.concatenate([self._t_ns[:start], np.zeros(room, dtype=np.int64)])
            self._rows = np.concatenate([self._rows[:start], np.zeros((room, 5))])
        rows = self._rows[start:end]
        rows[:, 0], rows[:, 1], rows[:, 2] = pose[0], pose[1], range_m
        rows[:, 3] = np.where(added, pose[0] + range_m * np.cos(pose[2] + bearing_rad), np.nan)
        rows[:, 4] = np.where(added, pose[1] + range_m * np.sin(pose[2] + bearing_rad), np.nan)
        self._t_ns[start:end] = t_ns
        self._length = end

    def of(self, births: Integers) -> BirthRecord:
        """The rows of `births` (n,)."""
        rows = self._rows[births]
        return BirthRecord(self._t_ns[births], rows[:, :2].copy(), rows[:, 2].copy())

    def first_near(self, positions: Floats, t_ns: Stamps, radius_m: float) -> Stamps:
        """(n,): when any particle first added a landmark within the radius, at latest t_ns (n,)."""
        first: Stamps = t_ns.copy()
        rows, stamps = self._rows[: self._length], self._t_ns[: self._length]
        for k, (x, y) in enumerate(positions):
            near = np.hypot(rows[:, 3] - x, rows[:, 4] - y) <= radius_m
            if np.any(near):
                first[k] = min(first[k], stamps[near].min())
        return first
