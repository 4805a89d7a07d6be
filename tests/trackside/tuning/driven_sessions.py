"""Short sessions with truth, on which a run of SLAM takes milliseconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from capture import GroundTruth, Observations, Odometry, Session, SessionInfo
from geometry import LandmarkMap, Trajectory

S = 1_000_000_000
CONES = np.array([[1.0, 0.8], [1.0, -0.8], [2.0, 0.7], [2.2, -0.9]])


def make_session(folder: Path, seed: int = 0, *, truth: bool = True) -> Path:
    """Three seconds past four cones, with noise of that seed."""
    random = np.random.default_rng(seed)
    t_ns = S + np.arange(31) * (S // 10)
    true = np.stack([np.linspace(0.0, 1.5, 31), np.zeros(31), np.zeros(31)], axis=1)
    driven = true + np.cumsum(random.normal(0.0, 0.002, true.shape), axis=0)
    offset = CONES[None] - true[:, None, :2]
    ranges = np.hypot(offset[..., 0], offset[..., 1]) + random.normal(0.0, 0.02, (31, 4))
    bearings = np.arctan2(offset[..., 1], offset[..., 0]) + random.normal(0.0, 0.01, (31, 4))
    seen = Observations(
        np.repeat(t_ns, 4), np.full(124, -1), ranges.reshape(-1), bearings.reshape(-1)
    )
    with Session.create(folder, SessionInfo()) as writer:
        writer.add_odometry(Odometry("wheel", t_ns, driven, np.ones(31), np.zeros(31)))
        writer.add_observations(seen)
        if truth:
            cones = LandmarkMap(np.arange(4), CONES)
            writer.add_ground_truth(GroundTruth(Trajectory.from_poses(t_ns, true), cones))
    return folder


def make_sessions(folder: Path, count: int = 3) -> Path:
    """A folder of them."""
    for seed in range(count):
        make_session(folder / f"run{seed}", seed)
    return folder
