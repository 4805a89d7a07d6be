"""One look at known rings: levels along their lines, offsets of their edges, fits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from geometry import Floats, RingShape
from tracking.edges import (
    edge_offsets,
    line_offsets,
    matched_filter,
)
from tracking.images import Image
from tracking.marker_fit import MarkerFits, plain_fits, robust_fits
from tracking.profiles import FixedMaps, Samples, line_points, line_vectors, sample

_LONGEST_STEP_PX = 1.0
_ALIKE = 1.15
_LARGE_PX = 30.0
"""Of a larger ring a line across one edge sees no other."""
_STEP_OF_AXIS = 0.1
"""Seven samples at a tenth of the shorter half axis stay between the edges of a ring."""


_CALM, _SMOOTH_PX = 1.3, 0.005
"""Lines may scatter by so many times what the noise explains, beside a little for the lens."""


@dataclass(frozen=True, kw_only=True)
class TrackerConfig:
    """How markers are followed. The defaults are for cameras that see a ring 10 to 100 px wide."""

    lines: int = field(default=64, metadata={"min": 16, "max": 512})
    """Lines across each edge of each marker; about one a pixel of its circumference is all of the
    information there is."""
    edge_sigma_px: float = field(default=0.8, metadata={"min": 0.3, "max": 5.0})
    """Blur of an edge, pixel and interpolation included. A wrong value costs accuracy, slowly."""
    noise: float = field(default=2.5, metadata={"min": 0.1, "max": 50.0})
    """Standard deviation of a pixel in grey levels: what scatter is called calm."""
    min_contrast: float = field(default=10.0, metadata={"min": 1.0})
    min_inliers: float = field(default=0.5, metadata={"min": 0.1, "max": 1.0})
    """Share of lines that must agree, or the marker is lost."""
    whole_inliers: float = field(default=0.95, metadata={"min": 0.1, "max": 1.0})
    """Share below which it is only partly seen."""
    max_growth: float = field(default=0.08, metadata={"min": 0.0})
    """Of the outer radius against the size the plane demands, beside half a pixel."""
    max_speed_m_s: float = field(default=5.0, metadata={"min": 0.0})
    max_acceleration_m_s2: float = field(default=15.0, metadata={"min": 0.0})
    place_gate_m: float = field(default=0.15, metadata={"min": 0.0})
    """How far from its place a standing marker is looked for."""
    search_period_s: float = field(default=0.5, metadata={"min": 0.0})
    """How often large regions are searched for what is lost."""


def line_steps(half_axes_px: Floats) -> Floats:
    """Distance (n,) between samples for rings with these half axes (n, 2).

    Rounded to a sixteenth of an octave, for rings of nearly one size to share a filter.
    """
    step = np.minimum(_LONGEST_STEP_PX, _STEP_OF_AXIS * half_axes_px[:, 1])
    rounded: Floats = np.exp2(np.round(16.0 * np.log2(step)) / 16.0)
    return rounded


def ring_coordinates(edges: Floats, steps_px: Floats) -> Samples:
    """Sample points (n, K * 2 * m, 2) of outer and inner edges (n, K, 2, 2)."""
    return line_points(edges, line_vectors(edges.shape[1], line_offsets(steps_px)))


def ring_filters(half_axes_px: Floats, shape: RingShape, sigma_px: float) -> Samples:
    """Matched filters: one (14, 4) for all when rings are of nearly one size, else (n, 14, 4).

    The distances between a ring's edges are those along its shorter axis, where they are least.
    """
    short, steps = half_axes_px[:, 1], line_steps(half_axes_px)
    if np.ptp(steps) == 0.0 and short.max() < _ALIKE * short.min():
        sizes = np.full(len(short), np.sqrt(short.max() * short.min()))
    else:
        # Classes of an eighth of an octave, or every marker would need a filter of its own.
        sizes = np.exp2(np.round(8.0 * np.log2(np.minimum(short, _LARGE_PX))) / 8.0)
    filters = [
        matched_filter(step, (1.0 - shape.ratio) * b, (shape.margin - 1.0) * b, sigma_px)
        for step, b in zip(steps.tolist(), sizes.tolist(), strict=True)
    ]
    return filters[0] if len(set(map(id, filters))) == 1 else np.stack(filters)


class Look:
    """How rings are measured, with one configuration and one ratio of diameters."""

    def __init__(self, config: TrackerConfig, shape: RingShape) -> None:
        self.config, self.shape, self.ratio = config, shape, shape.ratio

    def filters(self, half_axes_px: Floats) -> Samples:
        """Matched filters for rings with these half axes (n, 2)."""
        return ring_filters(half_axes_px, self.shape, self.config.edge_sigma_px)

    def calm(self, weights: Samples, steps_px: Floats) -> Floats:
        """Scatter times contrast (n,) below which nothing but noise disturbs a ring."""
        products = weights[..., 2]
        gain = np.sqrt(np.einsum("...i,...i->...", products, products).max())
        return np.asarray(_CALM * self.config.noise * gain * steps_px, np.float64)

    def fits(
        self,
        image: Image,
        coordinates: Samples | FixedMaps,
        steps_px: Floats,
        weights: Samples,
        calm: Floats,
    ) -> MarkerFits:
        """Fits of n rings at coordinates (n, K * 2 * m, 2), robust where they are not `calm`."""
        levels = sample(image, coordinates)
        # Where there is no edge, offsets are not finite, and neither is the plain fit.
        with np.errstate(invalid="ignore", over="ignore"):
            contrast, offsets = edge_offsets(levels, weights, self.config.lines)
            fits = plain_fits(contrast, offsets, steps_px, self.ratio)
            noisy = (fits.scatter_px - _SMOOTH_PX) * fits.contrast
            quiet = (noisy < calm) & (np.abs(fits.growth_px) < 0.5 * steps_px)
        # Twice nothing is calm, but no ring.
        quiet &= fits.contrast > 0.0
        if quiet.all():
            return fits
        rest = ~quiet
        again = robust_fits(contrast[rest], offsets[rest], steps_px[rest], self.ratio)
        return _merged(fits, again, rest)

    def acceptable(self, fits: MarkerFits, half_axes_px: Floats) -> npt.NDArray[np.bool_]:
        """Which fits (n,) are those of rings of the size that their plane demands."""
        config = self.config
        result: npt.NDArray[np.bool_] = (
            np.isfinite(fits.shift_px).all(axis=1)
            & (fits.contrast >= config.min_contrast)
            & (fits.inliers >= config.min_inliers)
            & (np.abs(fits.growth_px) <= config.max_growth * half_axes_px[:, 1] + 0.5)
        )
        return result


def _merged(first: MarkerFits, second: MarkerFits, where: npt.NDArray[np.bool_]) -> MarkerFits:
    columns = []
    for name in MarkerFits.__dataclass_fields__:
        column = np.array(getattr(first, name))
        column[where] = getattr(second, name)
        columns.append(column)
    return MarkerFits(*columns)
