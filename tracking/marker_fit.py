"""The fit of one known marker: how far it is from where it was expected, from both of its edges.

Offsets come as (n, K, 2), outer and inner edge. Unknowns: shift in x and y (both edges), growth of
each edge, and two terms of flattening that scale with the edge. On a whole marker the shift is
orthogonal to the rest; on a partly covered one weak priors keep the rest from running away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from geometry import Floats
from tracking.edges import REACH
from tracking.profiles import Samples, harmonics

_EYE = np.eye(2)
_TUKEY = 4.7
_ROUNDS = 8
_BRIGHT, _ENOUGH = 0.7, 0.4
_PRIOR = 1.0
"""Growth and flattening are zero: said as loudly as by one line."""
_SHARED = 1.6
"""Neighbouring lines share pixels: the shift's variance is so much more than theirs would say."""
_DIM = 0.35
"""A line with less than this share of the marker's contrast crosses no edge."""


@dataclass(frozen=True, eq=False)
class MarkerFits:
    """How n markers are off from where they were expected.

    shift_px : (n, 2); growth_px : (n,) of the outer edge; scatter_px : (n,) of the lines round the
    fit; inliers : (n,) share of the lines that count; contrast : (n,); covariance_px : (n, 2, 2) of
    the shift.
    """

    shift_px: Floats
    growth_px: Floats
    scatter_px: Floats
    inliers: Floats
    contrast: Floats
    covariance_px: Floats


@lru_cache(maxsize=8)
def _design(lines: int, ratio: float) -> tuple[Floats, Floats, Floats, float]:
    """Model (2 K, 6), its weighted inverse (6, 2 K), line weights of sum 1 (2 K,), variance factor.

    The inner edge is shorter by `ratio` and sampled as often, so each of its lines says less.
    """
    base = harmonics(lines)
    zero, one = np.zeros(lines), np.ones(lines)
    outer = np.column_stack([base[:, :2], one, zero, base[:, 3:]])
    inner = np.column_stack([base[:, :2], zero, one, ratio * base[:, 3:]])
    model = np.stack([outer, inner], axis=1).reshape(2 * lines, 6)
    weights = np.tile([1.0, ratio], lines)
    normal = model.T @ (weights[:, None] * model)
    inverse = np.linalg.solve(normal, model.T * weights)
    return model, inverse, weights / weights.sum(), _SHARED * float((inverse[0] ** 2).sum())


@lru_cache(maxsize=8)
def _single_design(lines: int, ratio: float) -> tuple[Samples, Samples, Samples, float]:
    """`_design` in single precision and transposed: offsets are no better than that."""
    model, inverse, weights, factor = _design(lines, ratio)

    def single(array: Floats) -> Samples:
        return np.ascontiguousarray(array, np.float32)

    return single(model.T), single(inverse.T), single(weights), factor


def plain_fits(contrast: Samples, offsets: Samples, steps_px: Floats, ratio: float) -> MarkerFits:
    """Least squares, every line counts: for markers that nothing disturbs. Offsets in steps."""
    n, lines, _ = offsets.shape
    model, inverse, weights, factor = _single_design(lines, ratio)
    flat = offsets.reshape(n, -1)
    fit = flat @ inverse
    left = flat - fit @ model
    variance: Floats = (left * left) @ weights * (steps_px * steps_px)
    covariance = (factor * variance)[:, None, None] * _EYE
    fit_px: Floats = fit * steps_px[:, None]
    typical = np.asarray(contrast.reshape(n, -1) @ weights, np.float64)
    shift, growth, scatter = fit_px[:, :2], fit_px[:, 2], np.asarray(np.sqrt(variance))
    return MarkerFits(shift, growth, scatter, np.ones(n), typical, covariance)


def robust_fits(contrast: Samples, offsets: Samples, step_px: Floats, ratio: float) -> MarkerFits:
    """Iteratively reweighted least squares (Tukey's biweight) of the lines that cross an edge."""
    n, lines, _ = offsets.shape
    offset_px = offsets * step_px[:, None, None]
    model, _, weights, _ = _design(lines, ratio)
    flat, lit = offset_px.reshape(n, -1), _lit(contrast, offset_px, step_px)
    flat = np.where(lit, flat, 0.0)
    products = (model[:, :, None] * model[:, None, :]).reshape(-1, 36)
    weights = weights / weights.max()
    prior = np.diag([1e-9, 1e-9, *[_PRIOR] * 4])
    weight = weights * _first(contrast.reshape(n, -1), lit)
    scatter = np.full(n, np.nan)
    for _ in range(_ROUNDS):
        normal = (weight @ products).reshape(n, 6, 6) + prior
        fit = np.linalg.solve(normal, ((weight * flat) @ model)[..., None])[..., 0]
        left = np.where(lit, flat - fit @ model.T, np.nan)
        with np.errstate(invalid="ignore"):
            scatter = 1.4826 * _median(np.abs(left)) + 0.01 * step_px
            share = np.nan_to_num(left / (_TUKEY * scatter[:, None]), nan=9.0)
        weight = weights * np.maximum(1.0 - share**2, 0.0) ** 2
    covariance = np.linalg.inv(normal)[:, :2, :2] * (_SHARED * scatter**2)[:, None, None]
    inliers = (weight > 0.25 * weights).mean(axis=1)
    return MarkerFits(
        fit[:, :2],
        fit[:, 2],
        scatter,
        inliers,
        _median(contrast.reshape(n, -1).astype(np.float64)),
        covariance,
    )


def _first(contrast: Samples, lit: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """The lines (n, 2 K) to begin with: those of most contrast, if they are enough.

    What lies over a ring makes edges, too, but mostly fainter ones; a shadow's are left out with
    them and come in again when they fit.
    """
    bright = lit & (contrast > _BRIGHT * np.quantile(contrast, 0.75, axis=1)[:, None])
    enough = bright.mean(axis=1) > _ENOUGH
    return np.where(enough[:, None], bright, lit)


def _lit(contrast: Samples, offset_px: Floats, step_px: Floats) -> npt.NDArray[np.bool_]:
    n = len(contrast)
    typical = _median(np.maximum(contrast.reshape(n, -1), 0.0).astype(np.float64))
    within = np.abs(offset_px) < (REACH * step_px)[:, None, None]
    lit: npt.NDArray[np.bool_] = within & (contrast > _DIM * typical[:, None, None])
    return lit.reshape(n, -1)


def _median(rows: Floats) -> Floats:
    """Of each row (n, k), what is not finite left out; NaN of nothing."""
    ordered = np.sort(rows, axis=1)
    counts = np.isfinite(rows).sum(axis=1)
    middle = np.take_along_axis(ordered, np.maximum(counts - 1, 0)[:, None] // 2, axis=1)[:, 0]
    return np.asarray(np.where(counts > 0, middle, np.nan))
