"""The compiled kernels against numpy, on pictures with all that can be in the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import ring_fit_reference as reference
from ring_scenes_small import CAR, CONES, Track, sheet, small_oblique_view, small_view

from geometry import Floats, RingShape, View, looking_at
from simulation import Frame, shadowed_light
from tracking import TrackerConfig, kernels
from tracking.edges import line_offsets
from tracking.marker_fit import fit_design
from tracking.measuring import Look, line_steps
from tracking.outlines import RingPlanes, RingTemplates, ring_templates
from tracking.profiles import grey_levels, line_points, line_vectors

EXACT = 1e-9
POSE = np.array([0.2, -0.1, 0.4])
LINES, SHAPE = 64, RingShape()
LIMITS = np.array([10.0, 0.5, 0.08])


def low_view() -> View:
    """Near rings are half as large again as far ones: each has a filter of its own."""
    up = np.array([0.0, 0.0, 1.0])
    return looking_at(small_view().camera, np.array([0.0, -2.6, 1.6]), np.zeros(3), up)


VIEWS = [small_view(), small_oblique_view(), low_view()]


def even(track: Track) -> Frame:
    return track.picture(POSE)


def moving(track: Track) -> Frame:
    return track.picture(POSE, (2.0, 0.8))


def shadowed(track: Track) -> Frame:
    return track.picture(POSE, light=shadowed_light((480, 640), np.random.default_rng(3), 6))


def covered(track: Track) -> Frame:
    """A cable, two sheets over parts, one over all, and a crumb."""
    centres = even(track).centres_px
    halves = [(200.0, 2.0), (6.0, 30.0), (30.0, 6.0), (40.0, 40.0), (3.0, 3.0)]
    aside = [0.0, 10.0, 9.0, 0.0, 11.0]
    return track.picture(
        POSE,
        occluders=[
            (sheet(centre + off, half), 20.0 + 3.0 * off)
            for centre, off, half in zip(centres, aside, halves, strict=False)
        ],
    )


@dataclass(frozen=True, eq=False)
class Looked:
    """Seven rings looked at, a little off where they are."""

    view: View
    rings: RingTemplates
    xy: Floats
    steps: Floats
    vectors: np.ndarray
    points: np.ndarray
    centres: Floats

    def fits(self, image: np.ndarray, weights: Floats, calm: Floats) -> tuple[Floats, Floats]:
        """By the kernel and by numpy."""
        levels, design = grey_levels(image, self.points), fit_design(LINES, SHAPE.ratio)
        mine = kernels.fit_rings(
            levels, weights, self.steps, calm,
            design.model, design.inverse, design.products, design.weights,
        )  # fmt: skip
        return mine, reference.fits(levels, weights, self.steps, calm, SHAPE.ratio)


def looked(view: View, off_m: float = 0.001) -> Looked:
    heights = np.array([0.0] * len(CONES) + [CAR.height_m] * 2)
    xy = np.array([*CONES, *(ring.xyz_m[:2] for ring in CAR.rings(POSE))])
    xy += np.random.default_rng(1).normal(0.0, off_m, xy.shape)
    planes = RingPlanes(heights, np.full(len(xy), SHAPE.radius_m), SHAPE.ratio)
    rings = ring_templates(view, xy, planes, LINES)
    steps = line_steps(rings.axes_px)
    vectors = line_vectors(LINES, line_offsets(steps))
    edges, centres = rings.placed(view, xy)
    points = line_points(edges, vectors)
    return Looked(view, rings, xy, steps, vectors, points, np.ascontiguousarray(centres))


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("matched", [True, False])
@pytest.mark.parametrize("scene", [even, moving, shadowed, covered])
def test_fits_are_those_of_numpy(
    scene: Callable[[Track], Frame], matched: bool, view: View
) -> None:
    look, rings = Look(TrackerConfig(lines=LINES), SHAPE), looked(view)
    frame = scene(Track(view, car=True, exposure_s=0.005))
    weights = look.filters(rings.rings.axes_px) if matched else look.area
    calm = look.calm(weights, rings.steps)
    for limit in (calm, 0.0 * calm, np.inf * calm):
        mine, theirs = rings.fits(frame.image, weights, limit)
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=EXACT)
    plain, robust = (rings.fits(frame.image, weights, s * calm)[0] for s in (np.inf, 0.0))
    # Of the calm both kinds of fit were compared.
    assert (plain[:, 3] != robust[:, 3]).sum() >= 2
    assert scene is not covered or robust[:, 4].min() < 0.9


def test_low_rings_have_filters_of_their_own() -> None:
    look = Look(TrackerConfig(lines=LINES), SHAPE)
    assert len(look.filters(looked(low_view()).rings.axes_px)) == len(CONES) + 2
    assert len(look.filters(looked(small_view()).rings.axes_px[: len(CONES)])) == 1


@pytest.mark.parametrize("level", [0, 255])
def test_a_picture_of_nothing_has_no_ring(level: int) -> None:
    look, rings = Look(TrackerConfig(lines=LINES), SHAPE), looked(small_view())
    image = np.full((480, 640), level, np.uint8)
    mine, theirs = rings.fits(image, look.area, look.calm(look.area, rings.steps))
    np.testing.assert_array_equal(mine, theirs)
    assert not kernels.acceptable(mine, rings.rings.axes_px, LIMITS).any()


@pytest.mark.parametrize("view", VIEWS)
def test_points_are_those_of_the_templates(view: View) -> None:
    rings = looked(view)
    floor, lens = floor_and_lens(view)
    moved = rings.xy + 0.02
    points, centres = kernels.ring_points(rings.rings.spread, moved, rings.vectors, floor, lens)
    edges, expected = rings.rings.placed(view, moved)
    np.testing.assert_allclose(centres, expected, rtol=0.0, atol=EXACT)
    # In single precision: two ways to round a sum may end at neighbouring numbers.
    single = line_points(edges, rings.vectors)
    np.testing.assert_allclose(points, single, rtol=0.0, atol=2.0 * np.spacing(np.float32(640)))


def test_a_ring_behind_the_camera_is_nowhere() -> None:
    rings = looked(low_view())
    floor, lens = floor_and_lens(rings.view)
    behind = rings.xy - np.array([0.0, 9.0])
    points, centres = kernels.ring_points(rings.rings.spread, behind, rings.vectors, floor, lens)
    assert np.isnan(points).all()
    assert np.isnan(centres).all()


@pytest.mark.parametrize("scene", [even, covered])
@pytest.mark.parametrize("view", VIEWS)
def test_rows_are_those_of_numpy(view: View, scene: Callable[[Track], Frame]) -> None:
    look, rings = Look(TrackerConfig(lines=LINES), SHAPE), looked(view)
    image = scene(Track(view, car=True)).image
    fits, _ = rings.fits(image, look.area, look.calm(look.area, rings.steps))
    axes, slopes = rings.rings.axes_px, rings.rings.inverse
    fine = reference.acceptable(fits, axes, LIMITS)
    assert fine.any()
    assert fine.all() == (scene is even)

    floor, lens = floor_and_lens(view)
    good, rows = kernels.moving_rows(
        fits, axes, rings.centres, rings.xy, slopes, rings.rings.spread, floor, lens, LIMITS
    )
    centres, xy = reference.moved(view, rings.rings, fits, rings.centres, rings.xy)
    np.testing.assert_array_equal(good, fine)
    expected = reference.report(fits, centres, xy, slopes)
    np.testing.assert_allclose(rows, expected, rtol=1e-9, atol=EXACT)

    gain = np.linspace(0.8, 1.2, len(fits))
    good, rows = kernels.standing_rows(
        fits, axes, rings.steps, gain, rings.centres, rings.xy, slopes, LIMITS
    )
    shift = fits[:, :2] / gain[:, None]
    near = np.linalg.norm(shift, axis=1) < 0.5 * rings.steps
    np.testing.assert_array_equal(good, fine & near)
    xy = rings.xy + np.einsum("nij,nj->ni", slopes, shift)
    expected = reference.report(fits, rings.centres + shift, xy, slopes)
    np.testing.assert_allclose(rows, expected, rtol=1e-9, atol=EXACT)


def test_only_good_rows_are_entered() -> None:
    rows = np.arange(33.0).reshape(3, 11)
    rows[:, 8] = 0.95, 0.94, 1.0
    table, states = np.full((5, 11), np.nan), np.full(5, 2, np.int8)
    kernels.enter(np.array([4, 0, 2]), np.array([True, True, False]), rows, 0.95, table, states)
    assert states.tolist() == [1, 2, 2, 2, 0]
    np.testing.assert_array_equal(table[[4, 0]], rows[:2])
    assert np.isnan(table[1:4]).all()


def test_constant_acceleration_is_foretold_exactly() -> None:
    """Three sights at uneven times tell a parabola, and the next place on it."""
    times_ns = np.array([0, 30_000_000, 75_000_000, 100_000_000])
    t = times_ns[:, None] * 1e-9
    path = np.array([0.3, -1.0]) + np.array([2.0, 1.0]) * t + np.array([3.0, -4.0]) * t**2
    xy, velocity, acceleration = np.full((2, 2), np.nan), np.full((2, 2), np.nan), np.zeros((2, 2))
    before_s, seen_ns, second = np.zeros(2), np.zeros(2, np.int64), np.array([1])
    state = xy, velocity, acceleration, before_s, seen_ns
    for k, limit in enumerate((0.0, 0.0, 15.0)):
        row = np.zeros((1, 11))
        row[0, 2:4] = path[k]
        kernels.remember(second, np.array([True]), row, int(times_ns[k]), limit, *state)
        kernels.remember(second, np.array([False]), 9.0 + row, int(times_ns[k]), limit, *state)
        if k == 0:
            there = kernels.predict(*state, int(times_ns[1]))
            np.testing.assert_array_equal(there[1], path[0])
    np.testing.assert_allclose(acceleration[1], [6.0, -8.0], rtol=1e-9)
    there = kernels.predict(*state, int(times_ns[3]))
    np.testing.assert_allclose(there[1], path[3], rtol=1e-12)
    assert np.isnan(there[0]).all()


@pytest.mark.parametrize("count", [1, 2, 3, 64, 127, 128])
def test_the_median_is_the_lower_of_the_middle(count: int) -> None:
    rng = np.random.default_rng(count)
    for values in (rng.normal(size=count), rng.integers(0, 4, count).astype(np.float64)):
        expected = np.sort(values)[(count - 1) // 2]
        assert kernels.median(values) == expected
    assert np.isnan(kernels.median(np.zeros(0)))


def floor_and_lens(view: View) -> tuple[Floats, Floats]:
    """As the kernels want them."""
    camera = view.camera
    floor = np.column_stack([view.rotation[:, :2], view.translation])
    return floor, np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])
