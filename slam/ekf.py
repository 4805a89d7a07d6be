"""EKF-SLAM with known or unknown association."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from capture import EstimatedMap
from geometry import Floats, LandmarkMap
from slam import ekf_kernels as kernels
from slam import landmarks, motion, observation
from slam.association import expectations, nearest_compatible, squared_distances
from slam.config import PRESETS, EkfConfig
from slam.errors import SlamError
from slam.eyesight import new_eye
from slam.interface import Algorithm, UpdateReport
from slam.jcbb import joint_compatible, joint_gates
from slam.landmarks import Slots

ASSOCIATIONS = ("known", "nearest", "jcbb")


class EkfSlam:
    """One Gaussian over the car's pose and all landmarks; starts at the origin without doubt.

    `predict` then `update`, as often as data come. With `association="known"` the ids of the
    observations name the landmarks; with "nearest" and "jcbb" they are ignored, landmarks are
    numbered in the order of their appearance, believed and given up by `config.landmarks`.
    Memory grows by doubling.
    """

    def __init__(self, config: EkfConfig, association: str, capacity: int = 32) -> None:
        self.config, self.association = config, association
        self._x = np.zeros(3 + 2 * capacity)
        self._P = np.zeros((self._x.size, self._x.size))
        self._records = np.zeros(capacity, dtype=landmarks.RECORD)
        self._n, self._next_id = 0, 1
        self._departed = landmarks.Departed(config.landmarks.same_place_m)
        self._motion_noise = motion.noise_array(config.motion)
        self._noise = observation.noise_array(config.observation)
        self._rules, self._eye = landmarks.rules_array(config.landmarks), new_eye()
        self._limits = np.array(
            [
                config.innovation_gate,
                config.tail_gate,
                config.relocate_after,
                config.landmarks.max_landmarks,
            ]
        )
        self._joint_gates: Floats | None = None

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
            self._x, self._P, 3 + 2 * self._n, increments, dt_s, self._motion_noise
        )

    def update(
        self, t_ns: int, landmark_id: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        """Take one scan's observations (m,): a batch of the matched, then the new ones.

        Raises `SlamError` when the covariance has broken down numerically.
        """
        most = self.config.max_observations
        over = max(landmark_id.size - most, 0)
        if over:
            landmark_id, range_m = landmark_id[:most], range_m[:most]
            bearing_rad = bearing_rad[:most]
        # Copies: one kind of array, whatever the caller's is, is one compiled kernel.
        ids, ranges = np.array(landmark_id, dtype=np.int64), np.array(range_m, dtype=np.float64)
        bearings = np.array(bearing_rad, dtype=np.float64)
        if self._records.size < min(self._n + ids.size, self.config.landmarks.max_landmarks):
            self._grow(self._n + ids.size)
        if self.association == "known":
            report = self._update_named(t_ns, ids, ranges, bearings)
        else:
            report = self._update_unnamed(t_ns, ids, ranges, bearings)
        return report + UpdateReport(over_limit=over) if over else report

    def _update_named(
        self, t_ns: int, ids: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        counts = kernels.absorb_named(
            self._x, self._P, self._records, self._n, ids, range_m, bearing_rad, t_ns,
            self._noise, self._limits,
        )  # fmt: skip
        return self._report(counts, ids.size)

    def _update_unnamed(
        self, t_ns: int, ids: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        config, cut_short = self.config, False
        due = expectations(self._x, self._P, self._n)
        distances = squared_distances(due, range_m, bearing_rad, self._noise)
        if self.association == "nearest":
            slots = nearest_compatible(distances, config.accept_gate, config.spawn_gate)
        else:
            if self._joint_gates is None:
                self._joint_gates = joint_gates(config.joint_probability, config.max_observations)
            slots, cut_short = joint_compatible(
                self._x, self._P, distances, range_m, bearing_rad, self._noise,
                config.accept_gate, config.spawn_gate, self._joint_gates, config.joint_nodes,
            )  # fmt: skip
        counts = kernels.absorb(
            self._x, self._P, self._records, self._n, slots, ids, range_m, bearing_rad, t_ns,
            self._noise, self._limits, self._next_id,
        )  # fmt: skip
        report = self._report(counts, ids.size)
        self._next_id += report.added
        removed = self._give_up(slots, due, distances, range_m, bearing_rad)
        if removed or cut_short:
            return dataclasses.replace(report, removed=removed, cut_short=int(cut_short))
        return report

    def _give_up(
        self, slots: Slots, due: Floats, distances: Floats, range_m: Floats, bearing_rad: Floats
    ) -> int:
        """Weigh the evidence of a scan; how many landmarks it cost."""
        gone = landmarks.weigh(
            self._x, self._records, self._n, slots, due, distances, range_m, bearing_rad,
            self._noise, self.config.spawn_gate, self._rules, self._eye,
        )  # fmt: skip
        for slot in gone[::-1].tolist():
            self._remove(slot)
        return int(gone.size)

    def _report(self, counts: tuple[int, int, int, int, int], m: int) -> UpdateReport:
        matched, added, rejected, invalid, over_limit = counts
        if matched < 0:
            raise SlamError(
                f"the innovation covariance of {m} observations is not positive definite "
                f"with {self._n} landmarks; are the noise parameters too small?"
            )
        self._n += added
        ignored = m - matched - added - rejected - invalid - over_limit
        return UpdateReport(matched, added, ignored, rejected, invalid, over_limit)

    def _remove(self, slot: int) -> None:
        x, y = self._x[3 + 2 * slot : 5 + 2 * slot].tolist()
        self._departed.add(x, y, int(self._records["t_added_ns"][slot]))
        kernels.remove(self._x, self._P, self._records, self._n, slot)
        self._n -= 1

    def _grow(self, needed: int) -> None:
        capacity = self._records.size
        while capacity < needed:
            capacity *= 2
        size = 3 + 2 * capacity
        x, P, records = np.zeros(size), np.zeros((size, size)), np.zeros(capacity, landmarks.RECORD)
        x[: self._x.size] = self._x
        P[: self._x.size, : self._x.size] = self._P
        records[: self._records.size] = self._records
        self._x, self._P, self._records = x, P, records

    def estimated_map(self) -> EstimatedMap:
        """The landmarks now, each with its covariance and how it entered.

        Those seen less than `min_seen` times, or without a name and not believed, stay in the state
        but are not reported.
        """
        records = self._records[: self._n]
        believed = records["n_seen"] >= self.config.min_seen
        if self.association != "known":
            believed &= records["log_odds"] >= self.config.landmarks.confirm_log_odds
        slots = np.flatnonzero(believed)
        records = records[slots]
        x, y = 3 + 2 * slots, 4 + 2 * slots
        positions = np.stack([self._x[x], self._x[y]], axis=1)
        covariances = np.empty((slots.size, 2, 2))
        covariances[:, 0, 0], covariances[:, 1, 1] = self._P[x, x], self._P[y, y]
        covariances[:, 0, 1] = covariances[:, 1, 0] = self._P[y, x]
        return EstimatedMap(
            LandmarkMap(records["landmark_id"], positions, covariances),
            t_added_ns=records["t_added_ns"],
            added_from=np.stack([records["x_added_m"], records["y_added_m"]], axis=1),
            range_added_m=records["range_added_m"],
            n_seen=records["n_seen"],
            t_first_ns=self._departed.first_times(positions, records["t_added_ns"]),
        )


EKF = Algorithm(PRESETS, ASSOCIATIONS, lambda config, words, _: EkfSlam(config, words))
