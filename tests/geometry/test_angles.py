"""Angles on the circle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from planar_strategies import HEADINGS_RAD

from geometry import Floats, circular_mean, wrap

PI = math.pi


@pytest.mark.parametrize(
    ("angle_rad", "expected_rad"),
    [
        (0.0, 0.0),
        (PI, PI),
        (-PI, PI),
        (3 * PI, PI),
        (-3 * PI, PI),
        (2 * PI, 0.0),
        (1.5 * PI, -0.5 * PI),
        (-1.5 * PI, 0.5 * PI),
        (np.nextafter(-PI, -4.0), PI),
        (7.0, 7.0 - 2 * PI),
    ],
)
def test_wrap_closed_forms(angle_rad: float, expected_rad: float) -> None:
    assert float(wrap(angle_rad)) == pytest.approx(expected_rad, abs=1e-15)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_wrap_stays_in_the_half_open_interval(angle_rad: float) -> None:
    wrapped = float(wrap(angle_rad))
    assert -PI < wrapped <= PI


@given(st.floats(-1e6, 1e6))
def test_wrap_keeps_the_direction(angle_rad: float) -> None:
    wrapped = float(wrap(angle_rad))
    assert math.cos(wrapped) == pytest.approx(math.cos(angle_rad), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle_rad), abs=1e-9)


@given(HEADINGS_RAD)
def test_an_angle_inside_comes_back_exact(angle_rad: float) -> None:
    assert float(wrap(angle_rad)) == angle_rad


@pytest.mark.parametrize("shape", [(), (0,), (5,), (2, 3)])
def test_wrap_keeps_the_shape_and_its_argument(shape: tuple[int, ...]) -> None:
    angles = np.full(shape, 4.0)
    wrapped = wrap(angles)
    assert wrapped.shape == shape
    assert wrapped.dtype == np.float64
    assert np.all(angles == 4.0)


@given(HEADINGS_RAD, st.floats(0.0, 1.5))
def test_mean_of_two_is_the_direction_between(middle_rad: float, spread_rad: float) -> None:
    mean = circular_mean(np.array([middle_rad - spread_rad, middle_rad + spread_rad]))
    assert float(wrap(mean - middle_rad)) == pytest.approx(0.0, abs=1e-12)


def test_mean_across_the_seam() -> None:
    assert abs(circular_mean(np.radians([179.0, -179.0]))) == pytest.approx(PI)


def test_mean_is_wrapped_where_the_angle_of_a_complex_number_is_not() -> None:
    assert circular_mean(np.array([-PI])) == PI


def test_weights_shift_the_mean() -> None:
    angles, weights = np.array([0.0, PI / 2]), np.array([1.0, math.sqrt(3)])
    assert circular_mean(angles, weights) == pytest.approx(PI / 3)


@given(hnp.arrays(np.float64, st.integers(1, 9), elements=st.floats(-1.0, 1.0)), HEADINGS_RAD)
def test_mean_turns_with_the_angles(angles_rad: Floats, turn_rad: float) -> None:
    turned = circular_mean(angles_rad + turn_rad)
    assert float(wrap(turned - circular_mean(angles_rad) - turn_rad)) == pytest.approx(0, abs=1e-12)
