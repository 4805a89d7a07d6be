"""Small worlds with known errors for the tests of scoring."""

from __future__ import annotations

import numpy as np

from capture import Estimate, EstimatedMap, GroundTruth
from geometry import Floats, LandmarkMap, SpacePath, Stamps, Trajectory, wrap

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 50_000_000


def stamps(count: int, period_ns: int = PERIOD_NS, start_ns: int = START_NS) -> Stamps:
    return start_ns + np.arange(count, dtype=np.int64) * period_ns


def lap(count: int = 200, radius_m: float = 2.0) -> Trajectory:
    """One counter-clockwise round at constant speed, starting at (radius, 0) and heading +y."""
    angle: Floats = np.arange(float(count)) * (2.0 * np.pi / (count - 1))
    return Trajectory(
        stamps(count),
        radius_m * np.cos(angle),
        radius_m * np.sin(angle),
        wrap(angle + np.pi / 2),
    )


def straight(count: int = 50, speed_m_s: float = 1.0) -> Trajectory:
    """Along +x from the origin."""
    t_s: Floats = np.arange(float(count)) * PERIOD_NS * 1e-9
    return Trajectory(stamps(count), speed_m_s * t_s, np.zeros(count), np.zeros(count))


def landmark_map(positions: object, covariances: Floats | None = None) -> LandmarkMap:
    xy = np.asarray(positions, dtype=np.float64).reshape(-1, 2)
    return LandmarkMap(np.arange(len(xy)), xy, covariances)


def ring(count: int = 8, radius_m: float = 2.5) -> LandmarkMap:
    angle = np.arange(count) * 2.0 * np.pi / count
    return landmark_map(radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def truth_lap() -> GroundTruth:
    return GroundTruth(lap(), ring())


def estimate_of(
    truth: GroundTruth, *, shift: tuple[float, float] = (0.0, 0.0), name: str = "ekf"
) -> Estimate:
    """The truth itself as an estimate, its landmarks added one by one and moved by `shift`."""
    assert truth.landmarks is not None
    count = len(truth.landmarks)
    t_added_ns = truth.path.t_ns[10 + 5 * np.arange(count)]
    return Estimate(
        name,
        truth.path,
        EstimatedMap(
            landmark_map(truth.landmarks.positions + np.array(shift)),
            t_added_ns=t_added_ns,
            added_from=truth.path.interpolated(t_added_ns).positions,
        ),
    )


def map_columns(estimate: Estimate) -> tuple[LandmarkMap, Stamps, Floats]:
    """Landmarks, times and places of adding of an estimate that has them all."""
    own = estimate.map
    assert own is not None
    assert own.t_added_ns is not None
    assert own.added_from is not None
    return own.landmarks, own.t_added_ns, own.added_from


def space_spiral(count: int = 100) -> SpacePath:
    """A climbing spiral whose body turns with it."""
    angle = np.linspace(0.0, 6.0, count)
    positions = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    zeros = np.zeros(count)
    quaternions = np.stack([zeros, zeros, np.sin(angle / 2), np.cos(angle / 2)], axis=1)
    return SpacePath(stamps(count), positions, quaternions)
