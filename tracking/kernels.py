"""The inner loops of following rings, compiled: from grey levels to rows of a frame's report.

All of them stand in this one file and none reads a constant of another: numba's cache, which looks
at the file alone, cannot be stale (`NUMBA_CACHE_DIR` says where it is). Every entry has a signature
and is compiled when this module is imported, a few seconds once and from the cache later; what
follows rings imports it in its constructor, never before. What is called stands above its caller.

Fits are rows of ten numbers: shift x, y, growth of the outer edge, scatter of the lines round the
fit [px]; share of the lines that count; contrast [grey levels]; covariance of the shift (4) [px^2].
Rows of a report have eleven: centre [px], x, y [m], covariance (4) [m^2], share of the lines that
count, scatter [px], contrast. Offsets and contrasts of a ring run line by line, outer edge first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

from geometry import Floats

Levels = npt.NDArray[np.uint8]
Points = npt.NDArray[np.float32]
Truths = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., object])

_SMOOTH_PX = 0.005
"""Lines may scatter by a little more than the noise explains, for the lens."""
_TUKEY = 4.7
_ROUNDS = 8
_BRIGHT, _ENOUGH = 0.7, 0.4
_UNMOVED, _PRIOR = 1e-9, 1.0
"""Growth and flattening are zero: said as loudly as by one line. Of the shift nothing is said."""
_SHARED = 1.6
"""Neighbouring lines share pixels: the shift's variance is so much more than theirs would say."""
_DIM = 0.35
"""A line with less than this share of the marker's contrast crosses no edge."""
_STRAYED_PX = 0.5
"""Further from where it stands it is measured afresh: the filter is exact near the edge only."""


def kernel(signature: str | None = None) -> Callable[[Function], Function]:
    """The function compiled for a signature at once, or without one along with what calls it.

    Products and sums may be contracted (fused multiply-add) but never reordered.
    """
    fast = {"contract"}

    def compiled(function: Function) -> Function:
        jit = numba.njit(signature, cache=True, fastmath=fast, error_model="numpy")
        return cast(Function, jit(function))

    return compiled


