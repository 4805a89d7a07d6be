from __future__ import annotations

import math

import numpy as np
import pytest

from slam.config import MotionNoise
from slam.fastslam.cloud import (
    Cloud,
    columns,
    grown,
    move,
    new_cloud,
    normalised_weights,
    offspring,
    resample,
)
from slam.motion import noise_array, propagate


def filled(particles: int, capacity: int = 4) -> Cloud:
    """Every entry different, so that a column forgotten in a copy shows."""
    cloud = new_cloud(particles, capacity)
    for column in columns(cloud):
        column[...] = np.arange(column.size).reshape(column.shape)
    cloud.landmarks[:] = capacity
    return cloud


def test_a_copy_shares_nothing_with_its_original() -> None:
    cloud = filled(4)
    expected = [column[2].copy() for column in columns(cloud)]
    resample(cloud, np.array([0, 1, 3, 0]))
    for place in (0, 2, 3):
        for column, wanted in zip(columns(cloud)[4:], expected[4:], strict=True):
            np.testing.assert_array_equal(column[place], wanted)
    cloud.landmark_x[2, 1], cloud.covariance[2, 1, 0] = -99.0, -99.0
    assert cloud.landmark_x[0, 1] == cloud.landmark_x[3, 1] == expected[5][1]
    assert cloud.covariance[0, 1, 0] == expected[7][1, 0]
    for one in columns(cloud):
        assert sum(np.shares_memory(one, other) for other in columns(cloud)) == 1


def test_survivors_stay_where_they_are() -> None:
    cloud, before = filled(5), filled(5)
    resample(cloud, np.array([2, 0, 1, 2, 0]))
    for p in (0, 2, 3):
        assert cloud.x[p] == before.x[p]
        np.testing.assert_array_equal(cloud.landmark_x[p], before.landmark_x[p])
    assert sorted(cloud.x.tolist()) == [0.0, 0.0, 2.0, 3.0, 3.0]


def test_systematic_resampling_is_unbiased_and_never_off_by_one() -> None:
    random = np.random.default_rng(2)
    weights = random.random(37) ** 4
    weights /= weights.sum()
    offsets = (np.arange(2000) + 0.5) / 2000
    drawn = np.array([offspring(weights, offset) for offset in offsets])
    assert (drawn.sum(axis=1) == 37).all()
    assert np.abs(drawn - 37 * weights).max() < 1.0
    np.testing.assert_allclose(drawn.mean(axis=0), 37 * weights, atol=1e-3)


@pytest.mark.parametrize("offset", [0.0, 0.5, 1.0 - 1e-16])
def test_equal_weights_keep_all_and_one_weight_takes_all(offset: float) -> None:
    assert offspring(np.full(1000, 1e-3), offset).sum() == 1000
    only = np.zeros(6)
    only[4] = 1.0
    assert offspring(only, offset).tolist() == [0, 0, 0, 0, 6, 0]


def test_weights_survive_what_would_underflow() -> None:
    log_weight = np.array([-1e4, -1e4 - math.log(3.0), -2e4, math.nan])
    np.testing.assert_allclose(normalised_weights(log_weight), [0.75, 0.25, 0.0, 0.0])
    assert log_weight[0] == 0.0
    np.testing.assert_allclose(normalised_weights(np.full(4, -math.inf)), np.full(4, 0.25))


def test_growing_keeps_what_was_there() -> None:
    cloud = filled(3)
    larger = grown(cloud, 9)
    for before, after in zip(columns(cloud), columns(larger), strict=True):
        kept = after if before.ndim == 1 else after[:, :4]
        np.testing.assert_array_equal(kept, before)


def test_the_cloud_spreads_as_the_covariance_of_the_motion_model_says() -> None:
    noise = noise_array(
        MotionNoise(
            xy_sigma_m_per_sqrt_s=0.01,
            heading_sigma_rad_per_sqrt_s=0.005,
            alpha1=0.002,
            alpha2_rad2_per_m2=0.0003,
            alpha3=0.002,
            alpha4_m2_per_rad2=0.0001,
        )
    )
    increments, dt = np.full((6, 3), [0.2, 0.05, 0.1]), np.full(6, 0.2)
    pose, covariance = np.array([0.0, 0.0, 2.9]), np.zeros((3, 3))
    wanted_poses, wanted = np.empty((6, 3)), np.empty((6, 3, 3))
    propagate(pose.copy(), covariance, increments, dt, noise, wanted_poses, wanted)
    n = 20_000
    cloud = new_cloud(n, 1)
    cloud.heading[:] = 2.9
    poses, covariances = np.empty((6, 3)), np.empty((6, 3, 3))
    normals = np.random.default_rng(0).standard_normal((6, 3, n))
    move(cloud, np.full(n, 1.0 / n), increments, dt, noise, normals, pose, poses, covariances)
    np.testing.assert_allclose(poses, wanted_poses, atol=2e-3)
    np.testing.assert_allclose(covariances, wanted, rtol=0.06, atol=2e-5)
