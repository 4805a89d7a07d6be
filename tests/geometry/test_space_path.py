"""Paths in space, against scipy's rotations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from geometry import Floats, SpacePath, Trajectory, TrajectoryError

SEEDS = st.integers(0, 2**32 - 1)
DECADES_NS = 1_800_000_000 * 10**9


def random_path(seed: int, n: int = 6) -> SpacePath:
    rng = np.random.default_rng(seed)
    t_ns = DECADES_NS + np.cumsum(rng.integers(1, 10**9, size=n))
    quaternions = rng.normal(size=(n, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return SpacePath(t_ns, rng.normal(size=(n, 3)), quaternions)


def path_of(quaternions: Floats) -> SpacePath:
    """A path that stands still and turns, one pose a second."""
    n = len(quaternions)
    return SpacePath(np.arange(n) * 10**9, np.zeros((n, 3)), quaternions)


def angles_between(a: Floats, b: Floats) -> Floats:
    return np.asarray((Rotation.from_quat(a).inv() * Rotation.from_quat(b)).magnitude())


@given(SEEDS)
def test_rotation_matrices_are_scipys(seed: int) -> None:
    walk = random_path(seed)
    expected = Rotation.from_quat(walk.quaternions).as_matrix()
    np.testing.assert_allclose(walk.rotations, expected, atol=1e-14)


@given(SEEDS)
def test_interpolation_is_linear_in_position_and_scipys_slerp_in_rotation(seed: int) -> None:
    walk = random_path(seed)
    rng = np.random.default_rng(seed)
    t_ns = np.unique(rng.integers(walk.t_ns[0], walk.t_ns[-1], size=20))
    ours = walk.interpolated(t_ns)

    own_s, t_s = (walk.t_ns - walk.t_ns[0]) / 1e9, (t_ns - walk.t_ns[0]) / 1e9
    slerp = Slerp(own_s, Rotation.from_quat(walk.quaternions))
    assert angles_between(ours.quaternions, slerp(t_s).as_quat()).max() < 1e-7
    for axis in range(3):
        expected = np.interp(t_s, own_s, walk.positions[:, axis])
        np.testing.assert_allclose(ours.positions[:, axis], expected, atol=1e-9)


@given(SEEDS, st.integers(0, 63))
def test_the_sign_of_a_quaternion_means_nothing(seed: int, signs: int) -> None:
    walk = random_path(seed)
    flips = np.array([1.0 if signs >> k & 1 else -1.0 for k in range(len(walk))])
    flipped = SpacePath(walk.t_ns, walk.positions, walk.quaternions * flips[:, None])
    middles = walk.t_ns[:-1] + np.diff(walk.t_ns) // 2
    apart = angles_between(
        walk.interpolated(middles).quaternions, flipped.interpolated(middles).quaternions
    )
    np.testing.assert_allclose(flipped.rotations, walk.rotations, atol=1e-15)
    assert apart.max() < 1e-7


@pytest.mark.parametrize("turn_rad", [0.0, 1e-12, 1e-9, 1e-6, 1.0, math.pi - 1e-9, math.pi])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_small_and_half_turns_and_their_antipodes(turn_rad: float, sign: float) -> None:
    end = Rotation.from_rotvec([0.0, 0.0, turn_rad]).as_quat()
    ends = np.array([[0.0, 0.0, 0.0, 1.0], sign * np.asarray(end)])
    third = path_of(ends).interpolated(np.array([10**9 // 4]))
    assert abs(third.planar().heading[0]) == pytest.approx(turn_rad / 4, rel=1e-7, abs=1e-16)


@given(SEEDS)
def test_at_our_own_stamps_it_gives_our_own_poses(seed: int) -> None:
    walk = random_path(seed)
    same = walk.interpolated(walk.t_ns)
    np.testing.assert_array_equal(same.positions, walk.positions)
    assert angles_between(same.quaternions, walk.quaternions).max() < 1e-7


def test_a_single_pose() -> None:
    one = random_path(1, n=1)
    assert one.rate_hz == 0.0
    np.testing.assert_array_equal(one.interpolated(one.t_ns).positions, one.positions)
    assert one.covers(np.array([one.t_ns[0] - 1, one.t_ns[0]]), 1.0).tolist() == [False, True]


@pytest.mark.parametrize("n", [1, 6])
@pytest.mark.parametrize("end", [0, -1])
def test_it_never_extrapolates(n: int, end: int) -> None:
    walk = random_path(2, n)
    outside = np.array([walk.t_ns[0] - 1 if end == 0 else walk.t_ns[-1] + 1])
    with pytest.raises(TrajectoryError, match=r"1 of 1 stamps .* never extrapolated"):
        walk.interpolated(outside)


def test_covers_as_in_the_plane() -> None:
    walk = path_of(np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))).selected(np.array([True, False, True]))
    t_ns = np.array([0, 10**9, 2 * 10**9, 2 * 10**9 + 1])
    assert walk.covers(t_ns, 1.5).tolist() == [True, False, True, False]
    assert walk.covers(t_ns, 2.0).tolist() == [True, True, True, False]
    assert walk.rate_hz == 0.5


def test_planar_gives_back_a_planar_path() -> None:
    rng = np.random.default_rng(5)
    heading = rng.uniform(-math.pi, math.pi, size=9)
    quaternions = Rotation.from_euler("z", heading[:, None]).as_quat()
    positions = np.column_stack([rng.normal(size=(9, 2)), np.full(9, 0.3)])
    walk = SpacePath(np.arange(9), positions, quaternions)
    shadow = walk.planar()
    assert isinstance(shadow, Trajectory)
    np.testing.assert_array_equal(shadow.positions, positions[:, :2])
    np.testing.assert_allclose(shadow.heading, heading, atol=1e-14)
    assert max(walk.out_of_plane()) < 1e-15


def test_yaw_survives_roll_and_pitch() -> None:
    turned = Rotation.from_euler("ZYX", [[2.0, 0.4, -0.3]]).as_quat()
    assert path_of(turned).planar().heading[0] == pytest.approx(2.0)


@pytest.mark.parametrize("half_turn", [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -1.0, 1e-17]])
def test_half_a_turn_is_plus_pi(half_turn: list[float]) -> None:
    assert path_of(np.array([half_turn])).planar().heading[0] == math.pi


@pytest.mark.parametrize("tilt_rad", [1e-10, 0.01, 1.0, math.pi / 2, math.pi])
def test_how_far_a_path_leaves_the_plane(tilt_rad: float) -> None:
    rolls = Rotation.from_euler("zx", [[1.0, 0.0], [2.0, tilt_rad]]).as_quat()
    walk = SpacePath(np.arange(2), np.array([[0.0, 0, -1], [5, 5, 2]]), rolls)
    height_m, tilt = walk.out_of_plane()
    assert height_m == 3.0
    assert tilt == pytest.approx(tilt_rad, rel=1e-6)


def test_quaternions_are_normalised() -> None:
    walk = path_of(np.array([[0.0, 0.0, 0.0, 1.009], [0.0, 0.0, 0.6, 0.8]]))
    np.testing.assert_allclose(np.linalg.norm(walk.quaternions, axis=1), 1.0, rtol=1e-15)


@pytest.mark.parametrize("length", [0.0, 0.5, 1.02])
def test_a_quaternion_that_is_none(length: float) -> None:
    quaternions = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, length]])
    with pytest.raises(TrajectoryError, match=f"pose 1 has length {length:.3f}, expected 1"):
        path_of(quaternions)


@pytest.mark.parametrize(
    ("positions", "quaternions", "text"),
    [
        (np.zeros((2, 2)), np.eye(4)[[3, 3]], r"positions has shape \(2, 2\), expected \(2, 3\)"),
        (np.zeros((2, 3)), np.eye(3)[[0, 0]], r"quaternions has shape \(2, 3\), expected \(2, 4\)"),
        (np.zeros((3, 3)), np.eye(4)[[3, 3]], r"positions has shape \(3, 3\), expected \(2, 3\)"),
        (
            np.full((2, 3), math.nan),
            np.eye(4)[[3, 3]],
            r"positions is not finite in pose 0 \(and 1",
        ),
        (np.zeros((2, 3)), np.full((2, 4), math.nan), "quaternions is not finite in pose 0"),
    ],
)
def test_columns_that_make_no_path(positions: Floats, quaternions: Floats, text: str) -> None:
    with pytest.raises(TrajectoryError, match=text):
        SpacePath(np.arange(2), positions, quaternions)


def test_no_pose() -> None:
    with pytest.raises(TrajectoryError, match="at least one pose"):
        SpacePath(np.array([], dtype=np.int64), np.empty((0, 3)), np.empty((0, 4)))


def test_the_callers_arrays_stay_the_callers() -> None:
    t_ns, positions, quaternions = np.arange(2), np.zeros((2, 3)), np.eye(4)[[3, 3]]
    walk = SpacePath(t_ns, positions, quaternions)
    t_ns[0], positions[0], quaternions[0] = -1, 9.0, 9.0
    assert walk.t_ns[0] == 0
    assert walk.positions[0, 0] == 0.0
    assert walk.quaternions[0].tolist() == [0, 0, 0, 1]
    for column in (walk.t_ns, walk.positions, walk.quaternions):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 1
