from __future__ import annotations

import math

import numpy as np
import pytest
from dense import numeric_jacobian
from hypothesis import given
from hypothesis import strategies as st

from geometry import Floats, compose, wrap
from slam.config import MotionNoise
from slam.motion import (
    folded,
    increment_covariance,
    noise_array,
    propagate,
    rotations_and_translation,
)

NOISE = MotionNoise(
    xy_sigma_m_per_sqrt_s=0.02,
    heading_sigma_rad_per_sqrt_s=0.03,
    alpha1=0.1,
    alpha2_rad2_per_m2=0.02,
    alpha3=0.05,
    alpha4_m2_per_rad2=0.01,
)
angles = st.floats(-3.1, 3.1)
lengths = st.floats(-2.0, 2.0)


def moved(pose: Floats, increments: Floats, dt_s: Floats, noise: MotionNoise = NOISE):  # type: ignore[no-untyped-def]
    pose, covariance = pose.copy(), np.zeros((3, 3))
    poses, covariances = np.empty((len(dt_s), 3)), np.empty((len(dt_s), 3, 3))
    free = propagate(pose, covariance, increments, dt_s, noise_array(noise), poses, covariances)
    return poses, covariances, free


@given(x=lengths, y=lengths, heading=angles, dx=lengths, dy=lengths, turn=angles)
def test_the_model_is_thruns_with_the_previous_pose_unprimed(
    x: float, y: float, heading: float, dx: float, dy: float, turn: float
) -> None:
    rot1, trans, rot2 = rotations_and_translation(dx, dy, turn)
    poses, _, _ = moved(np.array([x, y, heading]), np.array([[dx, dy, turn]]), np.array([0.1]))
    if trans > 1e-4:
        expected = [x + trans * math.cos(heading + rot1), y + trans * math.sin(heading + rot1)]
        np.testing.assert_allclose(poses[0, :2], expected, atol=1e-12)
    assert float(wrap(poses[0, 2] - heading - rot1 - rot2)) == pytest.approx(0.0, abs=1e-9)
    expected_pose = compose(np.array([x, y, heading]), np.array([dx, dy, turn]))
    np.testing.assert_allclose(poses[0, :2], expected_pose[:2], atol=1e-12)


def test_a_car_that_drives_forward_moves_forward() -> None:
    poses, _, _ = moved(np.zeros(3), np.array([[1.0, 0.0, 0.0]] * 3), np.full(3, 0.1))
    np.testing.assert_allclose(poses[:, 0], [1.0, 2.0, 3.0])


@given(heading=angles, dx=lengths, dy=lengths, turn=angles)
def test_the_accumulated_jacobian_is_that_of_the_motion(
    heading: float, dx: float, dy: float, turn: float
) -> None:
    start = np.array([0.3, -0.2, heading])
    increments = np.array([[dx, dy, turn], [0.5, 0.1, -0.3]])

    def end(pose: Floats) -> Floats:
        for increment in increments:
            x, y, h = pose
            pose = np.array(
                [
                    x + math.cos(h) * increment[0] - math.sin(h) * increment[1],
                    y + math.sin(h) * increment[0] + math.cos(h) * increment[1],
                    h + increment[2],
                ]
            )
        return pose

    _, _, (fx, fy) = moved(start, increments, np.array([0.1, 0.1]))
    expected = np.eye(3)
    expected[0, 2], expected[1, 2] = fx, fy
    np.testing.assert_allclose(numeric_jacobian(end, start), expected, atol=1e-8)


@given(heading=angles, dx=st.floats(0.01, 1.0), dy=lengths, turn=angles)
def test_the_proportional_noise_is_table_5_6_seen_through_its_jacobian(
    heading: float, dx: float, dy: float, turn: float
) -> None:
    rot1, trans, rot2 = rotations_and_translation(dx, dy, turn)

    def end(motion: Floats) -> Floats:
        return np.array(
            [
                motion[1] * math.cos(heading + motion[0]),
                motion[1] * math.sin(heading + motion[0]),
                heading + motion[0] + motion[2],
            ]
        )

    dt = 0.5
    turn1, turn2 = folded(rot1) ** 2, folded(rot2) ** 2
    variances = np.array(
        [
            0.1 * turn1 + 0.02 * trans**2,
            0.05 * trans**2 + 0.01 * (turn1 + turn2),
            0.1 * turn2 + 0.02 * trans**2,
        ]
    )
    through = numeric_jacobian(end, np.array([rot1, trans, rot2]))
    additive = np.diag([0.02**2, 0.02**2, 0.03**2]) * dt
    expected = through @ np.diag(variances) @ through.T / dt + additive
    xx, xy, yy, xh, yh, hh = increment_covariance(heading, dx, dy, turn, dt, noise_array(NOISE))
    np.testing.assert_allclose(
        [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]], expected, rtol=1e-6, atol=1e-8
    )


@pytest.mark.parametrize("pieces", [2, 10, 100])
def test_noise_does_not_depend_on_the_rate_of_the_odometry(pieces: int) -> None:
    """Same drive, cut finer: the along-track and heading variances stay the same."""
    whole = moved(np.zeros(3), np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))[1][-1]
    cut = moved(
        np.zeros(3), np.array([[1.0 / pieces, 0.0, 0.0]] * pieces), np.full(pieces, 1.0 / pieces)
    )[1][-1]
    assert cut[0, 0] == pytest.approx(whole[0, 0], rel=1e-9)
    assert cut[2, 2] == pytest.approx(whole[2, 2], rel=1e-9)


def test_standing_still_adds_no_noise_unless_asked() -> None:
    still = np.zeros((50, 3))
    assert not moved(np.zeros(3), still, np.full(50, 0.1))[1].any()
    restless = MotionNoise(
        xy_sigma_m_per_sqrt_s=0.1, heading_sigma_rad_per_sqrt_s=0.1, at_rest=True
    )
    assert moved(np.zeros(3), still, np.full(50, 0.1), restless)[1][-1, 0, 0] == pytest.approx(0.05)


@given(speed=st.floats(0.05, 2.0), turn=st.floats(-0.3, 0.3))
def test_reversing_is_as_uncertain_as_driving(speed: float, turn: float) -> None:
    noise = noise_array(NOISE)
    forward = increment_covariance(0.0, speed, 0.0, turn, 0.1, noise)
    backward = increment_covariance(0.0, -speed, 0.0, turn, 0.1, noise)
    # xx, yy and heading agree; the mixed terms change sign with the direction of travel.
    np.testing.assert_allclose(
        [backward[0], backward[2], backward[5]], [forward[0], forward[2], forward[5]], atol=1e-12
    )


def test_the_heading_stays_wrapped() -> None:
    poses, _, _ = moved(np.zeros(3), np.array([[0.0, 0.0, 1.0]] * 20), np.full(20, 0.1))
    assert np.all(np.abs(poses[:, 2]) <= math.pi)
    np.testing.assert_allclose(wrap(poses[:, 2] - np.arange(1, 21)), 0.0, atol=1e-12)
