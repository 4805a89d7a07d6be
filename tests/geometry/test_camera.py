"""Cameras, against OpenCV's projection, finite differences and round trips."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import Camera, CameraError, Floats, View, at_height, looking_at

LENS = (-0.25, 0.08, 0.001, -0.0007, 0.01)
CAMERA = Camera(1920, 1080, 1650.0, 1640.0, 955.0, 545.0, LENS)
UP = np.array([0.0, 0.0, 1.0])
VIEW = looking_at(CAMERA, np.array([0.5, -1.2, 3.5]), np.array([1.0, 1.5, 0.0]), UP)
LENSES = st.tuples(
    st.floats(-0.3, 0.3), st.floats(0.0, 0.1), st.floats(-3e-3, 3e-3), st.floats(-3e-3, 3e-3),
    st.floats(0.0, 0.05),
)  # fmt: skip


def floor_points(n: int = 200) -> Floats:
    rng = np.random.default_rng(3)
    return at_height(rng.uniform((-0.5, -0.3), (3.0, 3.0), (n, 2)), rng.uniform(0.0, 0.4, n))


@given(LENSES)
def test_pixels_are_those_of_opencv(lens: tuple[float, float, float, float, float]) -> None:
    camera = Camera(1920, 1080, 1650.0, 1640.0, 955.0, 545.0, lens)
    view = View(camera, VIEW.rotation, VIEW.translation)
    turn, _ = cv2.Rodrigues(view.rotation)
    theirs, _ = cv2.projectPoints(
        floor_points(), turn, view.translation, camera.matrix, np.array(lens)
    )
    np.testing.assert_allclose(view.project(floor_points()), theirs[:, 0], rtol=0, atol=1e-8)


@given(LENSES)
def test_a_pixel_leads_back_to_its_ray(lens: tuple[float, float, float, float, float]) -> None:
    camera = Camera(1920, 1080, 1650.0, 1640.0, 955.0, 545.0, lens)
    grid = np.stack(np.meshgrid(np.linspace(0, 1919, 17), np.linspace(0, 1079, 11)), axis=-1)
    plane = camera.undistorted(grid)
    known = np.asarray(np.isfinite(plane).all(axis=-1))
    assert known[2:-2, 3:-3].all()
    np.testing.assert_allclose(camera.distorted(plane)[known], grid[known], rtol=0, atol=1e-10)


def test_a_pixel_that_a_folding_lens_cannot_see_is_nan() -> None:
    folding = Camera(640, 480, 400.0, 400.0, 320.0, 240.0, (-0.3, 0.0, 0.0, 0.0, 0.0))
    # The radius r (1 - 0.3 r^2) grows until r = 1.054, where it is 0.703: 281 px.
    pixels = np.array([[320.0 + 270.0, 240.0], [320.0 + 290.0, 240.0]])
    plane = folding.undistorted(pixels)
    assert np.isfinite(plane[0]).all()
    assert np.isnan(plane[1]).all()


def test_a_plane_of_any_height_is_met_where_the_point_was() -> None:
    points = floor_points()
    found = VIEW.on_plane(VIEW.project(points), points[:, 2])
    np.testing.assert_allclose(found, points[:, :2], rtol=0, atol=1e-12)


def test_rays_into_the_sky_meet_no_floor_and_points_behind_make_no_pixel() -> None:
    level = looking_at(CAMERA, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0]), UP)
    above, below = level.on_plane(np.array([[955.0, 100.0], [955.0, 1000.0]]), 0.0)
    assert np.isnan(above).all()
    assert np.isfinite(below).all()
    assert np.isnan(level.project(np.array([-1.0, 0.0, 1.0]))).all()


def test_slopes_are_finite_differences() -> None:
    xy, height, step = floor_points(20)[:, :2], 0.2, 1e-6
    slopes = VIEW.plane_jacobian(xy, height)
    for axis in range(2):
        aside = step * np.eye(2)[axis]
        after, before = (VIEW.project(at_height(xy + s * aside, height)) for s in (1, -1))
        np.testing.assert_allclose(slopes[..., axis], (after - before) / (2 * step), rtol=1e-5)


def test_up_is_up_in_the_image() -> None:
    low, high = VIEW.project(np.array([[1.0, 1.5, 0.0], [1.0, 1.5, 0.3]]))
    assert high[1] < low[1]
    np.testing.assert_allclose(low, [CAMERA.cx, CAMERA.cy], atol=1e-9)
    np.testing.assert_allclose(VIEW.position, [0.5, -1.2, 3.5], atol=1e-12)


@pytest.mark.parametrize(
    "numbers",
    [
        (0, 480, 400.0, 400.0, 320.0, 240.0),
        (640, 480, -400.0, 400.0, 320.0, 240.0),
        (640, 480, 400.0, float("nan"), 320.0, 240.0),
    ],
)
def test_what_is_no_camera_is_refused(
    numbers: tuple[int, int, float, float, float, float],
) -> None:
    with pytest.raises(CameraError):
        Camera(*numbers)


def test_what_is_no_view_is_refused() -> None:
    with pytest.raises(CameraError, match="not a rotation"):
        View(CAMERA, 1.01 * np.eye(3), np.zeros(3))
    with pytest.raises(CameraError, match="look somewhere"):
        looking_at(CAMERA, np.array([0.0, 0.0, 3.0]), np.zeros(3), UP)
