from __future__ import annotations

import numpy as np
import pytest

from geometry import (
    Camera,
    Floats,
    View,
    at_height,
    camera_of,
    floor_covariance,
    intrinsics_of,
    looking_at,
    turned,
    view_jacobian,
)

CAMERA = Camera(1280, 720, 800.0, 790.0, 630.0, 370.0, (-0.12, 0.03, 0.0006, -0.0004, 0.002))
VIEW = looking_at(CAMERA, np.array([0.3, -2.0, 3.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
XY = np.array([[0.4, 0.2], [-1.0, 0.8], [1.2, -0.7]])


def moved(step: Floats) -> View:
    camera = camera_of(intrinsics_of(CAMERA) + step[:9], 1280, 720)
    return View(camera, turned(step[9:12]) @ VIEW.rotation, VIEW.translation + step[12:])


@pytest.mark.parametrize("column", range(15))
def test_slopes_are_those_of_differences(column: int) -> None:
    points = at_height(XY, np.array([0.0, 0.2, 0.1]))
    step = np.zeros(15)
    step[column] = 1e-6
    difference = (moved(step).project(points) - moved(-step).project(points)) / 2e-6
    np.testing.assert_allclose(
        view_jacobian(VIEW, points)[..., column], difference, rtol=1e-5, atol=1e-5
    )


def test_uncertainty_on_the_floor_is_that_of_many_cameras() -> None:
    rng = np.random.default_rng(1)
    sigma = np.array([1.0, 1.0, 2.0, 2.0, *[1e-3] * 2, *[1e-4] * 2, 1e-3, *[1e-3] * 3, *[2e-3] * 3])
    pixels = VIEW.project(at_height(XY, 0.2))
    steps = sigma * rng.standard_normal((3000, 15))
    heights = 0.2 + 0.004 * rng.standard_normal(3000)
    places = np.array(
        [moved(step).on_plane(pixels, height) for step, height in zip(steps, heights, strict=True)]
    )
    predicted = floor_covariance(VIEW, np.diag(sigma**2), XY, 0.2, 0.004)
    for k in range(3):
        np.testing.assert_allclose(np.cov(places[:, k].T), predicted[k], rtol=0.12, atol=6e-6)
