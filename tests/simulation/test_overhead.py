"""The renderer, against areas and centroids that are known."""

from __future__ import annotations

import numpy as np
import pytest
from floor_views import SHAPE, small_oblique_view, small_view

from geometry import Floats, RingShape, View, apparent_centre, circle_outline
from simulation import (
    Blur,
    CarPlan,
    Frame,
    Glare,
    Light,
    OverheadScene,
    Ring,
    cluttered_floor,
    oblique_view,
    plain_floor,
    shadowed_light,
    straight_down_view,
)

PLACE = (0.31, -0.22)


def grey_floor(level: float = 170.0) -> np.ndarray:
    """A floor as bright as the paper: only the black of a ring is then seen."""
    return np.full(SHAPE, level, np.float32)


def picture(view: View, ring: Ring, blur: Blur | None = None) -> Frame:
    scene = OverheadScene(view, [ring], floor=grey_floor(), blur=blur)
    return scene.frame(np.random.default_rng(0), noise=0.0)


def darkness(frame: Frame) -> Floats:
    return 170.0 - frame.image.astype(np.float64)


def centroid(weight: Floats) -> Floats:
    rows, columns = np.mgrid[: weight.shape[0], : weight.shape[1]]
    moments = np.array([(weight * columns).sum(), (weight * rows).sum()])
    return np.asarray(moments / weight.sum())


def spread(weight: Floats) -> Floats:
    """Variances along columns and rows."""
    rows, columns = np.mgrid[: weight.shape[0], : weight.shape[1]]
    x, y = centroid(weight)
    moments = [(weight * (columns - x) ** 2).sum(), (weight * (rows - y) ** 2).sum()]
    return np.asarray(np.array(moments) / weight.sum())


def polygon_area(points: Floats) -> float:
    x, y = points.T
    return abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) / 2.0


@pytest.mark.parametrize("view", [small_view(), small_oblique_view()])
@pytest.mark.parametrize("height_m", [0.0, 0.2])
def test_a_ring_is_as_dark_as_it_is_large_and_where_it_is(view: View, height_m: float) -> None:
    shape = RingShape()
    frame = picture(view, Ring((*PLACE, height_m), shape))
    radii = (shape.radius_m, shape.inner_diameter_m / 2.0)
    areas = [polygon_area(circle_outline(view, np.array(PLACE), height_m, r, 512)) for r in radii]
    dark = darkness(frame)
    assert dark.sum() / 125.0 == pytest.approx(areas[0] - areas[1], rel=2e-3)
    centres = [apparent_centre(view, np.array(PLACE), height_m, r) for r in radii]
    expected = (areas[0] * centres[0] - areas[1] * centres[1]) / (areas[0] - areas[1])
    np.testing.assert_allclose(centroid(dark), expected, rtol=0, atol=0.01)
    assert np.abs(frame.centres_px[0] - expected).max() < 0.3


def test_a_tilted_ring_is_narrower() -> None:
    flat, tilted = (
        darkness(picture(small_view(), Ring((*PLACE, 0.0), tilt_rad=(angle, 0.0)))).sum()
        for angle in (0.0, np.radians(40.0))
    )
    assert tilted / flat == pytest.approx(np.cos(np.radians(40.0)), abs=0.1)


def test_motion_smears_along_the_way_round_the_middle_of_the_exposure() -> None:
    moving = Ring((*PLACE, 0.0), velocity_m_s=(3.0, 0.0))
    sharp = darkness(picture(small_view(), Ring((*PLACE, 0.0))))
    smeared = darkness(picture(small_view(), moving, Blur(exposure_s=0.01)))
    assert smeared.sum() == pytest.approx(sharp.sum(), rel=5e-3)
    np.testing.assert_allclose(centroid(smeared), centroid(sharp), rtol=0, atol=0.02)
    # 3 m/s for 10 ms are 30 mm or 6.84 px, evenly spread: a variance of a twelfth of its square.
    wider = spread(smeared) - spread(sharp)
    assert wider[0] == pytest.approx(6.84**2 / 12.0, rel=0.03)
    assert wider[1] == pytest.approx(0.0, abs=0.03)


