"""A small world, and FastSLAM's landmark filter as the book has it: slow, polar, independent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats, between, compose, planar_umeyama, transform_points, wrap
from slam.interface import Slam

RANGE_SIGMA_M = 0.04
BEARING_SIGMA_RAD = np.radians(1.0)
STEP_SIGMA = np.array([0.01, 0.01, np.radians(0.5)])
"""Of one odometry step."""
RADIUS_M, SEEN_TO_M = 1.6, 3.0


@dataclass(frozen=True)
class Drive:
    """What a filter made of the world: mean position error, also after aligning the path."""

    mean_error_m: float
    aligned_error_m: float
    missing: int
    surplus: int


def ring(n: int, radius_m: float = 2.0) -> Floats:
    angle = np.linspace(-np.pi, np.pi, n, endpoint=False)
    return radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def seen_from(pose: Floats, landmarks: Floats) -> tuple[Floats, Floats]:
    dx, dy = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    return np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - pose[2])


def laps(slam: Slam, seed: int, *, laps: int = 2, steps: int = 100, clutter: float = 0.0) -> Drive:
    """Two laps of 10 m on a circle between ten inner and ten outer cones, seen to 3 m."""
    random = np.random.default_rng(seed)
    cones = np.concatenate([ring(10, 1.0), ring(10, 2.2)]) + np.array([0.0, RADIUS_M])
    turn = 2.0 * np.pi / steps
    after = np.array([RADIUS_M * np.sin(turn), RADIUS_M * (1.0 - np.cos(turn)), turn])
    step = between(np.zeros(3), after)
    truth, path = np.zeros(3), []
    for k in range(laps * steps):
        truth = compose(truth, step)
        noisy = step + random.normal(0.0, STEP_SIGMA)
        slam.predict(noisy[None], np.array([1.0 / 15.0]))
        ranges, bearings = seen_from(truth, cones)
        ids = np.flatnonzero(ranges < SEEN_TO_M)
        ranges = ranges[ids] + random.normal(0.0, RANGE_SIGMA_M, ids.size)
        bearings = bearings[ids] + random.normal(0.0, BEARING_SIGMA_RAD, ids.size)
        false = random.random(ids.size) < clutter
        ranges[false] = random.uniform(0.3, SEEN_TO_M, np.count_nonzero(false))
        bearings[false] = random.uniform(-np.pi, np.pi, np.count_nonzero(false))
        slam.update(k, ids, ranges, wrap(bearings))
        path.append((slam.pose[:2], truth[:2]))
    estimated, true = np.array(path).transpose(1, 0, 2)
    moved = transform_points(planar_umeyama(estimated, true), estimated)
    made = slam.estimated_map().landmarks.positions
    apart = np.hypot(*(made[:, None] - cones[None]).transpose(2, 0, 1))
    near = apart < 0.3
    found = int(np.count_nonzero(near.any(axis=0)))
    return Drive(
        _mean_distance(estimated, true),
        _mean_distance(moved, true),
        cones.shape[0] - found,
        len(made) - found,
    )


def _mean_distance(one: Floats, other: Floats) -> float:
    return float(np.mean(np.hypot(*(one - other).T)))


def polar_update(
    pose: Floats, mean: Floats, P: Floats, range_m: float, bearing_rad: float, R: Floats
) -> tuple[Floats, Floats, float]:
    """Extended Kalman filter of one landmark, Joseph form, and the density of the observation."""
    dx, dy = mean - pose[:2]
    q = dx * dx + dy * dy
    r = np.sqrt(q)
    H = np.array([[dx / r, dy / r], [-dy / q, dx / q]])
    nu = np.array([range_m - r, float(wrap(bearing_rad - np.arctan2(dy, dx) + pose[2]))])
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    keep = np.eye(2) - K @ H
    density = np.exp(-0.5 * nu @ np.linalg.solve(S, nu)) / (2 * np.pi * np.sqrt(np.linalg.det(S)))
    return mean + K @ nu, keep @ P @ keep.T + K @ R @ K.T, float(density)
