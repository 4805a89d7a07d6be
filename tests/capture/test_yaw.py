from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from capture.yaw import heading_of, yaw_quaternions


# Half a subnormal number is no longer a number; no heading is that small.
@given(st.floats(-np.pi, np.pi, exclude_min=True).filter(lambda a: a == 0 or abs(a) > 1e-300))
def test_a_heading_keeps_every_bit(heading: float) -> None:
    assert heading_of(yaw_quaternions(np.array([heading])))[0] == heading


def test_many_headings_keep_every_bit() -> None:
    heading = np.random.default_rng(1).uniform(-np.pi, np.pi, 100_000)
    np.testing.assert_array_equal(heading_of(yaw_quaternions(heading)), heading)


def test_headings_outside_the_circle_are_wrapped() -> None:
    found = heading_of(yaw_quaternions(np.array([-np.pi, 7.0, -4.0])))
    np.testing.assert_allclose(found, [np.pi, 7.0 - 2 * np.pi, 2 * np.pi - 4.0], atol=1e-15)


def test_both_signs_of_a_quaternion_are_one_turn() -> None:
    turns = yaw_quaternions(np.array([0.3, np.pi, -2.0]))
    np.testing.assert_array_equal(heading_of(turns), heading_of(-turns))


def test_the_yaw_of_a_tilted_body_is_that_of_its_x_axis() -> None:
    roll, yaw = 0.4, 1.1
    about_x = np.array([np.sin(roll / 2), 0.0, 0.0, np.cos(roll / 2)])
    z, w = np.sin(yaw / 2), np.cos(yaw / 2)
    tilted = np.array([w * about_x[0], z * about_x[0], z * about_x[3], w * about_x[3]])
    np.testing.assert_allclose(heading_of(tilted[None]), [yaw], atol=1e-12)