def test_the_same_seed_gives_the_same_picture() -> None:
    def render(seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        scene = OverheadScene(small_view(), [], floor=cluttered_floor(SHAPE, rng, 40))
        return scene.frame(rng, light=shadowed_light(SHAPE, rng)).image

    np.testing.assert_array_equal(render(3), render(3))
    assert (render(3) != render(4)).any()


def test_noise_light_gain_and_glare_do_what_they_say() -> None:
    scene = OverheadScene(small_view(), [], floor=grey_floor(100.0))
    rng = np.random.default_rng(1)
    assert scene.frame(rng, noise=2.5).image.std() == pytest.approx(2.5, abs=0.1)
    assert (scene.frame(rng, noise=0.0, gain=3.0).image == 255).all()
    half = Light(np.full(SHAPE, 0.5, np.float32), (Glare(200.0, 100.0, 80.0, 6.0),))
    image = scene.frame(rng, noise=0.0, light=half).image
    assert image[100, 200] == 130
    assert image[400, 600] == 50


def test_the_car_hides_the_floor_and_carries_its_rings() -> None:
    car, pose = CarPlan(), np.array([0.1, 0.2, 0.7])
    scene = OverheadScene(small_view(), [], floor=grey_floor())
    rng = np.random.default_rng(0)
    frame = scene.frame(rng, moving=car.rings(pose), body=car.outline(pose), noise=0.0)
    front, rear = frame.xyz_m
    np.testing.assert_allclose(front - rear, [0.2 * np.cos(0.7), 0.2 * np.sin(0.7), 0.0])
    middle = frame.centres_px.mean(axis=0).round().astype(int)
    assert frame.image[middle[1], middle[0]] < 170
    forward = car.rings(pose, (1.0, 0.0), 2.0)[0].velocity_m_s
    np.testing.assert_allclose(forward, [1.0 - 2.0 * 0.25 * np.sin(0.7), 2.0 * 0.25 * np.cos(0.7)])


def test_occluders_lie_in_front_and_jpeg_changes_little() -> None:
    scene = OverheadScene(small_view(), [Ring((0.0, 0.0, 0.0))], floor=grey_floor())
    sheet = np.array([[0.0, 0.0], [639.0, 0.0], [639.0, 479.0], [0.0, 479.0]])
    rng = np.random.default_rng(0)
    assert (scene.frame(rng, noise=0.0, occluders=[(sheet, 90.0)]).image == 90).all()
    plain, packed = (scene.frame(rng, noise=0.0, jpeg_quality=q).image for q in (None, 92))
    off = np.abs(plain.astype(int) - packed.astype(int))
    assert 0 < off.max() < 30


def test_a_ring_outside_of_the_picture_leaves_it_alone() -> None:
    scene = OverheadScene(small_view(), [Ring((9.0, 9.0, 0.0))], floor=grey_floor())
    assert (scene.frame(np.random.default_rng(0), noise=0.0).image == 170).all()


def test_a_floor_of_another_size_is_refused() -> None:
    floor = plain_floor((100, 100), np.random.default_rng(0))
    with pytest.raises(ValueError, match="shape"):
        OverheadScene(small_view(), [], floor=floor)


def test_the_usual_views_see_a_ring_of_28_pixels() -> None:
    for view in (straight_down_view(), oblique_view()):
        middle = np.array([view.camera.cx, view.camera.cy])
        assert np.isfinite(view.on_plane(middle, 0.0)).all()
    slopes = straight_down_view().plane_jacobian(np.zeros(2), 0.0)
    assert 0.122 * np.sqrt(abs(np.linalg.det(slopes))) == pytest.approx(27.7, abs=0.1)
