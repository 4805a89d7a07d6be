"""From grey levels across an edge to where the edge is.

Both filters give, per edge, a contrast c (light minus dark) and a product q of contrast and shift:
the shift outwards is q / c. Levels are the line's own, so that shadows across a marker do no harm.

area : what is dark is as wide as the area under the profile says, whatever the blur; a shift comes
out a tenth short, for blur reaches the ends of the line. matched : least squares of levels and a
shift for an edge of known blur; half the noise variance, but its gain is near 1 for that blur and
near the edge only. Both are unbiased where the edge is where it was expected.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from geometry import Floats
from tracking.profiles import Samples

SAMPLES = 7
"""Of one line across one edge."""
_END = 2
"""Samples at each end of a line that tell its levels."""
REACH = (SAMPLES - 1) // 2
"""Steps from the middle of a line to its ends."""


def line_offsets(step_px: Floats) -> Floats:
    """Offsets (n, m) outwards of the samples of lines with these steps (n,)."""
    return step_px[:, None] * np.arange(-REACH, REACH + 1)


_NO_FLOOR = 0.03
"""A floor that hardly enters a line is not worth a level of its own."""


@lru_cache(maxsize=2)
def area_filter(edges: int) -> Samples:
    """Weights (edges * m, 2 * edges): contrasts, then products in steps; the outer edge first.

    The outer edge has light outside, the inner one inside.
    """
    weights = np.zeros((edges, SAMPLES, 2, edges))
    for edge, sign in enumerate((1.0, -1.0)[:edges]):
        inside, outside = np.zeros(SAMPLES), np.zeros(SAMPLES)
        inside[:_END], outside[-_END:] = 1.0 / _END, 1.0 / _END
        weights[edge, :, 0, edge] = sign * (outside - inside)
        weights[edge, :, 1, edge] = sign * (SAMPLES / 2.0 * (inside + outside) - 1.0)
    return weights.reshape(edges * SAMPLES, 2 * edges).astype(np.float32)


@lru_cache(maxsize=64)
def matched_filter(step_px: float, black_px: float, paper_px: float, sigma_px: float) -> Samples:
    """Weights (2 * m, 4) as of `area_filter(2)`, products in steps.

    step_px : between samples; black_px, paper_px : how wide the ring and the paper around it are
    along a line; sigma_px : of the edge's blur, pixel and interpolation included. Least squares of
    four levels (inside, ring, paper, floor) and of a shift of each edge of the ring; where lines
    are long enough, the noise of a ring's place is then 1.2 times the Cramer-Rao bound.
    """
    from scipy.special import erf

    offsets = step_px * np.arange(-REACH, REACH + 1)
    to_outer = np.concatenate([offsets, offsets - black_px])
    to_inner, to_floor = to_outer + black_px, to_outer - paper_px

    def beyond(distance: Floats) -> Floats:
        return np.asarray(0.5 + 0.5 * erf(distance / (sigma_px * np.sqrt(2.0))))

    def slope(distance: Floats) -> Floats:
        bump = np.exp(-0.5 * (distance / sigma_px) ** 2)
        return np.asarray(bump / (sigma_px * np.sqrt(2.0 * np.pi)))

    paper = beyond(to_outer) - beyond(to_floor)
    ring = beyond(to_inner) - beyond(to_outer)
    model = np.column_stack(
        [paper, 1.0 - beyond(to_inner), ring, beyond(to_floor), -slope(to_outer), slope(to_inner)]
    )
    fit = np.linalg.pinv(model, rcond=_NO_FLOOR)
    rows = np.stack([fit[0] - fit[2], fit[1] - fit[2], fit[4] / step_px, fit[5] / step_px], axis=1)
    return rows.astype(np.float32)


def edge_offsets(levels: Samples, weights: Samples, lines: int) -> tuple[Samples, Samples]:
    """Contrasts and offsets (n, K, edges), offsets in steps, of samples (n, K * edges * m).

    Where there is no edge the offset is huge or not finite: gate it.
    """
    edges = weights.shape[1] // 2
    # One product of two tall matrices is much faster than many of small ones.
    tall = levels.reshape(-1, len(weights))
    contrast = (tall @ weights[:, :edges]).reshape(-1, lines, edges)
    product = (tall @ weights[:, edges:]).reshape(-1, lines, edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        return contrast, product / contrast
