"""What `tracking.kernels` reckons, in numpy and double precision, independent of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats, View
from tracking.edges import REACH
from tracking.images import Image
from tracking.outlines import RingTemplates
from tracking.profiles import harmonics

Truths = npt.NDArray[np.bool_]


def fits(levels: Image, weights: Floats, steps: Floats, calm: Floats, ratio: float) -> Floats:
    """Rows (n, 10) of rings with levels (n, K * 2 * m): plain, robust where they are not calm."""
    lines = levels.shape[1] // weights.shape[1]
    found = levels.astype(np.float64).reshape(len(levels), lines, -1) @ weights
    contrast = found[..., :2]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        offsets = found[..., 2:] / contrast
        rows = plain(contrast, offsets, steps, ratio)
        quiet = (rows[:, 3] - 0.005) * rows[:, 5] < calm
        quiet &= (np.abs(rows[:, 2]) < 0.5 * steps) & (rows[:, 5] > 0.0)
    rest = ~quiet
    if rest.any():
        rows[rest] = robust(
            contrast[rest], offsets[rest] * steps[rest, None, None], steps[rest], ratio
        )
    return rows


def model(lines: int, ratio: float) -> tuple[Floats, Floats]:
    """Offsets per unknown (2 K, 6), and how much a line says (2 K,)."""
    base, zero, one = harmonics(lines), np.zeros(lines), np.ones(lines)
    outer = np.column_stack([base[:, :2], one, zero, base[:, 3:]])
    inner = np.column_stack([base[:, :2], zero, one, ratio * base[:, 3:]])
    return np.stack([outer, inner], axis=1).reshape(2 * lines, 6), np.tile([1.0, ratio], lines)


def plain(contrast: Floats, offsets: Floats, steps: Floats, ratio: float) -> Floats:
    """Weighted least squares by LAPACK, every line counts."""
    design, weights = model(offsets.shape[1], ratio)
    inverse = np.linalg.solve(design.T @ (weights[:, None] * design), design.T * weights)
    flat = offsets.reshape(len(offsets), -1) * steps[:, None]
    fit = flat @ inverse.T
    variance = np.average((flat - fit @ design.T) ** 2, axis=1, weights=weights)
    typical = np.average(contrast.reshape(len(flat), -1), axis=1, weights=weights)
    covariance = (1.6 * (inverse[0] ** 2).sum() * variance)[:, None] * np.eye(2).reshape(4)
    one = np.ones(len(flat))
    columns = [fit[:, :3], np.sqrt(variance), one, typical, covariance]
    return np.column_stack(columns)


def robust(contrast: Floats, offset_px: Floats, steps: Floats, ratio: float) -> Floats:
    """Tukey's biweight in eight rounds."""
    n, lines, _ = offset_px.shape
    design, weights = model(lines, ratio)
    flat, contrast = offset_px.reshape(n, -1), contrast.reshape(n, -1)
    lit = np.abs(flat) < REACH * steps[:, None]
    lit &= contrast > 0.35 * median(np.maximum(contrast, 0.0))[:, None]
    flat = np.where(lit, flat, 0.0)
    bright = lit & (contrast > 0.7 * np.quantile(contrast, 0.75, axis=1)[:, None])
    weight = weights * np.where((bright.mean(axis=1) > 0.4)[:, None], bright, lit)
    prior = np.diag([1e-9, 1e-9, 1.0, 1.0, 1.0, 1.0])
    for _ in range(8):
        normal = np.einsum("nk,ki,kj->nij", weight, design, design) + prior
        fit = np.linalg.solve(normal, ((weight * flat) @ design)[..., None])[..., 0]
        left = np.where(lit, flat - fit @ design.T, np.nan)
        scatter = 1.4826 * median(np.abs(left)) + 0.01 * steps
        share = np.nan_to_num(left / (4.7 * scatter[:, None]), nan=9.0)
        weight = weights * np.maximum(1.0 - share**2, 0.0) ** 2
    covariance = np.linalg.inv(normal)[:, :2, :2] * (1.6 * scatter**2)[:, None, None]
    inliers = (weight > 0.25 * weights).mean(axis=1)
    columns = [fit[:, :3], scatter, inliers, median(contrast), covariance.reshape(n, 4)]
    return np.column_stack(columns)


def median(rows: Floats) -> Floats:
    """Of each row the middle one of what is finite, the lower of two; NaN of nothing."""
    middle = [np.sort(row[np.isfinite(row)]) for row in rows]
    return np.array([row[(len(row) - 1) // 2] if len(row) else np.nan for row in middle])


def acceptable(rows: Floats, axes: Floats, limits: Floats) -> Truths:
    """Rings of the size that their plane demands."""
    good = np.isfinite(rows[:, :2]).all(axis=1) & (rows[:, 5] >= limits[0])
    good &= (rows[:, 4] >= limits[1]) & (np.abs(rows[:, 2]) <= limits[2] * axes[:, 1] + 0.5)
    return np.asarray(good)


def report(rows: Floats, centres: Floats, xy: Floats, slopes: Floats) -> Floats:
    """Rows (n, 11) of a frame's report."""
    covariance = slopes @ rows[:, 6:].reshape(-1, 2, 2) @ slopes.transpose(0, 2, 1)
    return np.column_stack(
        [centres, xy, covariance.reshape(-1, 4), rows[:, 4], rows[:, 3], rows[:, 5]]
    )


def moved(
    view: View, rings: RingTemplates, rows: Floats, centres: Floats, expected: Floats
) -> tuple[Floats, Floats]:
    """Centres and places of movers: along the slope, and one step of Newton's method."""
    centres = centres + rows[:, :2]
    xy = expected + np.einsum("nij,nj->ni", rings.inverse, rows[:, :2])
    miss = centres - rings.placed(view, xy)[1]
    return centres, xy + np.einsum("nij,nj->ni", rings.inverse, miss)
