"""FastSLAM 1.0 with known or per-particle maximum likelihood association."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from capture import EstimatedMap
from geometry import Floats, LandmarkMap
from slam import landmarks, motion
from slam.eyesight import new_eye
from slam.fastslam import kernels
from slam.fastslam.births import Births
from slam.fastslam.cloud import (
    grown,
    moments,
    move,
    new_cloud,
    normalised_weights,
    offspring,
    resample,
)
from slam.fastslam.config import FASTSLAM_PRESETS, FastSlamConfig
from slam.fastslam.scan import (
    IGNORED,
    NEW,
    REFUSED,
    REJECTED,
    Decisions,
    Rules,
    Scan,
    new_scratch,
)
from slam.interface import Algorithm, UpdateReport

FASTSLAM_ASSOCIATIONS = ("known", "likelihood")
_DRAWS_AT_ONCE = 1 << 18


class FastSlam:
    """A cloud of particles, each a path with a map of its own; all start at the origin.

    The pose is the mean over the particles, weighted with what the last scan made of them; the map
    is that of the particle of highest weight before the last resampling, of equals the first. With
    `association="known"` the ids of the observations name the landmarks, which are then never
    removed; with "likelihood" ids are ignored and landmarks numbered as they appear. Random numbers
    are drawn from PCG64(seed) outside the kernels: the same seed and data give the same result.

    Reports tell what the particle of highest weight made of a scan.
    """

    def __init__(self, config: FastSlamConfig, association: str, seed: int = 0) -> None:
        self.config, self.association = config, association
        self._random = np.random.Generator(np.random.PCG64(seed))
        self._cloud = new_cloud(config.particles, min(32, config.landmarks.max_landmarks))
        self._weights = np.full(config.particles, 1.0 / config.particles)
        self._motion_noise = motion.noise_array(config.motion)
        self._pose: Floats = np.zeros(3)
        self._covariance: Floats = np.zeros((3, 3))
        self._births = Births()
        self._slot_of: dict[int, int] = {}
        self._removed = np.zeros(config.particles, dtype=np.int32)
        self._best = 0
        self._largest_variance = 0.0
        self._landmark_rules, self._eye = landmarks.rules_array(config.landmarks), new_eye()
        absence_counts = config.landmarks.detection_probability > 0.0
        self._reach_m = config.landmarks.far_possible_m if absence_counts else 0.0

    @property
    def pose(self) -> Floats:
        """(3,): x, y, heading of the car in `map`."""
        pose: Floats = self._pose.copy()
        return pose

    @property
    def pose_covariance(self) -> Floats:
        """(3, 3): spread of the particles."""
        covariance: Floats = self._covariance.copy()
        return covariance

    def predict(self, increments: Floats, dt_s: Floats) -> tuple[Floats, Floats]:
        """Move by increments (k, 3) over dt_s (k,): poses (k, 3), covariances (k, 3, 3)."""
        steps, particles = len(increments), self.config.particles
        poses, covariances = np.empty((steps, 3)), np.empty((steps, 3, 3))
        block = max(1, _DRAWS_AT_ONCE // (3 * particles))
        for start in range(0, steps, block):
            some = slice(start, min(start + block, steps))
            move(
                self._cloud,
                self._weights,
                increments[some],
                dt_s[some],
                self._motion_noise,
                self._random.standard_normal((some.stop - start, 3, particles)),
                self._pose,
                poses[some],
                covariances[some],
            )
        if steps:
            self._covariance = covariances[-1].copy()
        return poses, covariances

    def update(
        self, t_ns: int, landmark_id: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        """Take one scan's observations (m,), each (m,); an empty scan is one that missed all."""
        usable = np.flatnonzero(np.isfinite(range_m) & np.isfinite(bearing_rad) & (range_m > 0.0))
        taken = self._nearest(usable, range_m)
        ids, ranges, bearings = landmark_id[taken], range_m[taken], bearing_rad[taken]
        slots = self._known_slots(ids) if self.association == "known" else np.empty(0, np.int32)
        decisions = self._take(t_ns, slots, ranges, bearings)
        removed = int(self._removed[self._best])
        self._weigh_and_resample()
        return UpdateReport(
            matched=int(np.count_nonzero(decisions >= 0)),
            added=int(np.count_nonzero(decisions == NEW)),
            ignored=int(np.count_nonzero(decisions == IGNORED)),
            rejected=int(np.count_nonzero(decisions == REJECTED)),
            invalid=range_m.size - usable.size,
            over_limit=usable.size - taken.size + int(np.count_nonzero(decisions == REFUSED)),
            removed=removed,
        )

    def _nearest(self, usable: npt.NDArray[np.intp], range_m: Floats) -> npt.NDArray[np.intp]:
        """Of more observations than a scan may have the nearest, in the order they came."""
        limit = self.config.max_observations
        if usable.size <= limit:
            return usable
        return np.sort(usable[np.argsort(range_m[usable], kind="stable")[:limit]])

    def _known_slots(self, ids: npt.NDArray[np.int64]) -> Decisions:
        """The landmark of each id, the same in every particle; new ones in order of appearance."""
        slots: list[int] = []
        seen: set[int] = set()
        for landmark in ids.tolist():
            slot = self._slot_of.get(landmark, NEW)
            if landmark < 0 or landmark in seen:
                slot = IGNORED
            elif slot == NEW and len(self._slot_of) == self.config.landmarks.max_landmarks:
                slot = REFUSED
            elif slot == NEW:
                self._slot_of[landmark] = len(self._slot_of)
            seen.add(landmark)
            slots.append(slot)
        return np.array(slots, dtype=np.int32)

    def _take(self, t_ns: int, slots: Decisions, range_m: Floats, bearing_rad: Floats) -> Decisions:
        """Let every particle see the scan; gives what the then best one made of it, (m,)."""
        m, config = range_m.size, self.config
        scan = self._scan(range_m, bearing_rad)
        needed = min(int(self._cloud.landmarks.max()) + m, config.landmarks.max_landmarks)
        if needed > self._cloud.evidence.shape[1]:
            twice = 2 * self._cloud.evidence.shape[1]
            self._cloud = grown(
                self._cloud, min(max(needed, twice), config.landmarks.max_landmarks)
            )
        decisions = np.empty((config.particles, m), dtype=np.int32)
        added = np.zeros(m, dtype=np.bool_)
        kernels.update(
            self._cloud,
            scan,
            self._rules(scan),
            slots,
            self.association == "known",
            new_scratch(m, self._cloud.evidence.shape[1]),
            decisions,
            self._removed,
            len(self._births),
            added,
        )
        if np.any(added):
            self._births.append(t_ns, self._pose, range_m, bearing_rad, added)
        self._best = int(np.argmax(self._cloud.log_weight))
        best: Decisions = decisions[self._best]
        return best

    def _scan(self, range_m: Floats, bearing_rad: Floats) -> Scan:
        noise = self.config.observation
        range_sigma = np.hypot(noise.range_sigma_m, noise.range_sigma_per_m * range_m)
        across = range_m * noise.bearing_sigma_rad
        log_peak = -np.log(2.0 * math.pi * noise.bearing_sigma_rad * range_sigma)
        likely = 2.0 * (log_peak - math.log(self.config.new_density_per_m_rad))
        return Scan(
            cos=np.cos(bearing_rad),
            sin=np.sin(bearing_rad),
            range_m=range_m,
            var_along=range_sigma**2,
            var_across=across**2,
            log_peak=log_peak,
            likely=likely,
            widest=np.maximum(np.minimum(self.config.accept_gate, likely), self.config.spawn_gate),
            gain=landmarks.gains(range_m, self._landmark_rules),
        )

    def _rules(self, scan: Scan) -> Rules:
        config = self.config
        reach_m = self._reach_m
        if scan.range_m.size:
            self._largest_variance = max(
                self._largest_variance, scan.var_along.max(), scan.var_across.max()
            )
            # No landmark is less certain than when it was new: C <= 2 v, so that S <= 3 v.
            slack_m = math.sqrt(3.0 * float(scan.widest.max()) * self._largest_variance)
            reach_m = max(reach_m, float(scan.range_m.max()) + slack_m)
        known = self.association == "known"
        return Rules(
            accept=config.accept_gate,
            spawn=config.spawn_gate,
            innovation=config.innovation_gate if known else math.inf,
            tail=config.tail_gate,
            log_new=math.log(config.new_density_per_m_rad),
            reach_m=reach_m,
            landmarks=self._landmark_rules,
            eye=self._eye.copy(),
            next_eye=self._eye,
            observer=self._best,
            max_landmarks=config.landmarks.max_landmarks,
        )

    def _weigh_and_resample(self) -> None:
        """Mean and spread with the weights as they are, then a new cloud if it is time."""
        cloud, particles = self._cloud, self.config.particles
        self._weights = normalised_weights(cloud.log_weight)
        moments(cloud, self._weights, self._pose.copy(), self._pose, self._covariance)
        offset = self._random.random()
        effective = 1.0 / float(self._weights @ self._weights)
        # Rounding lets equal weights pass for a hair more than all particles.
        if effective <= self.config.resample_below * particles * (1.0 + 1e-9):
            copies = offspring(self._weights, offset)
            resample(cloud, copies)
            self._weights = np.full(particles, 1.0 / particles)

    def estimated_map(self) -> EstimatedMap:
        """The confirmed landmarks of the best particle, with covariances given its path."""
        cloud, best = self._cloud, self._best
        used = np.arange(cloud.landmarks[best])
        believed = cloud.seen[best, used] >= self.config.min_seen
        if self.association != "known":
            believed &= cloud.evidence[best, used] >= self.config.landmarks.confirm_log_odds
        used = used[believed]
        births = cloud.birth[best, used]
        xx, xy, yy = cloud.covariance[best, used].T
        positions = np.stack([cloud.landmark_x[best, used], cloud.landmark_y[best, used]], axis=1)
        ids = births.astype(np.int64) + 1
        if self.association == "known":
            ids = np.array(list(self._slot_of), dtype=np.int64)[used]
        record = self._births.of(births)
        return EstimatedMap(
            LandmarkMap(ids, positions, np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)),
            t_added_ns=record.t_ns,
            added_from=record.car,
            range_added_m=record.range_m,
            n_seen=cloud.seen[best, used].astype(np.int64),
            t_first_ns=self._births.first_near(
                positions, record.t_ns, self.config.landmarks.same_place_m
            ),
        )


FASTSLAM = Algorithm(FASTSLAM_PRESETS, FASTSLAM_ASSOCIATIONS, FastSlam)
