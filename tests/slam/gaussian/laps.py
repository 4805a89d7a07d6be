"""Laps of a car around a ring of landmarks, with exactly the noise that the filters are told."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from geometry import Floats, compose, transform_points, wrap
from slam.config import EkfConfig, MotionNoise, ObservationNoise
from slam.interface import Slam

DT_S = 0.1
CONFIG = EkfConfig(
    motion=MotionNoise(xy_sigma_m_per_sqrt_s=0.02, heading_sigma_rad_per_sqrt_s=0.01),
    observation=ObservationNoise(range_sigma_m=0.04, bearing_sigma_rad=0.02),
    accept_gate=9.21,
    spawn_gate=25.0,
)


def ring(n: int, radius_m: float) -> Floats:
    angle = np.linspace(-np.pi, np.pi, n, endpoint=False)
    return radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)


CONES = transform_points(np.array([0.0, 1.5, 0.0]), np.concatenate([ring(8, 1.0), ring(8, 2.5)]))


def seen_from(pose: Floats, landmarks: Floats) -> tuple[Floats, Floats]:
    dx, dy = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    return np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - pose[2])


def with_heading_noise(sigma_rad_per_step: float) -> EkfConfig:
    per_sqrt_s = sigma_rad_per_step / math.sqrt(DT_S)
    motion = dataclasses.replace(CONFIG.motion, heading_sigma_rad_per_sqrt_s=per_sqrt_s)
    return dataclasses.replace(CONFIG, motion=motion)


def lap(
    motion: MotionNoise, seed: int, scans: int
) -> Iterator[tuple[Floats, Floats, npt.NDArray[np.int64], Floats, Floats]]:
    """True pose, odometry increment, and ids, ranges, bearings of each scan."""
    random, truth = np.random.default_rng(seed), np.zeros(3)
    sigma = np.array([motion.xy_sigma_m_per_sqrt_s] * 2 + [motion.heading_sigma_rad_per_sqrt_s])
    for _ in range(scans):
        step = np.array([0.1, 0.0, 0.1 / 1.5])
        truth = compose(truth, step)
        measured = step + random.normal(0.0, sigma) * math.sqrt(DT_S)
        ranges, bearings = seen_from(truth, CONES)
        near = np.flatnonzero(ranges < 2.0)
        ranges = ranges[near] + random.normal(0.0, 0.04, near.size)
        bearings = wrap(bearings[near] + random.normal(0.0, 0.02, near.size))
        yield truth, measured, near.astype(np.int64), ranges, bearings


def pose_nees(slam: Slam, motion: MotionNoise, seed: int, scans: int = 100) -> Floats:
    """(scans,): how far each pose is off, by its own covariance."""
    nees = []
    for k, (truth, measured, ids, ranges, bearings) in enumerate(lap(motion, seed, scans)):
        slam.predict(measured[None], np.array([DT_S]))
        slam.update(k, ids, ranges, bearings)
        error = slam.pose - truth
        error[2] = wrap(error[2])
        nees.append(error @ np.linalg.solve(slam.pose_covariance, error))
    return np.array(nees)
