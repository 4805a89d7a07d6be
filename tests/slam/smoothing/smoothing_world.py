"""A drive in laps past a few landmarks: what was true, what was measured, a first estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import Estimate, EstimatedMap, Observations, Odometry
from geometry import Floats, LandmarkMap, Trajectory, compose, wrap
from slam.config import MotionNoise, ObservationNoise
from slam.smoothing.config import SmoothingConfig
from slam.smoothing.problem import Problem, problem_of
from slam.smoothing.smoother import smooth

S = 1_000_000_000
START_NS = 1_700_000_000 * S
CONFIG = SmoothingConfig(
    motion=MotionNoise(xy_sigma_m_per_sqrt_s=0.02, heading_sigma_rad_per_sqrt_s=0.02),
    observation=ObservationNoise(range_sigma_m=0.03, bearing_sigma_rad=0.02),
    loss="none",
    tolerance=1e-8,
)
ODOMETRY_HZ, SCANS_HZ = 10.0, 2.0


@dataclass
class World:
    """One drive: what was true, what was measured, and a first estimate by dead reckoning."""

    truth: Trajectory
    landmarks: Floats
    odometry: Odometry
    observations: Observations
    estimate: Estimate

    @property
    def ids(self) -> npt.NDArray[np.int64]:
        return self.observations.landmark_id

    def smoothed(self, config: SmoothingConfig = CONFIG) -> Estimate:
        return smooth(self.estimate, self.odometry, self.observations, self.ids, config)

    def problem(self, config: SmoothingConfig = CONFIG) -> Problem:
        return problem_of(self.estimate, self.odometry, self.observations, self.ids, config)

    def path_error_m(self, estimate: Estimate) -> float:
        off = estimate.path.positions - self.truth.interpolated(estimate.path.t_ns).positions
        return float(np.hypot(*off.T).mean())

    def map_error_m(self, estimate: Estimate) -> float:
        assert estimate.map is not None
        found = estimate.map.landmarks
        return float(np.hypot(*(found.positions - self.landmarks[found.ids - 1]).T).mean())


def world(
    seed: int = 0, duration_s: float = 20.0, noise: float = 1.0, outliers: float = 0.0, n: int = 6
) -> World:
    """Laps of a circle with a halt, noise as `CONFIG` says times `noise`."""
    draw = np.random.default_rng(seed)
    steps = round(duration_s * ODOMETRY_HZ)
    moving = (np.arange(steps) < 0.4 * steps) | (np.arange(steps) > 0.5 * steps)
    step = np.outer(moving, [0.08, 0.0, 0.06])
    sigma = noise * 0.02 / np.sqrt(ODOMETRY_HZ)
    told = step + moving[:, None] * draw.normal(0.0, sigma, (steps, 3)) if noise else step
    t_ns = START_NS + np.arange(steps + 1) * round(S / ODOMETRY_HZ)
    truth = Trajectory.from_poses(t_ns, laid(step))
    odometry = Odometry("wheel", t_ns, laid(told), np.zeros(steps + 1), np.zeros(steps + 1))
    angle = np.arange(n) * 2.0 * np.pi / n
    landmarks = np.stack([2.2 * np.cos(angle) + 0.1, 2.2 * np.sin(angle) + 1.3], axis=1)
    scan_ns = START_NS + round(0.33 * S) + np.arange(round(duration_s * SCANS_HZ) - 2) * (S // 2)
    seen = sights(truth.interpolated(scan_ns), landmarks)
    far = draw.random(seen.range_m.size) < outliers
    ranges = (
        seen.range_m
        + draw.normal(0.0, noise * 0.03, far.size)
        + far * draw.uniform(0.5, 2.0, far.size)
    )
    bearings = wrap(
        seen.bearing_rad
        + draw.normal(0.0, noise * 0.02, far.size)
        + far * draw.normal(0, 0.5, far.size)
    )
    seen = Observations(seen.t_ns, seen.landmark_id, ranges, bearings)
    return World(truth, landmarks, odometry, seen, dead_reckoned(odometry, seen))


def laid(steps: Floats) -> Floats:
    poses = [np.zeros(3)]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def sights(path: Trajectory, landmarks: Floats) -> Observations:
    """Every landmark nearer than 3 m, from every pose."""
    rows: list[tuple[int, int, float, float]] = []
    for t, pose in zip(path.t_ns.tolist(), path.poses, strict=True):
        off = landmarks - pose[:2]
        for i in np.flatnonzero(np.hypot(*off.T) < 3.0).tolist():
            bearing = float(wrap(np.arctan2(off[i, 1], off[i, 0]) - pose[2]))
            rows.append((t, i + 1, float(np.hypot(*off[i])), bearing))
    t_ns, ids, ranges, bearings = zip(*rows, strict=True)
    return Observations(np.array(t_ns), np.array(ids), np.array(ranges), np.array(bearings))


def dead_reckoned(odometry: Odometry, seen: Observations) -> Estimate:
    path = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    path = path.interpolated(np.union1d(path.t_ns, seen.t_ns))
    ids, first = np.unique(seen.landmark_id, return_index=True)
    poses = path.interpolated(np.unique(seen.t_ns)).poses
    pose = poses[np.searchsorted(np.unique(seen.t_ns), seen.t_ns[first])]
    direction = pose[:, 2] + seen.bearing_rad[first]
    offset = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    positions = pose[:, :2] + seen.range_m[first, None] * offset
    entered = EstimatedMap(LandmarkMap(ids, positions), t_added_ns=seen.t_ns[first], n_seen=ids * 7)
    return Estimate("dead", path, entered, None, {"algorithm": "none"})
