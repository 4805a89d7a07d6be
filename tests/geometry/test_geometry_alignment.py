"""Rigid alignment, against known transforms, evo and scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from evo.core.geometry import umeyama_alignment
from hypothesis import given
from hypothesis import strategies as st
from planar_strategies import poses
from scipy.spatial.transform import Rotation

from geometry import (
    AlignmentError,
    Floats,
    alignment_from_first_pose,
    compose,
    planar_umeyama,
    transform_points,
    umeyama,
    wrap,
)

SEEDS = st.integers(0, 2**32 - 1)


def random_rotation(rng: np.random.Generator, dimension: int) -> Floats:
    if dimension == 3:
        return np.asarray(Rotation.from_quat(rng.normal(size=4)).as_matrix())
    angle = rng.uniform(-math.pi, math.pi)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


@given(SEEDS, st.sampled_from([2, 3]), st.integers(3, 30), st.sampled_from([1e-3, 1.0, 1e5]))
def test_a_rigid_transform_is_recovered(seed: int, dimension: int, n: int, scale_m: float) -> None:
    rng = np.random.default_rng(seed)
    rotation, translation = random_rotation(rng, dimension), rng.normal(size=dimension) * 100
    source = rng.normal(size=(n, dimension)) * scale_m
    found, shift = umeyama(source, source @ rotation.T + translation)
    np.testing.assert_allclose(found, rotation, atol=1e-6)
    np.testing.assert_allclose(shift, translation, atol=1e-6 * max(scale_m, 1.0))


@given(SEEDS, st.sampled_from([2, 3]))
def test_noise_gives_what_evo_and_scipy_give(seed: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(20, dimension)) * 5
    target = source @ random_rotation(rng, dimension).T + rng.normal(size=(20, dimension))
    rotation, translation = umeyama(source, target)

    theirs, their_shift, scale = umeyama_alignment(source.T, target.T)
    assert scale == 1.0
    np.testing.assert_allclose(rotation, theirs, atol=1e-9)
    np.testing.assert_allclose(translation, their_shift, atol=1e-9)

    padding = ((0, 0), (0, 3 - dimension))
    flat_source = np.pad(source - source.mean(axis=0), padding)
    flat_target = np.pad(target - target.mean(axis=0), padding)
    scipys, _ = Rotation.align_vectors(flat_target, flat_source)
    np.testing.assert_allclose(rotation, scipys.as_matrix()[:dimension, :dimension], atol=1e-9)


@given(SEEDS, st.sampled_from([2, 3]))
def test_a_mirrored_cloud_still_gets_a_rotation(seed: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(12, dimension))
    mirror = np.diag([-1.0] + [1.0] * (dimension - 1))
    rotation, _ = umeyama(source, source @ mirror + 0.01 * rng.normal(size=source.shape))
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(dimension), atol=1e-12)


@given(SEEDS, poses)
def test_no_small_turn_or_shift_fits_better(seed: int, nudge: Floats) -> None:
    rng = np.random.default_rng(seed)
    source, target = rng.normal(size=(2, 9, 2))
    best = planar_umeyama(source, target)
    other = best + nudge * 1e-4

    def cost(pose: Floats) -> float:
        return float(np.sum((transform_points(pose, source) - target) ** 2))

    assert cost(best) <= cost(other) + 1e-12


@given(SEEDS, poses)
def test_the_planar_pose_is_recovered(seed: int, pose: Floats) -> None:
    source = np.random.default_rng(seed).normal(size=(4, 2))
    found = planar_umeyama(source, transform_points(pose, source))
    np.testing.assert_allclose(found[:2], pose[:2], atol=1e-8)
    assert float(wrap(found[2] - pose[2])) == pytest.approx(0.0, abs=1e-8)


def test_half_a_turn_is_plus_pi() -> None:
    source = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    for noise in (0.0, 1e-17, -1e-17):
        assert planar_umeyama(source, -source + [[noise, 0], [0, 0], [0, 0]])[2] == math.pi


def test_two_points_fix_the_plane_but_not_space() -> None:
    source, target = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[5.0, 5.0], [5.0, 7.0]])
    np.testing.assert_allclose(planar_umeyama(source, target), [5, 5.5, math.pi / 2])
    with pytest.raises(AlignmentError, match="2 points do not fix a rotation in 3 dimensions"):
        umeyama(np.pad(source, ((0, 0), (0, 1))), np.pad(target, ((0, 0), (0, 1))))


def test_points_in_one_plane_fix_space() -> None:
    source = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]])
    turn = Rotation.from_rotvec([0.3, -0.2, 2.0]).as_matrix()
    np.testing.assert_allclose(umeyama(source, source @ turn.T)[0], turn, atol=1e-12)


FAR_M = 6.5e6
"""The northing of central Sweden: a coordinate there is rounded to a nanometre."""


@pytest.mark.parametrize("n", [2, 40, 100_000])
@pytest.mark.parametrize("offset_m", [0.0, 0.1, FAR_M])
@pytest.mark.parametrize("spread_m", [1e-3, 1.0, 1e4])
def test_a_line_in_space_leaves_the_roll_free(n: int, offset_m: float, spread_m: float) -> None:
    along = np.random.default_rng(3).normal(size=(n, 1)) * spread_m
    with pytest.raises(AlignmentError, match=f"{n} points do not fix"):
        umeyama(offset_m + along * [1.0, 2.0, 3.0], along * [0.3, 0.1, -0.2] - offset_m)


@pytest.mark.parametrize("offset_m", [0.0, FAR_M])
@pytest.mark.parametrize("sway_m", [1e-3, 0.1])
def test_a_nearly_straight_drive_is_no_line(offset_m: float, sway_m: float) -> None:
    walk = np.random.default_rng(4).normal(size=(50, 3)) * [1000.0, sway_m, sway_m]
    turn = Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()
    found, _ = umeyama(walk + offset_m, walk @ turn.T + offset_m)
    np.testing.assert_allclose(found, turn, atol=1e-5)


@pytest.mark.parametrize("n", [3, 7, 100_000])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("place_m", [0.0, 0.1, FAR_M])
def test_coincident_points_do_not_fix_a_rotation(n: int, dimension: int, place_m: float) -> None:
    point, spread = np.full((n, dimension), place_m), np.random.default_rng(5).normal(size=(n, 3))
    for source, target in (
        (point, spread[:, :dimension]),
        (spread[:, :dimension], point),
        (point, point),
    ):
        with pytest.raises(AlignmentError, match="coincide"):
            umeyama(source, target)


def test_a_mirrored_square_fits_equally_badly_at_every_turn() -> None:
    square = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    with pytest.raises(AlignmentError, match="mirror each other"):
        umeyama(square, square * [1.0, -1.0])


@pytest.mark.parametrize("n", [0, 1])
@pytest.mark.parametrize("dimension", [2, 3])
def test_too_few_points(n: int, dimension: int) -> None:
    with pytest.raises(AlignmentError, match="use --align origin or none"):
        umeyama(np.zeros((n, dimension)), np.ones((n, dimension)))


@pytest.mark.parametrize(
    ("source", "target"), [((4, 2), (5, 2)), ((4, 2), (4, 3)), ((4,), (4,)), ((4, 1), (4, 1))]
)
def test_wrong_shapes_are_named(source: tuple[int, ...], target: tuple[int, ...]) -> None:
    with pytest.raises(AlignmentError, match=r"points of shape .* expected") as caught:
        umeyama(np.zeros(source), np.zeros(target))
    assert str(source) in str(caught.value)
    assert str(target) in str(caught.value)


@given(poses, poses)
def test_the_first_pose_is_brought_onto_its_target(source: Floats, target: Floats) -> None:
    brought = compose(alignment_from_first_pose(source, target), source)
    np.testing.assert_allclose(brought[:2], target[:2], atol=1e-9)
    assert float(wrap(brought[2] - target[2])) == pytest.approx(0.0, abs=1e-12)
