"""FastSLAM 2.0 with known or per-particle maximum likelihood association."""

from __future__ import annotations

import dataclasses

import numpy as np

from geometry import Floats
from slam.fastslam.cloud import grown, moments, normalised_weights, offspring, resample
from slam.fastslam.config import FASTSLAM_PRESETS, FastSlamConfig
from slam.fastslam.filter import FASTSLAM_ASSOCIATIONS, FastSlam
from slam.fastslam.kernels import update
from slam.fastslam.scan import Decisions, new_scratch
from slam.fastslam2.kernels import draw, propose
from slam.interface import Algorithm
from slam.motion import propagate

FASTSLAM2_PRESETS = {
    # A fifth of the particles of FastSLAM 1.0: benchmarks/algorithms.py has both side by side.
    "robust": dataclasses.replace(FASTSLAM_PRESETS["robust"], particles=100),
}


class FastSlam2(FastSlam):
    """FastSLAM whose particles are drawn where motion *and* scan say that the car may be.

    Between scans nothing is drawn: all particles have made the same motion with the same doubt,
    kept once. At a scan each particle's pose is a Gaussian that its own sightings narrow; its
    weight is how likely they were before. As that does not depend on what will be drawn, the cloud
    is resampled first and drawn afterwards, so that copies of one particle differ. Maps are then
    those of FastSLAM 1.0, given the pose. Everything else is as there.
    """

    def __init__(self, config: FastSlamConfig, association: str, seed: int = 0) -> None:
        super().__init__(config, association, seed)
        self._moved, self._moved_covariance = np.zeros(3), np.zeros((3, 3))

    def predict(self, increments: Floats, dt_s: Floats) -> tuple[Floats, Floats]:
        """Move by increments (k, 3) over dt_s (k,): poses (k, 3), covariances (k, 3, 3)."""
        poses, covariances = np.empty((len(increments), 3)), np.empty((len(increments), 3, 3))
        for pose, covariance in (
            (self._moved, self._moved_covariance),
            (self._pose, self._covariance),
        ):
            propagate(pose, covariance, increments, dt_s, self._motion_noise, poses, covariances)
        return poses, covariances

    def _take(self, t_ns: int, slots: Decisions, range_m: Floats, bearing_rad: Floats) -> Decisions:
        """Propose, resample, draw, and let the maps see the scan; the best one's decisions (m,)."""
        m, config, known = range_m.size, self.config, self.association == "known"
        scan = self._scan(range_m, bearing_rad)
        rules = self._rules(scan)
        self._make_room(m)
        scratch = new_scratch(m, self._cloud.evidence.shape[1])
        decisions = np.empty((config.particles, m), dtype=np.int32)
        roots = np.empty((config.particles, 3, 3))
        propose(
            self._cloud, self._moved, self._moved_covariance, scan, rules, slots, known, scratch,
            roots,
        )  # fmt: skip
        self._best = int(np.argmax(self._cloud.log_weight))
        draw(self._cloud, self._resampled(roots), self._random.standard_normal(roots.shape[:2]))
        self._moved[:], self._moved_covariance[:] = 0.0, 0.0
        # The proposal has weighed the scan already.
        weights = self._cloud.log_weight.copy()
        added = np.zeros(m, dtype=np.bool_)
        update(
            self._cloud, scan, rules, slots, known, scratch, decisions, self._removed,
            len(self._births), added,
        )  # fmt: skip
        self._cloud.log_weight[:] = weights
        if np.any(added):
            self._births.append(t_ns, self._pose, range_m, bearing_rad, added)
        best: Decisions = decisions[self._best]
        return best

    def _make_room(self, m: int) -> None:
        most, room = self.config.landmarks.max_landmarks, self._cloud.evidence.shape[1]
        needed = min(int(self._cloud.landmarks.max()) + m, most)
        if needed > room:
            self._cloud = grown(self._cloud, min(max(needed, 2 * room), most))

    def _resampled(self, roots: Floats) -> Floats:
        """A new cloud if it is time; the roots (N, 3, 3) that its particles then have."""
        particles, offset = self.config.particles, self._random.random()
        self._weights = normalised_weights(self._cloud.log_weight)
        effective = 1.0 / float(self._weights @ self._weights)
        # Rounding lets equal weights pass for a hair more than all particles.
        if effective > self.config.resample_below * particles * (1.0 + 1e-9):
            return roots
        copies = offspring(self._weights, offset)
        ancestors = np.arange(particles)
        # In the order in which `resample` fills the places of the dead.
        ancestors[copies == 0] = np.repeat(ancestors, np.maximum(copies - 1, 0))
        resample(self._cloud, copies)
        self._weights = np.full(particles, 1.0 / particles)
        drawn: Floats = roots[ancestors]
        return drawn

    def _weigh_and_resample(self) -> None:
        """Mean and spread of the cloud: it has been resampled before it was drawn."""
        moments(self._cloud, self._weights, self._pose.copy(), self._pose, self._covariance)


FASTSLAM2 = Algorithm(FASTSLAM2_PRESETS, FASTSLAM_ASSOCIATIONS, FastSlam2)
