"""Edges from samples: closed forms of blurred steps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erf

from geometry import Floats
from tracking.edges import REACH, SAMPLES, area_filter, edge_offsets, matched_filter
from tracking.profiles import Samples

SIGMA_PX, BLACK_PX, PAPER_PX = 0.8, 8.2, 4.9


def beyond(distance: Floats) -> Floats:
    return np.asarray(0.5 + 0.5 * erf(distance / (SIGMA_PX * np.sqrt(2.0))))


def line(
    outer_px: float,
    inner_px: float,
    levels: tuple[float, float, float, float] = (170.0, 45.0, 170.0, 110.0),
) -> Samples:
    """Samples (1, 14) across an outer and an inner edge moved outwards by so many pixels."""
    inside, ring, paper, floor = levels
    offsets = np.arange(-REACH, REACH + 1.0)
    to_outer = np.concatenate([offsets, offsets - BLACK_PX])
    at_inner, at_outer = to_outer + BLACK_PX - inner_px, to_outer - outer_px
    step = inside + (ring - inside) * beyond(at_inner) + (paper - ring) * beyond(at_outer)
    return np.asarray(step + (floor - paper) * beyond(to_outer - PAPER_PX), np.float32)[None]


def matched() -> Samples:
    return matched_filter(1.0, BLACK_PX, PAPER_PX, SIGMA_PX)


@pytest.mark.parametrize("shift", [-1.2, -0.4, 0.0, 0.7, 1.2])
def test_the_area_tells_any_shift_a_little_short(shift: float) -> None:
    contrast, offset = edge_offsets(line(shift, -shift), area_filter(2), 1)
    np.testing.assert_allclose(contrast[0, 0], [125.0, 125.0], rtol=0.1)
    np.testing.assert_allclose(offset[0, 0], [shift, -shift], atol=0.005, rtol=0.2)


def test_the_matched_filter_has_gain_one_near_the_edge() -> None:
    _, offset = edge_offsets(line(0.05, -0.03), matched(), 1)
    np.testing.assert_allclose(offset[0, 0], [0.05, -0.03], rtol=0.1)


@pytest.mark.parametrize(
    "levels", [(80.0, 45.0, 170.0, 110.0), (170.0, 45.0, 85.0, 60.0), (170.0, 20.0, 85.0, 200.0)]
)
def test_levels_of_their_own_do_not_move_the_edges(
    levels: tuple[float, float, float, float],
) -> None:
    """A shadow may darken the paper outside and not the disc inside, or the reverse."""
    contrast, offset = edge_offsets(line(0.0, 0.0, levels), matched(), 1)
    inside, ring, paper, _ = levels
    np.testing.assert_allclose(contrast[0, 0], [paper - ring, inside - ring], rtol=0.03)
    np.testing.assert_allclose(offset[0, 0], 0.0, atol=0.02)


def test_the_matched_filter_is_quieter_than_the_area() -> None:
    rng = np.random.default_rng(2)
    noisy = line(0.0, 0.0) + np.float32(2.5) * rng.standard_normal((4000, 14), np.float32)

    def noise_at_gain_one(weights: Samples) -> float:
        gain = edge_offsets(line(0.1, 0.1), weights, 1)[1][0, 0, 0] / 0.1
        return float(edge_offsets(noisy, weights, 1)[1][:, 0, 0].std() / gain)

    area = noise_at_gain_one(area_filter(2))
    assert noise_at_gain_one(matched()) ** 2 < 0.6 * area**2


def test_where_there_is_no_edge_the_offset_is_not_finite() -> None:
    flat = np.full((1, 2 * SAMPLES), 100.0, np.float32)
    _, offset = edge_offsets(flat, area_filter(2), 1)
    assert not np.isfinite(offset).any()
