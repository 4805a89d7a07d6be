"""Where a camera stands, from exact and from noisy points."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import (
    Camera,
    CameraError,
    Floats,
    apply_homography,
    at_height,
    fit_homography,
    fit_planar_view,
    looking_at,
    refine_view,
    turned,
)

CAMERA = Camera(1920, 1080, 820.0, 815.0, 955.0, 545.0, (-0.12, 0.03, 0.0006, -0.0004, 0.0))
UP = np.array([0.0, 0.0, 1.0])
VIEW = looking_at(CAMERA, np.array([0.2, -2.4, 3.4]), np.array([0.1, 0.2, 0.0]), UP)
CORNERS = np.array([[-1.5, -1.5], [1.5, -1.4], [1.6, 1.5], [-1.5, 1.6]])


def test_a_homography_is_recovered_exactly() -> None:
    true = np.array([[1.2, 0.1, 30.0], [-0.2, 0.9, 10.0], [1e-3, -2e-3, 1.0]])
    points = 100.0 * CORNERS
    found = fit_homography(points, apply_homography(true, points))
    np.testing.assert_allclose(found, true, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("height_m", [0.0, 0.35])
def test_four_points_of_a_plane_tell_the_view(height_m: float) -> None:
    points = at_height(CORNERS, height_m)
    fit = fit_planar_view(CAMERA, points, VIEW.project(points))
    np.testing.assert_allclose(fit.view.rotation, VIEW.rotation, atol=1e-10)
    np.testing.assert_allclose(fit.view.position, VIEW.position, atol=1e-10)
    assert np.abs(fit.residuals_px).max() < 1e-8


def scattered(n: int) -> Floats:
    rng = np.random.default_rng(5)
    return at_height(rng.uniform(-1.6, 1.6, (n, 2)), rng.choice([0.0, 0.1, 0.3], n))


def test_points_of_any_height_refine_a_view() -> None:
    points = scattered(12)
    start = fit_planar_view(CAMERA, at_height(CORNERS, 0.0), VIEW.project(at_height(CORNERS, 0.02)))
    fit = refine_view(start.view, points, VIEW.project(points))
    np.testing.assert_allclose(fit.view.position, VIEW.position, atol=1e-9)


def test_the_covariance_is_that_of_the_errors() -> None:
    points, sigma_px = scattered(12), 0.05
    rng = np.random.default_rng(6)
    distances = []
    for _ in range(200):
        pixels = VIEW.project(points) + rng.normal(0.0, sigma_px, (12, 2))
        fit = refine_view(VIEW, points, pixels)
        turn = fit.view.rotation @ VIEW.rotation.T
        small = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
        error = np.concatenate([small, fit.view.translation - VIEW.translation])
        distances.append(error @ np.linalg.solve(sigma_px**2 * fit.covariance, error))
    # The mean of 200 chi-square numbers of 6 degrees: 6 with a standard deviation of 0.24.
    assert np.mean(distances) == pytest.approx(6.0, abs=1.0)


def test_points_that_do_not_tell_a_view_are_refused() -> None:
    on_floor = at_height(CORNERS, 0.0)
    with pytest.raises(CameraError, match="at least 4"):
        fit_planar_view(CAMERA, on_floor[:3], VIEW.project(on_floor[:3]))
    line = at_height(np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.3, 1.0]]), 0.0)
    with pytest.raises(CameraError, match="one line"):
        fit_planar_view(CAMERA, line, VIEW.project(line))
    with pytest.raises(CameraError, match="one height"):
        fit_planar_view(CAMERA, scattered(8), VIEW.project(scattered(8)))
    with pytest.raises(CameraError, match="coincide"):
        fit_homography(np.ones((4, 2)), CORNERS)


def test_a_turn_is_the_exponential_of_its_vector() -> None:
    np.testing.assert_allclose(turned(np.zeros(3)), np.eye(3))
    quarter = turned(np.array([0.0, 0.0, np.pi / 2.0]))
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    many = np.linalg.matrix_power(turned(np.array([0.01, -0.02, 0.03])), 10)
    np.testing.assert_allclose(many, turned(np.array([0.1, -0.2, 0.3])), atol=1e-12)
