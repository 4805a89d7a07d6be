"""EKF-SLAM with known or unknown association."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import EstimatedMap
from geometry import Floats, LandmarkMap
from slam import ekf_kernels as kernels
from slam import motion, observation
from slam.association import (
    IGNORED,
    NEW,
    nearest_compatible,
    own_distances,
    squared_distances,
)
from slam.config import EkfConfig
from slam.errors import SlamError
from slam.interface import UpdateReport

ASSOCIATIONS = ("known", "nearest")


@dataclass
class _Record:
    """What is kept of a landmark beside its place in the state."""

    landmark_id: int
    t_added_ns: int
    added_from: Floats
    range_added_m: float
    n_seen: int = 1
    rejected_in_a_row: int = 0


class EkfSlam:
    """One Gaussian over the car's pose and all landmarks; starts at the origin without doubt.

    `predict` then `update`, as often as data come. With `association="known"` the ids of the
    observations name the landmarks; with "nearest" they are ignored and landmarks are numbered in
    the order of their appearance. Memory grows by doubling.
    """

    def __init__(self, config: EkfConfig, association: str, capacity: int = 32) -> None:
        self.config, self.association = config, association
        self._x = np.zeros(3 + 2 * capacity)
        self._P = np.zeros((self._x.size, self._x.size))
        self._motion_noise = motion.noise_array(config.motion)
        self._noise = observation.noise_array(config.observation)
        self._records: list[_Record] = []
        self._slot_of: dict[int, int] = {}

    @property
    def _dimension(self) -> int:
        return 3 + 2 * len(self._records)

    @property
    def pose(self) -> Floats:
        """(3,): x, y, heading of the car in `map`."""
        return self._x[:3].copy()

    @property
    def pose_covariance(self) -> Floats:
        """(3, 3)."""
        return kernels.pose_covariance(self._P)

    def predict(self, increments: Floats, dt_s: Floats) -> tuple[Floats, Floats]:
        """Move by increments (k, 3) over dt_s (k,): poses (k, 3), covariances (k, 3, 3)."""
        return kernels.predict(
            self._x, self._P, self._dimension, increments, dt_s, self._motion_noise
        )

    def update(
        self, t_ns: int, landmark_id: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        """Take one scan's observations (m,): a batch of the matched, then the new ones.

        Raises `SlamError` when the covariance has broken down numerically.
        """
        if self.association == "known":
            slots = self._known_slots(landmark_id)
        else:
            slots = self._nearest_slots(range_m, bearing_rad)
        distances = own_distances(self._x, self._P, slots, range_m, bearing_rad, self._noise)
        rejected = self._reject(slots.tolist(), distances.tolist())
        passed = slots.copy()
        passed[rejected] = IGNORED
        self._batch_update(passed, range_m, bearing_rad, distances)
        new = np.flatnonzero(slots == NEW).tolist()
        for i in new:
            self._append(t_ns, int(landmark_id[i]), float(range_m[i]), float(bearing_rad[i]))
        for i in rejected:
            self._relocate(t_ns, int(slots[i]), float(range_m[i]), float(bearing_rad[i]))
        ignored = int(np.count_nonzero(slots == IGNORED))
        matched = slots.size - ignored - len(new) - len(rejected)
        return UpdateReport(matched, len(new), ignored, len(rejected))

    def _known_slots(self, ids: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The slot of each id; without an id, or seen a second time in one scan: ignored."""
        slots: list[int] = []
        seen: set[int] = set()
        for landmark in ids.tolist():
            usable = landmark >= 0 and landmark not in seen
            seen.add(landmark)
            slots.append(self._slot_of.get(landmark, NEW) if usable else IGNORED)
        return np.array(slots, dtype=np.int64)

    def _nearest_slots(self, range_m: Floats, bearing_rad: Floats) -> npt.NDArray[np.int64]:
        distances = squared_distances(
            self._x, self._P, len(self._records), range_m, bearing_rad, self._noise
        )
        return nearest_compatible(distances, self.config.accept_gate, self.config.spawn_gate)

    def _reject(self, slots: list[int], distances: list[float]) -> list[int]:
        """Indices of observations beyond the innovation gate; keeps count for every landmark."""
        rejected = []
        for i, (slot, distance) in enumerate(zip(slots, distances, strict=True)):
            if slot < 0:
                continue
            record = self._records[slot]
            if distance > self.config.innovation_gate:
                record.rejected_in_a_row += 1
                rejected.append(i)
            else:
                record.rejected_in_a_row = 0
                record.n_seen += 1
        return rejected

    def _batch_update(
        self, slots: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats, distances: Floats
    ) -> None:
        inflation = np.maximum(distances / self.config.tail_gate, 1.0)
        if not kernels.update(
            self._x, self._P, self._dimension, slots, range_m, bearing_rad, self._noise, inflation
        ):
            raise SlamError(
                f"the innovation covariance of {slots.size} observations is not positive definite "
                f"with {len(self._records)} landmarks; are the noise parameters too small?"
            )

    def _append(self, t_ns: int, landmark_id: int, range_m: float, bearing_rad: float) -> None:
        slot = len(self._records)
        if 3 + 2 * (slot + 1) > self._x.size:
            self._grow()
        known = self.association == "known"
        record = _Record(landmark_id if known else slot + 1, t_ns, self.pose[:2], range_m)
        self._records.append(record)
        if known:
            self._slot_of[landmark_id] = slot
        self._place(slot, range_m, bearing_rad)

    def _relocate(self, t_ns: int, slot: int, range_m: float, bearing_rad: float) -> None:
        """Place a landmark anew that was contradicted too often in a row: it is off, not we."""
        record = self._records[slot]
        if 0 < self.config.relocate_after <= record.rejected_in_a_row:
            self._records[slot] = _Record(record.landmark_id, t_ns, self.pose[:2], range_m)
            self._place(slot, range_m, bearing_rad)

    def _place(self, slot: int, range_m: float, bearing_rad: float) -> None:
        kernels.place_landmark(
            self._x, self._P, self._dimension, slot, range_m, bearing_rad, self._noise
        )

    def _grow(self) -> None:
        size = 3 + 2 * (self._x.size - 3)
        x, P = np.zeros(size), np.zeros((size, size))
        x[: self._x.size] = self._x
        P[: self._x.size, : self._x.size] = self._P
        self._x, self._P = x, P

    def estimated_map(self) -> EstimatedMap:
        """The landmarks now, each with its covariance and how it entered.

        Those seen less than `min_seen` times stay in the state but are not reported yet.
        """
        slots = [k for k, r in enumerate(self._records) if r.n_seen >= self.config.min_seen]
        records = [self._records[k] for k in slots]
        n = len(slots)
        x, y = 3 + 2 * np.array(slots, dtype=np.intp), 4 + 2 * np.array(slots, dtype=np.intp)
        covariances = np.empty((n, 2, 2))
        covariances[:, 0, 0], covariances[:, 1, 1] = self._P[x, x], self._P[y, y]
        covariances[:, 0, 1] = covariances[:, 1, 0] = self._P[y, x]
        return EstimatedMap(
            LandmarkMap(
                np.array([r.landmark_id for r in records], dtype=np.int64),
                np.stack([self._x[x], self._x[y]], axis=1),
                covariances,
            ),
            t_added_ns=np.array([r.t_added_ns for r in records], dtype=np.int64),
            added_from=np.array([r.added_from for r in records]).reshape(n, 2),
            range_added_m=np.array([r.range_added_m for r in records]),
            n_seen=np.array([r.n_seen for r in records], dtype=np.int64),
        )
