"""Landmark maps: what is one, what is none, and how it turns."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from planar_strategies import poses

from dialogue import TracksideError
from geometry import Floats, GeometryError, LandmarkMap, LandmarkMapError, inverse

IDS = np.array([7, 3, 5])
POSITIONS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
COVARIANCES = np.array([np.diag([0.04, 0.01]), np.eye(2), [[2.0, 1.0], [1.0, 2.0]]])


def test_columns_keep_their_order() -> None:
    cones = LandmarkMap(IDS, POSITIONS, COVARIANCES)
    assert len(cones) == 3
    assert cones.ids.tolist() == [7, 3, 5]
    assert cones.ids.dtype == np.int64
    np.testing.assert_array_equal(cones.positions, POSITIONS)
    assert cones.covariances is not None
    np.testing.assert_array_equal(cones.covariances, COVARIANCES)


@pytest.mark.parametrize("positions", [np.empty((0, 2)), np.array([])])
def test_an_empty_map_is_a_map(positions: Floats) -> None:
    empty = LandmarkMap(np.array([], dtype=np.int64), positions, np.empty((0, 2, 2)))
    turned = empty.transformed(np.array([1.0, 2.0, 3.0]))
    assert len(turned) == 0
    assert turned.positions.shape == (0, 2)
    assert turned.covariances is not None


def test_a_quarter_turn_swaps_the_axes_of_the_ellipse() -> None:
    turned = LandmarkMap(IDS, POSITIONS, COVARIANCES).transformed(np.array([1.0, 1.0, math.pi / 2]))
    np.testing.assert_allclose(turned.positions, [[1, 1], [1, 2], [-1, 1]], atol=1e-15)
    assert turned.covariances is not None
    np.testing.assert_allclose(turned.covariances[0], np.diag([0.01, 0.04]), atol=1e-15)


def test_a_map_without_covariances_stays_without() -> None:
    assert LandmarkMap(IDS, POSITIONS).transformed(np.zeros(3)).covariances is None


@given(poses)
def test_there_and_back(pose: Floats) -> None:
    """Large coordinates and long ellipses: rounding must not turn a covariance into none."""
    cones = LandmarkMap(IDS, POSITIONS * 1e3, COVARIANCES * [[1e6], [1e6]])
    back = cones.transformed(pose).transformed(inverse(pose))
    np.testing.assert_allclose(back.positions, cones.positions, atol=1e-9)
    assert back.covariances is not None
    assert cones.covariances is not None
    np.testing.assert_allclose(back.covariances, cones.covariances, atol=1e-8)


def test_the_callers_arrays_stay_the_callers() -> None:
    ids, positions, covariances = IDS.copy(), POSITIONS.copy(), COVARIANCES.copy()
    cones = LandmarkMap(ids, positions, covariances)
    ids[0], positions[0], covariances[0] = 99, 99.0, 99.0
    assert cones.ids[0] == 7
    assert cones.positions[0, 0] == 0.0
    assert cones.covariances is not None
    assert cones.covariances[0, 0, 0] == 0.04
    for column in (cones.ids, cones.positions, cones.covariances):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 0
    with pytest.raises(AttributeError):
        cones.ids = ids  # type: ignore[misc]  # that it cannot be is what is tested


@pytest.mark.parametrize(
    ("ids", "positions"),
    [
        ([1, 2], np.zeros((3, 2))),
        ([1, 2, 3], np.zeros((2, 3))),
        ([1, 2], np.zeros(4)),
        ([[1, 2]], np.zeros((2, 2))),
        ([1], np.empty((0, 2))),
        ([], np.zeros((1, 2))),
    ],
)
def test_columns_of_unequal_length(ids: list[int], positions: Floats) -> None:
    with pytest.raises(LandmarkMapError, match=r"ids have shape .* expected"):
        LandmarkMap(np.array(ids, dtype=np.int64), positions)


def test_an_id_given_twice_is_named() -> None:
    with pytest.raises(LandmarkMapError, match="more than once: 3, 7"):
        LandmarkMap(np.array([7, 3, 7, 3, 1]), np.zeros((5, 2)))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_position_that_is_not_finite_is_named_by_id(value: float) -> None:
    positions = POSITIONS.copy()
    positions[1, 1] = value
    with pytest.raises(LandmarkMapError, match="position of landmark 3 is not finite"):
        LandmarkMap(IDS, positions)


def test_covariances_of_another_shape() -> None:
    with pytest.raises(LandmarkMapError, match=r"shape \(3, 3\), expected \(3, 2, 2\)"):
        LandmarkMap(IDS, POSITIONS, np.zeros((3, 3)))


@pytest.mark.parametrize(
    "covariance",
    [
        [[1.0, 0.5], [0.4, 1.0]],  # skew
        [[1e-14, 0.5e-14], [0.4e-14, 1e-14]],  # skew, though small
        [[-1.0, 0.0], [0.0, 1.0]],
        [[-1.0, 0.0], [0.0, -1.0]],  # its determinant alone looks right
        [[1.0, 2.0], [2.0, 1.0]],  # correlated by more than one
        [[math.nan, 0.0], [0.0, 1.0]],
        [[math.inf, 0.0], [0.0, 1.0]],
    ],
)
def test_what_is_no_covariance_is_named_by_id(covariance: npt.ArrayLike) -> None:
    covariances = COVARIANCES.copy()
    covariances[2] = covariance
    with pytest.raises(LandmarkMapError, match="covariance of landmark 5 is not a covariance"):
        LandmarkMap(IDS, POSITIONS, covariances)


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("spread", [np.zeros((2, 2)), np.ones((2, 2)), np.diag([1.0, 0.0])])
def test_a_covariance_may_be_singular(spread: Floats, scale: float) -> None:
    for heading in np.linspace(-3, 3, 13):
        LandmarkMap(IDS[:1], POSITIONS[:1], scale * spread[None]).transformed(
            np.array([0.0, 0.0, heading])
        )


def test_the_errors_can_be_caught_by_room_by_project_and_as_value_errors() -> None:
    for kind in (GeometryError, TracksideError, ValueError):
        assert issubclass(LandmarkMapError, kind)
