from __future__ import annotations

import math

import numpy as np
import pytest
from dense import numeric_jacobian, observe
from hypothesis import assume, given
from hypothesis import strategies as st

from slam.config import ObservationNoise
from slam.observation import expected, innovation, jacobian, noise_array, variances

coordinates = st.floats(-5.0, 5.0)


@given(x=coordinates, y=coordinates, heading=st.floats(-3.1, 3.1))
def test_the_jacobian_is_that_of_the_observation(x: float, y: float, heading: float) -> None:
    assume(math.hypot(x - 0.4, y + 0.2) > 0.05)
    state = np.array([0.4, -0.2, heading, x, y])
    range_m, bearing, dx, dy = expected(state[:3], x, y)
    # Differences across the cut at +-pi are not derivatives.
    assume(abs(abs(bearing) - math.pi) > 1e-3)
    np.testing.assert_allclose([range_m, bearing], observe(state, 3), atol=1e-12)
    a, b, c, d = jacobian(range_m, dx, dy)
    ours = np.array([[-a, -b, 0.0, a, b], [-c, -d, -1.0, c, d]])
    np.testing.assert_allclose(numeric_jacobian(lambda s: observe(s, 3), state), ours, atol=1e-6)


@pytest.mark.parametrize("seen_at", [math.pi - 0.01, -math.pi + 0.01, math.pi])
def test_a_landmark_dead_astern_has_a_small_innovation(seen_at: float) -> None:
    """The defect of MRPT 2.5.8 with a 360-degree sensor: the bearing innovation not wrapped."""
    _, turn, *_ = innovation(np.array([0.0, 0.0, 0.0]), -2.0, 1e-9, 2.0, seen_at)
    assert abs(turn) <= 0.0101


@given(heading=st.floats(-50.0, 50.0), bearing=st.floats(-50.0, 50.0))
def test_the_bearing_innovation_is_wrapped(heading: float, bearing: float) -> None:
    _, turn, *_ = innovation(np.array([0.0, 0.0, heading]), 1.0, 1.0, 1.0, bearing)
    assert -math.pi <= turn <= math.pi


def test_a_landmark_on_the_sensor_gives_finite_numbers() -> None:
    range_m, bearing, dx, dy = expected(np.zeros(3), 0.0, 0.0)
    assert np.all(np.isfinite([range_m, bearing, *jacobian(range_m, dx, dy)]))


def test_range_noise_grows_with_the_range() -> None:
    noise = ObservationNoise(range_sigma_m=0.03, bearing_sigma_rad=0.02, range_sigma_per_m=0.02)
    near, bearing = variances(0.0, noise_array(noise))
    far, _ = variances(2.0, noise_array(noise))
    assert near == pytest.approx(0.03**2)
    assert far == pytest.approx(0.03**2 + 0.04**2)
    assert bearing == pytest.approx(0.02**2)
