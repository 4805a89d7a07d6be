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
    MANOEUVRE_M,
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


def table_5_6(heading: float, dx: float, dy: float, turn: float, share: float) -> Floats:
    """Covariance in one second: rot1, trans, rot2 for `share` of it, an arc for the rest."""
    rot1, trans, rot2 = rotations_and_translation(dx, dy, turn)

    def end(motion: Floats) -> Floats:
        return np.array(
            [
                motion[1] * math.cos(heading + motion[0]),
                motion[1] * math.sin(heading + motion[0]),
                heading + motion[0] + motion[2],
            ]
        )

    turn1 = share * folded(rot1) ** 2 + (1.0 - share) * (0.5 * turn) ** 2
    turn2 = share * folded(rot2) ** 2 + (1.0 - share) * (0.5 * turn) ** 2
    slip = 0.01 * (turn1 + turn2)
    variances = [
        0.1 * turn1 + 0.02 * trans**2,
        0.05 * trans**2 + share * slip,
        0.1 * turn2 + 0.02 * trans**2,
    ]
    through = numeric_jacobian(end, np.array([rot1, trans, rot2]))
    chord = np.array([math.cos(heading + 0.5 * turn), math.sin(heading + 0.5 * turn), 0.0])
    along_chord = (1.0 - share) * slip * np.outer(chord, chord)
    covariance: Floats = through @ np.diag(variances) @ through.T + along_chord
    return covariance


def covariance_of(heading: float, dx: float, dy: float, turn: float, dt_s: float = 1.0) -> Floats:
    xx, xy, yy, xh, yh, hh = increment_covariance(heading, dx, dy, turn, dt_s, noise_array(NOISE))
    return np.array([[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]])


ADDITIVE = np.diag([0.02**2, 0.02**2, 0.03**2])


@given(heading=angles, dx=st.floats(0.01, 1.0), dy=lengths, turn=angles)
def test_the_proportional_noise_is_table_5_6_seen_through_its_jacobian(
    heading: float, dx: float, dy: float, turn: float
) -> None:
    square = dx * dx + dy * dy
    expected = table_5_6(heading, dx, dy, turn, square**2 / (square**2 + MANOEUVRE_M**4)) / 0.5
    found = covariance_of(heading, dx, dy, turn, 0.5)
    np.testing.assert_allclose(found, expected + ADDITIVE * 0.5, rtol=1e-6, atol=1e-8)


@given(heading=angles, turn=angles, bearing=angles)
def test_a_long_step_is_turn_drive_turn_and_a_short_one_an_arc(
    heading: float, turn: float, bearing: float
) -> None:
    far, near = 1e3 * MANOEUVRE_M, 1e-3 * MANOEUVRE_M
    for length, share in ((far, 1.0), (near, 0.0)):
        dx, dy = length * math.cos(bearing), length * math.sin(bearing)
        expected = table_5_6(heading, dx, dy, turn, share) + ADDITIVE
        found = covariance_of(heading, dx, dy, turn)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * max(length, 1.0))


def test_millimetres_of_jitter_to_the_side_are_no_turning() -> None:
    """50 Hz at 0.25 m/s, 2 mm of jitter: taken at its word it is 0.4 rad of rot1 every 20 ms."""
    random = np.random.default_rng(0)
    straight = np.tile([0.005, 0.0, 0.0], (500, 1))
    jitter = straight + np.stack([np.zeros(500), random.normal(0, 0.002, 500), np.zeros(500)], 1)
    dt_s = np.full(500, 0.02)
    calm, jittery = moved(np.zeros(3), straight, dt_s)[1], moved(np.zeros(3), jitter, dt_s)[1]
    assert jittery[-1, 2, 2] == pytest.approx(calm[-1, 2, 2], rel=0.2)


@given(bearing=angles, turn=st.floats(0.01, 3.0))
def test_the_noise_has_no_jump_where_the_direction_of_a_step_is_lost(
    bearing: float, turn: float
) -> None:
    """Around no translation, and around sideways, where driving becomes reversing."""
    side = 1e-6 * np.array([math.cos(bearing), math.sin(bearing)])
    for dx, dy in ((0.0, 0.0), (2e-4, 0.0), (0.0, 0.05), (0.0, 0.6)):
        one, other = (
            covariance_of(0.3, dx, dy, turn),
            covariance_of(0.3, dx + side[0], dy + side[1], turn),
        )
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("pieces", [2, 10, 100])
def test_the_noise_of_an_arc_does_not_depend_on_the_rate_of_the_odometry(pieces: int) -> None:
    def arc(turn: float) -> Floats:
        return np.array([math.sin(turn), 1.0 - math.cos(turn), turn])

    whole = moved(np.zeros(3), arc(0.2)[None], np.array([1.0]))[1][-1]
    cut = moved(np.zeros(3), np.tile(arc(0.2 / pieces), (pieces, 1)), np.full(pieces, 1 / pieces))[
        1
    ]
    np.testing.assert_allclose(np.diag(cut[-1]), np.diag(whole), rtol=0.02)


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
