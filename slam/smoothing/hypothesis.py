"""A path, a map and whose sightings are whose, and how likely that is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from capture import Estimate, EstimatedMap, Observations, Odometry
from geometry import Floats, LandmarkMap, Stamps, Trajectory
from slam import observation
from slam.smoothing import assignment
from slam.smoothing.config import UnnamedConfig
from slam.smoothing.smoother import smooth

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """The data and what the sensor's field is, which nobody tells: it is where most was seen."""

    odometry: Odometry
    observations: Observations
    starts: Ints
    config: UnnamedConfig
    noise: Floats
    nearest_m: float
    farthest_m: float
    half_angle_rad: float

    @classmethod
    def of(
        cls, path: Trajectory, odometry: Odometry, observations: Observations, config: UnnamedConfig
    ) -> Evidence:
        """What was seen while the path lasts, without what is no observation."""
        t_ns, range_m, bearing_rad = (
            observations.t_ns, observations.range_m, observations.bearing_rad,
        )  # fmt: skip
        kept = (t_ns >= path.t_ns[0]) & (t_ns <= path.t_ns[-1]) & (range_m > 0.0)
        kept &= np.isfinite(range_m) & np.isfinite(bearing_rad)
        seen = Observations(
            t_ns[kept], observations.landmark_id[kept], range_m[kept], bearing_rad[kept]
        )
        near, far = np.percentile(seen.range_m, [5.0, 90.0]) if kept.any() else (0.0, 0.0)
        half = np.percentile(np.abs(seen.bearing_rad), 95.0) if kept.any() else 0.0
        return cls(
            odometry, seen, seen.batch_starts, config,
            observation.noise_array(config.smoothing.observation),
            float(near), float(far), float(half),
        )  # fmt: skip

    def poses(self, path: Trajectory) -> Floats:
        """(m, 3): where the path was at each observation."""
        stamps, of = np.unique(self.observations.t_ns, return_inverse=True)
        found: Floats = path.interpolated(stamps).poses[of]
        return found

    def worths(self, path: Trajectory, landmarks: Floats, detection: float, scale: float) -> Floats:
        """(m, n): see `assignment.worths`."""
        seen = self.observations
        return assignment.worths(
            self.poses(path), landmarks, seen.range_m, seen.bearing_rad, self.noise,
            self.log_odds(detection), scale,
        )  # fmt: skip

    def in_field(self, path: Trajectory, landmarks: Floats, slots: Ints) -> Ints:
        """(n,): in how many scans each landmark could have been seen, at least those it was in."""
        could = assignment.in_field(
            self.poses(path)[self.starts[:-1]], landmarks, self.nearest_m, self.farthest_m,
            self.half_angle_rad,
        )  # fmt: skip
        return np.maximum(could, sightings(slots, len(landmarks)))

    def log_odds(self, detection: float) -> float:
        """What a sighting in the field speaks for a landmark, before its density."""
        return math.log(detection / ((1.0 - detection) * self.config.clutter_density_per_m_rad))


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """What is taken to be true.

    estimate : smoothed, landmark i called i + 1; slots : (m,) the landmark of each observation or
    -1; detection : how likely a landmark in the field is seen by a scan.
    """

    estimate: Estimate
    slots: Ints
    detection: float

    @property
    def landmarks(self) -> Floats:
        """(n, 2), a copy."""
        assert self.estimate.map is not None
        return np.array(self.estimate.map.landmarks.positions)


def sightings(slots: Ints, n: int) -> Ints:
    """(n,): how often each landmark was seen."""
    return np.bincount(slots[slots >= 0], minlength=n).astype(np.int64)


def smoothed(
    evidence: Evidence, estimate: Estimate, landmarks: Floats, slots: Ints, detection: float
) -> Hypothesis:
    """The hypothesis that the slots are right, with the path and map that follow."""
    before = replace(estimate, map=_map(evidence, estimate.path, landmarks, slots))
    associations = np.where(slots >= 0, slots + 1, -1)
    after = smooth(
        before, evidence.odometry, evidence.observations, associations, evidence.config.smoothing
    )
    return Hypothesis(after, slots, detection)


def log_likelihood(evidence: Evidence, hypothesis: Hypothesis) -> float:
    """Of motions, sightings and absences, against all sightings being clutter."""
    seen, slots = evidence.observations, hypothesis.slots
    told = hypothesis.estimate.provenance["smoothing"]
    assert isinstance(told, dict)
    noise = evidence.config.smoothing.observation
    sigma_m = np.hypot(noise.range_sigma_m, noise.range_sigma_per_m * seen.range_m)
    peak = evidence.log_odds(hypothesis.detection) - np.log(
        math.tau * sigma_m * noise.bearing_sigma_rad
    )
    could = evidence.in_field(hypothesis.estimate.path, hypothesis.landmarks, slots)
    absent = float(could.sum()) * math.log(1.0 - hypothesis.detection)
    return float(peak[slots >= 0].sum()) - 0.5 * float(told["cost_after"]) + absent


def _map(evidence: Evidence, path: Trajectory, landmarks: Floats, slots: Ints) -> EstimatedMap:
    """The landmarks with how each came in, as its first sighting tells."""
    n, seen = len(landmarks), evidence.observations
    of, first = np.unique(slots, return_index=True)
    at = np.zeros(n, dtype=np.intp)
    at[of[of >= 0]] = first[of >= 0]
    t_ns: Stamps = seen.t_ns[at]
    spread = np.tile(0.01 * np.eye(2), (n, 1, 1))
    return EstimatedMap(
        LandmarkMap(np.arange(1, n + 1), landmarks, spread),
        t_added_ns=t_ns,
        added_from=evidence.poses(path)[at, :2],
        range_added_m=seen.range_m[at],
        n_seen=sightings(slots, n),
        t_first_ns=t_ns,
    )
