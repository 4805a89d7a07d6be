"""What must hold of all algorithms alike: their presets, on a small world, and on bad input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import world

from geometry import Floats, wrap
from slam.catalogue import ALGORITHMS
from slam.config import MotionNoise
from slam.interface import Slam

NAMES = ("ekf", "ekf-fej", "ukf", "fastslam", "fastslam2", "smoother")
FIGURES = ("matched", "added", "ignored", "rejected", "invalid", "over_limit")
DT_S = np.array([1.0 / world.RATE_HZ])
STILL = np.zeros((1, 3))


def made(name: str, association: str = "known", seed: int = 0) -> Slam:
    algorithm = ALGORITHMS[name]
    return algorithm.make(algorithm.presets["robust"], association, seed)


def unnamed(name: str) -> str:
    return str(ALGORITHMS[name].associations[1])


def seen(pose: Floats, places: Floats) -> tuple[Floats, Floats]:
    dx, dy = places[:, 0] - pose[0], places[:, 1] - pose[1]
    return np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - pose[2])


def test_these_are_all() -> None:
    assert set(NAMES) == {name for name in ALGORITHMS if ALGORITHMS.distribution(name) is None}


@pytest.mark.parametrize("name", NAMES)
def test_with_known_ids_the_map_is_right_and_the_path_near(name: str) -> None:
    driven = world.drive("loop", 200, world.Noise(clutter=0.0))
    slam, errors = made(name), []
    for k, (ids, ranges, bearings) in enumerate(driven.scans):
        if k > 0:
            slam.predict(driven.increments[k - 1 : k], DT_S)
        slam.update(k, ids, ranges, bearings)
        errors.append(np.hypot(*(slam.pose - driven.poses[k])[:2]))
    landmarks = slam.estimated_map().landmarks
    assert np.mean(errors) < 0.03
    assert set(landmarks.ids.tolist()) == set(range(len(driven.cones)))
    off = np.hypot(*(landmarks.positions - driven.cones[landmarks.ids]).T)
    assert off.max() < 0.06


@pytest.mark.parametrize("name", NAMES)
def test_without_names_the_map_is_right_among_clutter(name: str) -> None:
    found = world.run(made(name, unnamed(name)), world.drive("s-curve", 201))
    assert found.position_m < 0.04
    assert (found.false_negatives, found.false_positives) == (0, 0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("known", [True, False])
def test_cones_dead_astern_are_seen_once(name: str, known: bool) -> None:
    """Bearings jump between +180 and -180 degrees, and so does the heading of a turning car."""
    slam = made(name, "known" if known else unnamed(name))
    random, cones = np.random.default_rng(3), np.array([[-1.2, 0.0], [-0.9, 0.002], [1.0, 0.7]])
    turn = np.array([[0.0, 0.0, np.pi / 20]])
    pose = np.zeros(3)
    for t in range(80):
        if t >= 40:
            slam.predict(turn, DT_S)
            pose[2] = wrap(pose[2] + np.pi / 20)
        ranges, bearings = seen(pose, cones)
        bearings = wrap(bearings + random.normal(0.0, 0.01, 3))
        slam.update(t, np.arange(3) if known else np.full(3, -1), ranges, bearings)
    landmarks = slam.estimated_map().landmarks
    assert len(landmarks.ids) == 3
    nearest = np.hypot(*(cones[:, None] - landmarks.positions[None]).transpose(2, 0, 1)).min(axis=1)
    assert nearest.max() < 0.05
    assert abs(wrap(slam.pose[2] - pose[2])) < 0.05


@pytest.mark.parametrize("name", NAMES)
def test_standing_still_adds_no_noise(name: str) -> None:
    slam = made(name)
    poses, covariances = slam.predict(np.repeat(STILL, 50, axis=0), np.full(50, 0.1))
    assert not poses.any()
    assert not covariances.any()
    slam.update(0, np.array([1, 2]), np.array([1.0, 1.2]), np.array([0.3, -2.0]))
    slam.predict(np.array([[0.2, 0.0, 0.1]]), np.array([0.1]))
    slam.update(1, np.array([1, 2]), np.array([0.8, 1.35]), np.array([0.3, -2.2]))
    slam.predict(STILL, DT_S)  # FastSLAM 1.0 tells the spread of its new cloud from here on
    before = slam.pose_covariance
    slam.predict(np.repeat(STILL, 50, axis=0), np.full(50, 0.1))
    np.testing.assert_allclose(slam.pose_covariance, before, atol=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_the_same_data_and_seed_give_the_same_to_the_bit(name: str) -> None:
    driven = world.drive("turn", 202)

    def ran(seed: int) -> tuple[Floats, Floats]:
        slam = made(name, unnamed(name), seed)
        world.run(slam, driven)
        return slam.pose, slam.estimated_map().landmarks.positions

    (pose, places), (again, same) = ran(5), ran(5)
    np.testing.assert_array_equal(pose, again)
    np.testing.assert_array_equal(places, same)
    if name.startswith("fastslam"):
        assert ran(6)[0][0] != pose[0]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("known", [True, False])
def test_bad_observations_are_counted_and_change_nothing(name: str, known: bool) -> None:
    slam = made(name, "known" if known else unnamed(name))
    slam.update(0, np.array([1, 2]), np.array([1.0, 1.2]), np.array([0.3, -2.0]))
    before = slam.estimated_map().landmarks.positions
    bad = np.array([np.nan, 1.0, np.inf, 0.0, -1.0]), np.array([0.0, np.nan, 0.0, 1.0, 0.1])
    report = slam.update(1, np.arange(11, 16), *bad)
    assert report.invalid == 5
    assert sum(getattr(report, figure) for figure in FIGURES) == 5
    np.testing.assert_array_equal(slam.estimated_map().landmarks.positions, before)
    none = np.empty(0)
    assert slam.update(2, np.empty(0, dtype=np.int64), none, none).matched == 0


@pytest.mark.parametrize("name", NAMES)
def test_a_scan_of_ten_thousand_points_of_clutter_stays_bounded(name: str) -> None:
    slam, random = made(name, unnamed(name)), np.random.default_rng(1)
    n = 10_000
    report = slam.update(
        0, np.full(n, -1), random.uniform(0.3, 2.0, n), random.uniform(-3.0, 3.0, n)
    )
    assert sum(getattr(report, figure) for figure in FIGURES) == n
    assert report.over_limit > 9_000
    assert report.added <= 512


@pytest.mark.parametrize("name", NAMES)
def test_no_motion_noise_and_a_step_of_no_time_are_no_trouble(name: str) -> None:
    algorithm = ALGORITHMS[name]
    sure = MotionNoise(xy_sigma_m_per_sqrt_s=0.0, heading_sigma_rad_per_sqrt_s=0.0)
    slam = algorithm.make(dataclasses.replace(algorithm.presets["robust"], motion=sure), "known", 0)
    for t in range(25):
        slam.predict(np.array([[0.05, 0.0, 0.01]]), np.zeros(1))
        slam.update(t, np.array([1]), np.array([1.0]), np.array([0.2]))
    assert np.isfinite(slam.pose).all()
    assert np.isfinite(slam.pose_covariance).all()
