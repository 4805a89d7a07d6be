"""Images of circles: the bias of the ellipse's centre, in closed form and removed."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import (
    Camera,
    CameraError,
    RingShape,
    View,
    apparent_centre,
    at_height,
    circle_centres,
    circle_outline,
    looking_at,
)

RADIUS_M = 0.061
LENS = (-0.2, 0.05, 0.001, -0.0007, 0.0)
UP = np.array([0.0, 0.0, 1.0])
PLACES = np.random.default_rng(8).uniform(-1.5, 1.5, (30, 2))


def oblique(lens: tuple[float, float, float, float, float] = LENS) -> View:
    camera = Camera(1920, 1080, 820.0, 815.0, 955.0, 545.0, lens)
    return looking_at(camera, np.array([0.2, -2.7, 3.4]), np.zeros(3), UP)


def test_without_a_lens_the_apparent_centre_is_that_of_the_cone_cut() -> None:
    """The circle's cone of rays, cut by the image plane, is a conic whose centre is known."""
    view = oblique((0.0, 0.0, 0.0, 0.0, 0.0))
    for xy in PLACES[:5]:
        # Plane coordinates -> image plane, and the circle as a conic in plane coordinates.
        to_image = np.column_stack(
            [view.rotation[:, :2], view.rotation @ [*xy, 0.0] + view.translation]
        )
        inverse = np.linalg.inv(to_image)
        conic = inverse.T @ np.diag([1.0, 1.0, -(RADIUS_M**2)]) @ inverse
        centre = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
        expected = view.camera.distorted(centre)
        found = apparent_centre(view, xy, 0.0, RADIUS_M)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_the_bias_is_worth_removing_and_is_removed_exactly() -> None:
    view, height_m = oblique(), 0.2
    apparent = apparent_centre(view, PLACES, height_m, RADIUS_M)
    true = view.project(at_height(PLACES, height_m))
    assert np.abs(apparent - true).max() > 0.05
    found = circle_centres(view, apparent, height_m, RADIUS_M)
    np.testing.assert_allclose(found, PLACES, rtol=0, atol=1e-11)


def test_each_circle_may_have_a_height_of_its_own() -> None:
    view, heights = oblique(), np.linspace(0.0, 0.3, len(PLACES))
    apparent = apparent_centre(view, PLACES, heights, RADIUS_M)
    found = circle_centres(view, apparent, heights, RADIUS_M)
    np.testing.assert_allclose(found, PLACES, rtol=0, atol=1e-11)


def test_an_outline_is_round_on_its_plane() -> None:
    view = oblique()
    outline = circle_outline(view, PLACES, 0.1, RADIUS_M, points=16)
    back = view.on_plane(outline, 0.1)
    radii = np.linalg.norm(back - PLACES[:, None], axis=2)
    np.testing.assert_allclose(radii, RADIUS_M, rtol=0, atol=1e-11)


def test_swapped_diameters_are_told() -> None:
    with pytest.raises(CameraError, match="swapped"):
        RingShape(0.05, 0.122)
    with pytest.raises(CameraError, match="margin"):
        RingShape(margin=0.9)