@kernel()
def across_edges(levels: Levels, weights: Floats, contrast: Floats, offsets: Floats) -> None:
    """Contrasts and offsets (2 K,), in steps, from the levels of one ring."""
    samples = len(weights)
    for line in range(len(contrast) // 2):
        outer, inner, outer_q, inner_q = 0.0, 0.0, 0.0, 0.0
        for k in range(samples):
            level = float(levels[line * samples + k])
            outer += level * weights[k, 0]
            inner += level * weights[k, 1]
            outer_q += level * weights[k, 2]
            inner_q += level * weights[k, 3]
        contrast[2 * line], contrast[2 * line + 1] = outer, inner
        offsets[2 * line], offsets[2 * line + 1] = outer_q / outer, inner_q / inner


@kernel()
def residual(offset: float, row: Floats, fit: Floats) -> float:
    """What the fit leaves of an offset."""
    for j in range(6):
        offset -= row[j] * fit[j]
    return offset


@kernel()
def fit_plainly(
    contrast: Floats, offsets: Floats, step_px: float, model: Floats, inverse: Floats,
    line_weights: Floats, row: Floats,
) -> None:  # fmt: skip
    """Least squares, every line counts: for a marker that nothing disturbs. Offsets in steps."""
    fit, gain = np.zeros(6), 0.0
    for k in range(len(offsets)):
        gain += inverse[k, 0] * inverse[k, 0]
        for j in range(6):
            fit[j] += offsets[k] * inverse[k, j]
    total, typical, squares = 0.0, 0.0, 0.0
    for k in range(len(offsets)):
        left = residual(offsets[k], model[k], fit)
        total += line_weights[k]
        typical += line_weights[k] * contrast[k]
        squares += line_weights[k] * left * left
    variance = squares / total * step_px * step_px
    row[0], row[1], row[2] = fit[0] * step_px, fit[1] * step_px, fit[2] * step_px
    row[3], row[4], row[5] = math.sqrt(variance), 1.0, typical / total
    row[6:] = 0.0
    row[6] = row[9] = _SHARED * gain * variance


@kernel()
def selected(values: Floats, place: int) -> float:
    """The value that sorting would bring to a place; none before is larger, none after smaller."""
    low, high = 0, len(values) - 1
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if j < place < i:
            break
        low, high = (low, j) if place <= j else (i, high)
    return float(values[place])


@kernel()
def median(values: Floats) -> float:
    """The middle one, or the lower of two; NaN of none. Changes the order of the values."""
    if not len(values):
        return math.nan
    return selected(values, (len(values) - 1) // 2)


@kernel()
def factor(matrix: Floats) -> None:
    """Cholesky's factor of a positive definite matrix, in its lower half."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(rest) if i == j else rest / matrix[j, j]


@kernel()
def solve(lower: Floats, right: Floats) -> None:
    """The solution for a right side, in its place, from `factor`."""
    for i in range(len(right)):
        for k in range(i):
            right[i] -= lower[i, k] * right[k]
        right[i] /= lower[i, i]
    for i in range(len(right) - 1, -1, -1):
        for k in range(i + 1, len(right)):
            right[i] -= lower[k, i] * right[k]
        right[i] /= lower[i, i]


@kernel()
def normal_equations(
    weight: Floats, offset_px: Floats, model: Floats, products: Floats, normal: Floats,
    right: Floats,
) -> None:  # fmt: skip
    """Normal matrix (6, 6) with the priors, and right side (6,), of weighted lines."""
    sums = np.zeros(36)
    right[:] = 0.0
    for k in range(len(weight)):
        share = weight[k]
        for j in range(36):
            sums[j] += share * products[k, j]
        for j in range(6):
            right[j] += share * offset_px[k] * model[k, j]
    for i in range(6):
        for j in range(6):
            normal[i, j] = sums[6 * i + j]
        normal[i, i] += _UNMOVED if i < 2 else _PRIOR


@kernel()
def begin(
    contrast: Floats, offset_px: Floats, reach_px: float, line_weights: Floats, lit: Truths,
    scratch: Floats, weight: Floats,
) -> None:  # fmt: skip
    """Which lines cross an edge, and the weights to begin with: those of most contrast, if enough.

    What lies over a ring makes edges, too, but mostly fainter ones; a shadow's are left out with
    them and come in again when they fit. Offsets of the other lines become zero.
    """
    edges = len(contrast)
    scratch[:] = np.maximum(contrast, 0.0)
    least = _DIM * median(scratch)
    scratch[:] = contrast
    place = 0.75 * (edges - 1)
    below = selected(scratch, int(place))
    above = scratch[int(place) + 1 :].min() if int(place) + 1 < edges else below
    bright_from = _BRIGHT * (below + (place - int(place)) * (above - below))
    lit[:] = (np.abs(offset_px) < reach_px) & (contrast > least)
    bright = lit & (contrast > bright_from)
    enough = np.sum(bright) / edges > _ENOUGH
    weight[:] = np.where(bright if enough else lit, line_weights, 0.0)
    offset_px[:] = np.where(lit, offset_px, 0.0)


@kernel()
def fit_robustly(
    contrast: Floats, offset_px: Floats, step_px: float, reach: int, model: Floats,
    products: Floats, line_weights: Floats, row: Floats,
) -> None:  # fmt: skip
    """Iteratively reweighted least squares (Tukey's biweight) of the lines that cross an edge."""
    edges = len(offset_px)
    lit, scratch, left = np.empty(edges, np.bool_), np.empty(edges), np.empty(edges)
    weight, fit, normal, scatter = np.empty(edges), np.empty(6), np.empty((6, 6)), math.nan
    begin(contrast, offset_px, reach * step_px, line_weights, lit, scratch, weight)
    for _ in range(_ROUNDS):
        normal_equations(weight, offset_px, model, products, normal, fit)
        factor(normal)
        solve(normal, fit)
        count = 0
        for k in range(edges):
            if lit[k]:
                left[k] = residual(offset_px[k], model[k], fit)
                scratch[count] = abs(left[k])
                count += 1
        scatter = 1.4826 * median(scratch[:count]) + 0.01 * step_px
        for k in range(edges):
            weight[k] = 0.0
            if lit[k]:
                share = left[k] / (_TUKEY * scatter)
                weight[k] = line_weights[k] * max(1.0 - share * share, 0.0) ** 2
    scratch[:] = contrast
    row[0], row[1], row[2], row[3] = fit[0], fit[1], fit[2], scatter
    row[4] = np.sum(weight > 0.25 * line_weights) / edges
    row[5] = median(scratch)
    for axis in range(2):
        fit[:] = 0.0
        fit[axis] = _SHARED * scatter * scatter
        solve(normal, fit)
        row[6 + 2 * axis], row[7 + 2 * axis] = fit[0], fit[1]


@kernel(
    "f8[:,::1](u1[:,::1], f8[:,:,::1], f8[::1], f8[::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1])"
)
def fit_rings(
    levels: Levels, weights: Floats, steps_px: Floats, calm: Floats, model: Floats,
    inverse: Floats, products: Floats, line_weights: Floats,
) -> Floats:  # fmt: skip
    """Fits (n, 10) of rings with these levels (n, K * 2 * m): plain, robust where not `calm` (n,).

    weights : (1 or n, 2 * m, 4), see `tracking.edges`; the rest: `tracking.marker_fit.Design`.
    """
    fits = np.empty((len(levels), 10))
    contrast, offsets = np.empty(len(line_weights)), np.empty(len(line_weights))
    for i in range(len(levels)):
        across_edges(levels[i], weights[i % len(weights)], contrast, offsets)
        fit_plainly(contrast, offsets, steps_px[i], model, inverse, line_weights, fits[i])
        noisy = (fits[i, 3] - _SMOOTH_PX) * fits[i, 5]
        small = abs(fits[i, 2]) < 0.5 * steps_px[i]
        # Twice nothing is calm, but no ring. Without edges nothing here is finite, and so not true.
        if not (noisy < calm[i] and small and fits[i, 5] > 0.0):
            offsets *= steps_px[i]
            reach = (weights.shape[1] // 2 - 1) // 2
            fit_robustly(
                contrast, offsets, steps_px[i], reach, model, products, line_weights, fits[i]
            )
    return fits


@kernel()
def pixel(
    arm: Floats, east: float, north: float, floor: Floats, lens: Floats
) -> tuple[float, float]:
    """Where a point is seen that is `arm` (3,), in the camera's frame, off x, y on the floor.

    As `geometry.Camera.project`. floor : (3, 3) carries x, y, 1 into the camera's frame; lens :
    fx, fy, cx, cy, k1, k2, p1, p2, k3.
    """
    z = arm[2] + floor[2, 0] * east + floor[2, 1] * north + floor[2, 2]
    if not z > 0.0:
        return math.nan, math.nan
    x = (arm[0] + floor[0, 0] * east + floor[0, 1] * north + floor[0, 2]) / z
    y = (arm[1] + floor[1, 0] * east + floor[1, 1] * north + floor[1, 2]) / z
    r2 = x * x + y * y
    scale = 1.0 + r2 * (lens[4] + r2 * (lens[5] + r2 * lens[8]))
    scale += 2.0 * (x * lens[7] + y * lens[6])
    across = lens[0] * (x * scale + r2 * lens[7]) + lens[2]
    return across, lens[1] * (y * scale + r2 * lens[6]) + lens[3]


@kernel(
    "Tuple((f4[:,:,::1], f8[:,::1]))(f8[:,:,::1], f8[:,::1], f4[:,:,:,:,::1], f8[:,::1], f8[::1])"
)
def ring_points(
    spread: Floats, xy: Floats, vectors: Points, floor: Floats, lens: Floats
) -> tuple[Points, Floats]:
    """Sample points (n, K * 2 * m, 2) and centres (n, 2) of rings round (n, 2), in pixels.

    spread : of `tracking.outlines.RingTemplates`; vectors : (n, K, 1, m, 2) from an edge.
    """
    n, edges, samples = len(xy), spread.shape[1] - 1, vectors.shape[3]
    points, centres = np.empty((n, edges * samples, 2), np.float32), np.empty((n, 2))
    for i in range(n):
        for k in range(edges):
            x, y = pixel(spread[i, k], xy[i, 0], xy[i, 1], floor, lens)
            for j in range(samples):
                points[i, k * samples + j, 0] = np.float32(x) + vectors[i, k // 2, 0, j, 0]
                points[i, k * samples + j, 1] = np.float32(y) + vectors[i, k // 2, 0, j, 1]
        centres[i] = pixel(spread[i, edges], xy[i, 0], xy[i, 1], floor, lens)
    return points, centres


@kernel("b1[::1](f8[:,::1], f8[:,::1], f8[::1])")
def acceptable(fits: Floats, axes_px: Floats, limits: Floats) -> Truths:
    """Which fits (n,) are of rings with half axes (n, 2) as their plane demands.

    limits : least contrast, least share of lines, most growth (`TrackerConfig`).
    """
    good = np.empty(len(fits), np.bool_)
    for i in range(len(fits)):
        row = fits[i]
        small = abs(row[2]) <= limits[2] * axes_px[i, 1] + 0.5
        sure = row[5] >= limits[0] and row[4] >= limits[1]
        good[i] = small and sure and math.isfinite(row[0]) and math.isfinite(row[1])
    return good


@kernel()
def report(
    fit: Floats, x_px: float, y_px: float, x_m: float, y_m: float, slopes: Floats, row: Floats
) -> None:
    """Fill one row of a report; slopes : (2, 2) d world / d pixel."""
    row[0], row[1], row[2], row[3] = x_px, y_px, x_m, y_m
    for i in range(2):
        a = slopes[i, 0] * fit[6] + slopes[i, 1] * fit[8]
        b = slopes[i, 0] * fit[7] + slopes[i, 1] * fit[9]
        for j in range(2):
            row[4 + 2 * i + j] = a * slopes[j, 0] + b * slopes[j, 1]
    row[8], row[9], row[10] = fit[4], fit[3], fit[5]


@kernel(
    "Tuple((b1[::1], f8[:,::1]))(f8[:,::1], f8[:,::1], f8[::1], f8[::1], f8[:,::1], f8[:,::1],"
    "f8[:,:,::1], f8[::1])"
)
def standing_rows(
    fits: Floats, axes_px: Floats, steps_px: Floats, gain: Floats, centres_px: Floats, xy: Floats,
    slopes: Floats, limits: Floats,
) -> tuple[Truths, Floats]:  # fmt: skip
    """Which of the fits (n, 10) are those of rings that stand at (n, 2), and their rows (n, 11).

    gain : (n,) of the filter; centres_px : (n, 2) where they were expected.
    """
    good, rows = acceptable(fits, axes_px, limits), np.empty((len(fits), 11))
    for i in range(len(fits)):
        x, y, slope = fits[i, 0] / gain[i], fits[i, 1] / gain[i], slopes[i]
        good[i] &= x * x + y * y < (_STRAYED_PX * steps_px[i]) ** 2
        east = xy[i, 0] + slope[0, 0] * x + slope[0, 1] * y
        north = xy[i, 1] + slope[1, 0] * x + slope[1, 1] * y
        report(fits[i], centres_px[i, 0] + x, centres_px[i, 1] + y, east, north, slope, rows[i])
    return good, rows


@kernel(
    "Tuple((b1[::1], f8[:,::1]))(f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1],"
    "f8[:,:,::1], f8[:,::1], f8[::1], f8[::1])"
)
def moving_rows(
    fits: Floats, axes_px: Floats, centres_px: Floats, expected: Floats, slopes: Floats,
    spread: Floats, floor: Floats, lens: Floats, limits: Floats,
) -> tuple[Truths, Floats]:  # fmt: skip
    """Which of the fits (n, 10) are those of rings, and their rows (n, 11).

    expected : (n, 2) metres, where they were looked for; centres_px : (n, 2) where that is. The
    picture of the floor is bent; one step of Newton's method makes the line exact.
    """
    good, rows = acceptable(fits, axes_px, limits), np.empty((len(fits), 11))
    for i in range(len(fits)):
        slope, x, y = slopes[i], fits[i, 0], fits[i, 1]
        east, north = expected[i, 0], expected[i, 1]
        right, down = centres_px[i, 0] + x, centres_px[i, 1] + y
        for _ in range(2):
            east += slope[0, 0] * x + slope[0, 1] * y
            north += slope[1, 0] * x + slope[1, 1] * y
            there = pixel(spread[i, -1], east, north, floor, lens)
            x, y = right - there[0], down - there[1]
        report(fits[i], right, down, east, north, slope, rows[i])
    return good, rows


@kernel("void(i8[::1], b1[::1], f8[:,::1], f8, f8[:,::1], i1[::1])")
def enter(
    which: Indices, good: Truths, rows: Floats, whole: float, table: Floats,
    states: npt.NDArray[np.int8],
) -> None:  # fmt: skip
    """Put good rows (k, 11) into the table (n, 11) at `which`, and their states (0 seen, 1 partly).

    whole : least share of lines that count of what is seen.
    """
    for i in range(len(which)):
        if good[i]:
            table[which[i]] = rows[i]
            states[which[i]] = 0 if rows[i, 8] >= whole else 1


@kernel("f8[:,::1](f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], i8[::1], i8)")
def predict(
    xy: Floats, velocity: Floats, acceleration: Floats, before_s: Floats, seen_ns: Indices,
    t_ns: int,
) -> Floats:  # fmt: skip
    """Where movers should be (n, 2) at constant acceleration, or were if no speed is known.

    velocity : of the time `before_s` (n,) between the last two sights, so half of that ago.
    """
    there = xy.copy()
    for i in range(len(xy)):
        after_s = (t_ns - seen_ns[i]) * 1e-9
        for j in range(2):
            bend = acceleration[i, j] * ((after_s + before_s[i]) / 2.0)
            step = (velocity[i, j] + bend) * after_s
            if math.isfinite(step):
                there[i, j] += step
    return there


@kernel(
    "void(i8[::1], b1[::1], f8[:,::1], i8, f8, f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], i8[::1])"
)
def remember(
    which: Indices, good: Truths, rows: Floats, t_ns: int, limit_m_s2: float, xy: Floats,
    velocity: Floats, acceleration: Floats, before_s: Floats, seen_ns: Indices,
) -> None:  # fmt: skip
    """Take good rows (k, 11) of the movers `which` as seen at t, in place; limit 0: no speed-up."""
    for i in range(len(which)):
        if not good[i]:
            continue
        at = which[i]
        after_s = (t_ns - seen_ns[at]) * 1e-9
        between_s = (after_s + before_s[at]) / 2.0
        for j in range(2):
            # Of one never seen before, position and so velocity are NaN.
            speed = (rows[i, 2 + j] - xy[at, j]) / max(after_s, 1e-6)
            bend = (speed - velocity[at, j]) / between_s if limit_m_s2 > 0.0 else 0.0
            acceleration[at, j] = min(max(bend, -limit_m_s2), limit_m_s2)
            velocity[at, j], xy[at, j] = speed, rows[i, 2 + j]
        before_s[at], seen_ns[at] = after_s, t_ns
