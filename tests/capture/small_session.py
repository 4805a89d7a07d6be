"""A small session that the tests of this room share."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from capture import (
    Estimate,
    EstimatedMap,
    GroundTruth,
    Observations,
    Odometry,
    Session,
    SessionInfo,
)
from geometry import LandmarkMap, Trajectory

START_NS = 1_700_000_000_123_456_789
PERIOD_NS = 20_000_000


def odometry(source: str = "wheel", n: int = 50) -> Odometry:
    t_ns = START_NS + PERIOD_NS * np.arange(n)
    heading = np.linspace(-3.0, 3.0, n)
    pose = np.stack([np.sin(heading), np.cos(heading), heading], axis=1)
    return Odometry(source, t_ns, pose, np.full(n, 1.5), np.linspace(-0.3, 0.3, n))


def observations() -> Observations:
    t_ns = START_NS + PERIOD_NS * np.array([0, 0, 0, 7, 9, 9])
    ids = np.array([3, 5, -1, 3, 3, 5])
    return Observations(t_ns, ids, np.linspace(0.5, 2.0, 6), np.linspace(-1.0, 1.0, 6))


def trajectory(n: int = 20) -> Trajectory:
    rng = np.random.default_rng(5)
    t_ns = START_NS + np.cumsum(rng.integers(1, PERIOD_NS, n))
    return Trajectory(t_ns, rng.normal(size=n), rng.normal(size=n), rng.uniform(-3.1, 3.1, n))


def landmarks() -> LandmarkMap:
    covariances = np.array([[[0.04, 0.01], [0.01, 0.09]], [[0.1, 0.0], [0.0, 0.2]]])
    return LandmarkMap(np.array([7, 2]), np.array([[1.1, 2.2], [0.1, -0.3]]), covariances)


def estimate(name: str = "ekf") -> Estimate:
    path = trajectory()
    root = np.random.default_rng(6).normal(size=(len(path), 3, 3))
    mapped = EstimatedMap(
        landmarks(),
        t_added_ns=np.array([START_NS, START_NS + 1]),
        added_from=np.array([[0.0, 0.5], [1 / 3, -2.0]]),
        range_added_m=np.array([1.5, 2.5]),
        n_seen=np.array([4, 9]),
        t_first_ns=np.array([START_NS - 5, START_NS]),
    )
    return Estimate(
        name, path, mapped, root @ root.transpose(0, 2, 1), {"seed": 3, "gates": (1, 2)}
    )


def make_session(folder: Path, *sources: str) -> Session:
    """A session in `folder` with odometry of `sources` (one, `wheel`, by default) and truth."""
    with Session.create(folder, SessionInfo(map="turn", trial=2)) as writer:
        for source in sources or ("wheel",):
            writer.add_odometry(odometry(source))
        writer.add_observations(observations())
        writer.add_ground_truth(GroundTruth(trajectory(), landmarks(), {"by": "test"}))
    return Session.open(folder)
