"""Candidates -> ellipses of outer edges to a hundredth of a pixel, many at once.

An ellipse is a centre and a shape S (2, 2), unit circle -> pixels round the centre. Its extent in
direction n (its support) is sqrt(n Q n) with Q = S S^T, so centre and Q follow from the edge's
offsets along lines of known normals by linear harmonics; see `tracking.profiles`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats
from tracking.edges import REACH, area_filter, edge_offsets, line_offsets
from tracking.images import Image
from tracking.profiles import (
    Samples,
    harmonic_fit,
    harmonics,
    line_directions,
    line_points,
    line_vectors,
    sample,
    spokes,
)

LINES = 48
_REACHES = (0.40, 0.30, 0.28, 0.28, 0.28)
"""Half a line's length over the small half axis, from pass to pass."""
_LONGEST_PX = 4.0
"""Of half a line in the last passes; an edge of a usual camera is no wider."""
_SIFTED = 1
_HOPELESS = 0.25
"""Scatter over the small half axis after pass `_SIFTED` that is not worth another pass."""
_TUKEY = 4.7


@dataclass(frozen=True, eq=False)
class Ellipses:
    """Outer edges: centres (n, 2), shapes (n, 2, 2).

    residual_px : (n,) robust scatter of the edge around the ellipse; inliers : (n,) share of lines
    that agree; lumps_px : (n,) amplitude of harmonics 3 and 4; contrast : (n,) median, light
    outside; covariance : (n, 2, 2) of the centre.
    """

    centres: Floats
    shapes: Floats
    residual_px: Floats
    inliers: Floats
    lumps_px: Floats
    contrast: Floats
    covariance: Floats

    def take(self, which: Floats | np.ndarray) -> Ellipses:
        """Some of them, by index or mask."""
        return Ellipses(
            self.centres[which], self.shapes[which], self.residual_px[which],
            self.inliers[which], self.lumps_px[which], self.contrast[which], self.covariance[which],
        )  # fmt: skip


def refine_ellipses(image: Image, centres: Floats, halves: Floats) -> Ellipses:
    """The ellipses near these centres (n, 2) with half widths and heights (n, 2), all at once.

    What is far from any ellipse is left out; for the rest residual and inliers say how near it is.
    """
    q = np.zeros((len(centres), 2, 2))
    q[:, 0, 0], q[:, 1, 1] = halves[:, 0] ** 2, halves[:, 1] ** 2
    for turn, reach in enumerate(_REACHES):
        shapes = _root(q)
        # |det| is the product of the half axes, and the large one is below the trace's root.
        small = np.linalg.det(shapes) / np.sqrt(np.trace(q, axis1=1, axis2=2))
        half_px = np.maximum(reach * small, 1.0)
        half_px = np.minimum(half_px, _LONGEST_PX) if turn >= len(_REACHES) // 2 else half_px
        step = half_px / REACH
        edges = centres[:, None, :] + spokes(shapes, LINES) @ shapes.transpose(0, 2, 1)
        levels = sample(
            image, line_points(edges[:, :, None], line_vectors(LINES, line_offsets(step)))
        )
        contrast, offset = edge_offsets(levels, area_filter(1), LINES)
        shift = np.clip(np.nan_to_num(offset[..., 0]), -REACH, REACH) * step[:, None]
        fit, weight, scatter = _robust_harmonics(shift, contrast[..., 0], step)
        centres = centres + fit[:, :2]
        q = _grown(q, fit)
        if turn == _SIFTED:
            hopeful = scatter < _HOPELESS * small
            centres, q = centres[hopeful], q[hopeful]
    information = weight.sum(axis=1) / np.maximum(scatter, 1e-3) ** 2 / 2.0
    covariance = np.eye(2) / np.maximum(information, 1e-9)[:, None, None]
    return Ellipses(
        centres,
        _root(q),
        scatter,
        (weight > 0.0).mean(axis=1),
        _lumps(shift - fit @ harmonics(LINES).T),
        np.median(contrast[..., 0], axis=1),
        covariance,
    )


def _robust_harmonics(shift: Floats, contrast: Samples, step: Floats) -> tuple[Floats, ...]:
    """Harmonics (n, 5) of shifts (n, K), the lines' weights (n, K) and the scatter (n,).

    Lines without contrast do not count. Two rounds of Tukey's biweight round a plain fit.
    """
    base = harmonics(LINES)
    products = (base[:, :, None] * base[:, None, :]).reshape(LINES, 25)
    lit = contrast > 0.3 * np.median(contrast, axis=1)[:, None]
    fit = shift @ harmonic_fit(LINES).T
    weight = lit.astype(np.float64)
    for _ in range(2):
        residual = shift - fit @ base.T
        scatter = 1.4826 * np.median(np.abs(residual), axis=1) + 0.02 * step
        ratio = residual / (_TUKEY * scatter[:, None])
        weight = lit * np.maximum(1.0 - ratio**2, 0.0) ** 2
        normal = (weight @ products).reshape(-1, 5, 5) + 1e-3 * np.eye(5)
        fit = np.linalg.solve(normal, ((weight * shift) @ base)[..., None])[..., 0]
    return fit, weight, scatter


def _root(q: Floats) -> Floats:
    """Lower triangular S with S S^T = Q (n, 2, 2)."""
    return np.asarray(np.linalg.cholesky(q), np.float64)


def _lumps(residual: Floats) -> Floats:
    """Amplitude (n,) of harmonics 3 and 4 of what the ellipse leaves (n, K)."""
    spectrum = np.abs(np.fft.rfft(residual, axis=1)[:, 3:5])
    return np.asarray(2.0 / LINES * np.sqrt((spectrum**2).sum(axis=1)))


def _grown(q: Floats, fit: Floats) -> Floats:
    """Q of the ellipse whose support is that of Q plus the harmonics 0 and 2 of the fit."""
    n = line_directions(LINES)
    support = np.sqrt(((n @ q) * n).sum(axis=2))
    wider = np.maximum(support + fit[:, 2:] @ harmonics(LINES)[:, 2:].T, 0.3 * support)
    mean, _, _, cos2, sin2 = np.moveaxis(wider**2 @ harmonic_fit(LINES)[[2, 0, 1, 3, 4]].T, 1, 0)
    # Never flatter than 5 : 1, or a wild candidate would be no ellipse at all.
    flat = np.hypot(cos2, sin2) / mean
    cos2, sin2 = (part * np.minimum(1.0, 0.92 / np.maximum(flat, 1e-9)) for part in (cos2, sin2))
    return np.stack([mean + cos2, sin2, sin2, mean - cos2], axis=1).reshape(-1, 2, 2)
