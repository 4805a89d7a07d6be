"""Rings in single pictures: real ones, rendered ones, and pictures that are none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from ring_scenes_small import CONES, cone_rings, small_oblique_view, small_view

from geometry import View, apparent_centre
from simulation import Frame, OverheadScene, Ring, cluttered_floor, shadowed_light
from tracking import ImageError, RingSearch, find_rings, grey_image

SHAPE = (480, 640)


def rendered(view: View, seed: int = 0, *, hard: bool = False) -> Frame:
    rng = np.random.default_rng(seed)
    floor = cluttered_floor(SHAPE, rng, 30) if hard else None
    light = shadowed_light(SHAPE, rng, 4) if hard else None
    return OverheadScene(view, cone_rings(), floor=floor).frame(rng, light=light)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "centre", "axes", "ratio"),
    [
        ("lab_0000.png", (877.4, 452.6), (153.0, 148.0), 0.37),
        ("lab_0001.png", (638.6, 401.4), (36.1, 34.8), 0.43),
    ],
)
def test_a_real_frame_shows_its_one_marker(
    data_dir: Path,
    name: str,
    centre: tuple[float, float],
    axes: tuple[float, float],
    ratio: float,
) -> None:
    """Pixels as OpenCV counts them, without the half pixel of which the data's README speaks.

    An ellipse fitted to OpenCV's contour of the same ring has its centre at (877.78, 452.63) and
    (638.69, 401.48) in OpenCV's own count: the README's figures are in that count, too.
    """
    image = cv2.imread(str(data_dir / "whycon" / name))
    found = find_rings(image)
    assert len(found) == 1
    assert np.hypot(*(found.centres_px[0] - centre)) < 0.3
    np.testing.assert_allclose(found.diameters_px[0], axes, atol=1.5)
    assert found.ratio[0] == pytest.approx(ratio, abs=0.03)


@pytest.mark.realdata
def test_of_the_arena_only_the_robot_is_a_ring(data_dir: Path) -> None:
    found = find_rings(cv2.imread(str(data_dir / "whycon" / "arena_oblique.jpg")))
    assert len(found) == 1
    np.testing.assert_allclose(found.centres_px[0], [1239.0, 214.0], atol=2.0)


@pytest.mark.parametrize("view", [small_view(), small_oblique_view()])
def test_rings_are_found_where_they_appear(view: View) -> None:
    frame = rendered(view)
    found = find_rings(frame.image, RingSearch(smallest_px=14.0))
    expected = apparent_centre(view, np.array(CONES), 0.0, 0.061)
    apart = np.linalg.norm(found.centres_px[:, None] - expected, axis=2)
    assert len(found) == len(CONES)
    assert sorted(apart.argmin(axis=0)) == list(range(len(CONES)))
    assert apart.min(axis=0).max() < 0.06
    off = found.centres_px - expected[apart.argmin(axis=1)]
    told = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance_px), off)
    assert told.mean() / 2.0 < 4.0


def test_shadows_and_clutter_hide_few_and_add_none() -> None:
    seen = wrong = 0
    for seed in range(10, 18):
        frame = rendered(small_view(), seed, hard=True)
        found = find_rings(frame.image)
        apart = np.linalg.norm(found.centres_px[:, None] - frame.centres_px, axis=2)
        seen += int((apart.min(axis=0) < 1.0).sum())
        wrong += int((apart.min(axis=1) > 1.0).sum())
    assert seen >= 39  # of 40
    assert wrong == 0


@pytest.mark.parametrize("gain", [0.25, 1.4])
def test_dark_and_bright_pictures_show_them_too(gain: float) -> None:
    frame = OverheadScene(small_view(), cone_rings()).frame(np.random.default_rng(1), gain=gain)
    assert len(find_rings(frame.image)) == len(CONES)


def test_rings_of_every_size_are_found_in_one_picture() -> None:
    rows, columns = np.mgrid[:1920, :2560] / 4.0 - 0.375
    picture = np.full(rows.shape, 110.0, np.float32)
    for x, radius in ((40, 11.0), (110, 20.0), (230, 45.0), (460, 120.0)):
        distance = np.hypot(columns - x, rows - 240) / radius
        for scale, grey in ((1.35, 170.0), (1.0, 45.0), (50.0 / 122.0, 170.0)):
            picture[distance < scale] = grey
    picture = cv2.GaussianBlur(picture, (0, 0), 2.8)
    found = find_rings(
        cv2.resize(picture, (640, 480), interpolation=cv2.INTER_AREA).astype(np.uint8)
    )
    np.testing.assert_allclose(sorted(found.centres_px[:, 0]), [40, 110, 230, 460], atol=0.1)
    np.testing.assert_allclose(sorted(found.diameters_px[:, 0]), [22, 40, 90, 240], rtol=0.03)


def test_a_ring_cut_by_the_border_is_not_given() -> None:
    view = small_view()
    x = float(view.on_plane(np.array([8.0, 240.0]), 0.0)[0])
    scene = OverheadScene(view, [Ring((x, 0.0, 0.0)), Ring((0.0, 0.0, 0.0))])
    found = find_rings(scene.frame(np.random.default_rng(0)).image)
    assert len(found) == 1
    assert found.centres_px[0, 0] > 100.0


def test_a_region_gives_pixels_of_the_whole_picture() -> None:
    frame = rendered(small_view())
    whole = find_rings(frame.image)
    part = find_rings(frame.image, region=(slice(240, 480), slice(300, 640)))
    assert 0 < len(part) < len(whole)
    apart = np.linalg.norm(part.centres_px[:, None] - whole.centres_px, axis=2)
    np.testing.assert_allclose(apart.min(axis=1), 0.0, atol=1e-3)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros(SHAPE, np.uint8),
        np.full(SHAPE, 255, np.uint8),
        np.random.default_rng(0).integers(0, 256, SHAPE, np.uint8),
        np.zeros((1, 1), np.uint8),
        np.zeros((9, 9), np.uint8),
        np.zeros((30, 5), np.uint8),
        np.tile(np.array([[0, 255], [255, 0]], np.uint8).repeat(8, 0).repeat(8, 1), (30, 40)),
    ],
    ids=["black", "white", "noise", "one pixel", "tiny", "narrow", "chequered"],
)
def test_a_picture_without_rings_shows_none(image: np.ndarray) -> None:
    found = find_rings(image)
    assert len(found) == 0
    assert found.centres_px.shape == (0, 2)
    assert found.diameters_px.shape == (0, 2)


def test_colour_and_grey_are_the_same_rings() -> None:
    grey = rendered(small_view()).image
    colour = find_rings(np.repeat(grey[:, :, None], 3, axis=2))
    np.testing.assert_allclose(colour.centres_px, find_rings(grey).centres_px)
    assert grey_image(grey[:, :, None]).shape == grey.shape


@pytest.mark.parametrize(
    "image",
    [
        np.zeros(SHAPE, np.float32),
        np.zeros(SHAPE, np.uint16),
        np.zeros((*SHAPE, 4), np.uint8),
        np.zeros((0, 5), np.uint8),
        np.zeros(12, np.uint8),
    ],
)
def test_what_is_no_picture_is_refused(image: np.ndarray) -> None:
    with pytest.raises(ImageError, match="a picture must"):
        find_rings(image)


def test_a_file_that_could_not_be_decoded_is_refused() -> None:
    nothing = cv2.imdecode(np.zeros(10, np.uint8), cv2.IMREAD_GRAYSCALE)
    with pytest.raises(ImageError, match="NoneType"):
        find_rings(nothing)
