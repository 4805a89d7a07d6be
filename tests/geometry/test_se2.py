"""Rigid motions of the plane, against the group laws and homogeneous matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_strategies import HEADINGS_RAD, points, poses

from geometry import Floats, between, compose, inverse, rotate_covariance, transform_points, wrap

IDENTITY = np.zeros(3)


def assert_same_pose(actual: Floats, expected: Floats) -> None:
    np.testing.assert_allclose(actual[..., :2], expected[..., :2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(wrap(actual[..., 2] - expected[..., 2]), 0.0, rtol=0, atol=1e-12)


def matrix(pose: Floats) -> Floats:
    """The homogeneous 3 x 3 matrix of one pose: an independent account of the same motion."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array([[cos, -sin, x], [sin, cos, y], [0.0, 0.0, 1.0]])


def test_a_step_forward_after_a_quarter_turn_goes_left() -> None:
    turned = np.array([1.0, 2.0, math.pi / 2])
    np.testing.assert_allclose(compose(turned, np.array([3.0, 0.0, math.pi])), [1, 5, -math.pi / 2])


def test_the_inverse_tells_where_the_origin_is_as_the_car_sees_it() -> None:
    np.testing.assert_allclose(
        inverse(np.array([2.0, 0.0, math.pi / 2])), [0, 2, -math.pi / 2], atol=1e-15
    )


def test_between_tells_where_another_stands_as_the_car_sees_it() -> None:
    car, other = np.array([1.0, 1.0, math.pi]), np.array([0.0, 1.0, math.pi / 2])
    np.testing.assert_allclose(between(car, other), [1, 0, -math.pi / 2], atol=1e-15)


@given(poses, poses)
def test_compose_is_the_product_of_matrices(a: Floats, b: Floats) -> None:
    np.testing.assert_allclose(matrix(compose(a, b)), matrix(a) @ matrix(b), rtol=0, atol=1e-9)


@given(poses, poses, poses)
def test_compose_is_associative(a: Floats, b: Floats, c: Floats) -> None:
    assert_same_pose(compose(compose(a, b), c), compose(a, compose(b, c)))


@given(poses)
def test_identity_is_neutral_to_the_last_bit(pose: Floats) -> None:
    np.testing.assert_array_equal(compose(IDENTITY, pose), pose)
    np.testing.assert_array_equal(compose(pose, IDENTITY), pose)


@given(poses)
def test_inverse_undoes_on_both_sides(pose: Floats) -> None:
    assert_same_pose(compose(pose, inverse(pose)), IDENTITY)
    assert_same_pose(compose(inverse(pose), pose), IDENTITY)
    assert_same_pose(inverse(inverse(pose)), pose)


@given(poses, poses)
def test_between_is_what_compose_adds(a: Floats, b: Floats) -> None:
    assert_same_pose(between(a, compose(a, b)), b)


@given(poses, poses)
def test_headings_come_back_wrapped(a: Floats, b: Floats) -> None:
    for pose in (compose(a, b), inverse(a), between(a, b)):
        assert -math.pi < pose[2] <= math.pi


@given(poses, poses, points)
def test_points_follow_composition(a: Floats, b: Floats, cloud: Floats) -> None:
    one_by_one = transform_points(a, transform_points(b, cloud))
    np.testing.assert_allclose(transform_points(compose(a, b), cloud), one_by_one, atol=1e-9)


@given(poses, points)
def test_points_keep_their_distances(pose: Floats, cloud: Floats) -> None:
    before = np.linalg.norm(cloud[:, None] - cloud, axis=-1)
    moved = transform_points(pose, cloud)
    np.testing.assert_allclose(np.linalg.norm(moved[:, None] - moved, axis=-1), before, atol=1e-9)


def test_many_poses_are_the_same_as_one_after_the_other() -> None:
    rng = np.random.default_rng(1)
    many, others, one = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=3)
    for operation in (compose, between):
        pairwise = [operation(a, b) for a, b in zip(many, others, strict=True)]
        np.testing.assert_array_equal(operation(many, others), pairwise)
        np.testing.assert_array_equal(operation(one, many), [operation(one, a) for a in many])
        np.testing.assert_array_equal(operation(many, one), [operation(a, one) for a in many])
    np.testing.assert_array_equal(inverse(many), [inverse(a) for a in many])


def test_each_pose_moves_its_own_point() -> None:
    turns = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, math.pi]])
    moved = transform_points(turns, np.array([[1.0, 2.0], [1.0, 2.0]]))
    np.testing.assert_allclose(moved, [[1, 2], [0, -2]], atol=1e-15)


def test_a_long_ellipse_turns_with_the_frame() -> None:
    ellipse = np.diag([4.0, 1.0])
    np.testing.assert_allclose(rotate_covariance(math.pi / 2, ellipse), np.diag([1, 4]), atol=1e-15)
    tilted = [[2.5, 1.5], [1.5, 2.5]]
    np.testing.assert_allclose(rotate_covariance(math.pi / 4, ellipse), tilted, atol=1e-15)


@given(HEADINGS_RAD, st.tuples(st.floats(0, 1e3), st.floats(0, 1e3)))
def test_turning_keeps_the_axes_of_the_ellipse(
    heading: float, variances: tuple[float, float]
) -> None:
    stack = np.array([np.diag(variances), np.eye(2)])
    turned = rotate_covariance(heading, stack)
    np.testing.assert_allclose(np.linalg.eigvalsh(turned[0]), sorted(variances), atol=1e-9)
    np.testing.assert_allclose(turned[1], np.eye(2), atol=1e-15)


def test_arguments_are_left_alone() -> None:
    pose, cloud = np.array([1.0, 2.0, 3.0]), np.ones((2, 2))
    pose.setflags(write=False)
    cloud.setflags(write=False)
    assert transform_points(pose, cloud).flags.writeable
    assert compose(pose, pose).flags.writeable


@pytest.mark.parametrize("operation", [compose, between])
def test_no_poses_give_no_poses(operation: object) -> None:
    assert callable(operation)
    assert operation(IDENTITY, np.empty((0, 3))).shape == (0, 3)
