"""Who is who, and when nobody is."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import Floats, compose
from tracking import CarMemory, RingPair, TrackingError, car_pose, pair_match, unique_matches

PLACES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
GATES = np.full(3, 0.15)
PAIR = RingPair(0, 1, 0.2)
NOWHERE = np.full((2, 2), np.nan)


def pointing(heading: float, xy: tuple[float, float] = (np.nan, np.nan)) -> CarMemory:
    return CarMemory(heading, np.array(xy))


def rings_of_a_car(heading: float, at: tuple[float, float] = (0.3, 0.2)) -> Floats:
    """Front, then rear."""
    along = 0.1 * np.array([np.cos(heading), np.sin(heading)])
    return np.array([at + along, at - along])


def test_each_ring_near_a_place_is_that_place() -> None:
    found = PLACES[[2, 0, 1]] + 0.02
    assert unique_matches(PLACES, GATES, found).tolist() == [1, 2, 0]


def test_what_is_out_of_every_gate_is_nobody() -> None:
    assert unique_matches(PLACES, GATES, PLACES + np.array([0.3, 0.0])).tolist() == [-1, -1, -1]
    assert unique_matches(PLACES, GATES, np.zeros((0, 2))).tolist() == [-1, -1, -1]
    assert unique_matches(PLACES, GATES, np.full((2, 2), np.nan)).tolist() == [-1, -1, -1]


def test_two_rings_that_both_may_be_it_are_neither() -> None:
    found = np.array([[0.05, 0.0], [-0.06, 0.0], [1.0, 0.0]])
    assert unique_matches(PLACES, GATES, found).tolist() == [-1, 2, -1]


def test_one_ring_between_two_places_is_neither() -> None:
    places = np.array([[0.0, 0.0], [0.1, 0.0]])
    assert unique_matches(places, GATES[:2], np.array([[0.048, 0.0]])).tolist() == [-1, -1]


def test_each_place_may_expect_the_rings_at_its_own_height() -> None:
    found = np.stack([PLACES + 0.01, PLACES + 5.0, PLACES + 0.02])
    assert unique_matches(PLACES, GATES, found).tolist() == [0, -1, 2]


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.1, -2.5])
def test_a_pair_is_ordered_by_the_heading_that_is_known(heading: float) -> None:
    found = np.concatenate([[[2.0, 2.0]], rings_of_a_car(heading)[::-1]])
    assert pair_match(PAIR, NOWHERE, np.inf, found, pointing(heading + 0.5)) == (2, 1)


def test_without_a_heading_front_and_rear_are_not_told_apart() -> None:
    assert pair_match(PAIR, NOWHERE, np.inf, rings_of_a_car(0.3), None) is None


@pytest.mark.parametrize("turn", [-2.5, -1.5, 0.5, 1.5, 2.5])
@pytest.mark.parametrize("backwards", [False, True])
def test_a_car_that_drove_a_bend_unseen_is_ordered_by_its_chord(
    turn: float, backwards: bool
) -> None:
    start, way = 0.4, 0.7 * (-1.0 if backwards else 1.0)
    chord = start + turn / 2.0
    length = way * np.sinc(turn / (2.0 * np.pi))
    there = (length * np.cos(chord), length * np.sin(chord))
    found = rings_of_a_car(start + turn, there)
    assert pair_match(PAIR, NOWHERE, np.inf, found, pointing(start, (0.0, 0.0))) == (0, 1)


def test_two_pairs_that_fit_are_none() -> None:
    found = np.concatenate([rings_of_a_car(0.3), rings_of_a_car(0.3, (1.0, 1.0))])
    assert pair_match(PAIR, NOWHERE, np.inf, found, pointing(0.3)) is None
    assert pair_match(PAIR, rings_of_a_car(0.3), 0.1, found, pointing(0.3)) == (0, 1)


def test_rings_at_another_distance_are_no_pair() -> None:
    found = np.array([[0.3, 0.0], [0.0, 0.0]])
    assert pair_match(PAIR, NOWHERE, np.inf, found, pointing(0.0)) is None


def test_the_car_stands_where_its_lever_arms_say() -> None:
    pose = np.array([1.0, -2.0, 2.5])
    front, rear = (compose(pose, np.array([x, 0.0, 0.0]))[:2] for x in (0.25, 0.05))
    found, _ = car_pose(front, rear, np.eye(2), np.eye(2), 0.25, 0.05)
    np.testing.assert_allclose(found, pose, atol=1e-12)
    with pytest.raises(TrackingError, match="ahead"):
        car_pose(front, rear, np.eye(2), np.eye(2), 0.05, 0.25)


def test_the_covariance_of_the_pose_is_that_of_the_errors() -> None:
    rng, pose = np.random.default_rng(4), np.array([1.0, -2.0, 2.5])
    front, rear = (compose(pose, np.array([x, 0.0, 0.0]))[:2] for x in (0.25, 0.05))
    spreads = np.array([[[4e-8, 1e-8], [1e-8, 1e-8]], [[2e-8, 0.0], [0.0, 9e-8]]])
    noise = [rng.multivariate_normal(np.zeros(2), spread, 4000) for spread in spreads]
    poses = np.array(
        [
            car_pose(front + a, rear + b, spreads[0], spreads[1], 0.25, 0.05)[0]
            for a, b in zip(*noise, strict=True)
        ]
    )
    _, covariance = car_pose(front, rear, spreads[0], spreads[1], 0.25, 0.05)
    measured = np.cov(poses.T)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(measured / scale, covariance / scale, atol=0.08)
