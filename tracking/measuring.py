"""One look at known rings: levels along their lines, offsets of their edges, fits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from geometry import Floats, RingShape
from tracking.edges import area_filter, line_offsets, matched_filter
from tracking.images import Image
from tracking.marker_fit import fit_design
from tracking.profiles import FixedMaps, Samples, grey_levels, line_points, line_vectors

_LONGEST_STEP_PX = 1.0
_ALIKE = 1.15
_LARGE_PX = 30.0
"""Of a larger ring a line across one edge sees no other."""
_STEP_OF_AXIS = 0.1
"""Seven samples at a tenth of the shorter half axis stay between the edges of a ring."""


_CALM = 1.3
"""Lines may scatter by so many times what the noise explains."""


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


def ring_filters(half_axes_px: Floats, shape: RingShape, sigma_px: float) -> Floats:
    """Matched filters (n, 14, 4); one for all (1, 14, 4) when rings are of nearly one size.

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
    alike = len(set(map(id, filters))) == 1
    return np.asarray(filters[:1] if alike else filters, np.float64)


class Look:
    """How rings are measured, with one configuration and one ratio of diameters.

    Loads the compiled kernels, which the first time on a machine means compiling them.
    """

    def __init__(self, config: TrackerConfig, shape: RingShape) -> None:
        from tracking.kernels import acceptable, fit_rings

        self.config, self.shape = config, shape
        self.area: Floats = area_filter(2)[None].astype(np.float64)
        """The filter (1, 14, 4) for rings that are not quite where they are expected."""
        self.limits = np.array([config.min_contrast, config.min_inliers, config.max_growth])
        self._design = fit_design(config.lines, shape.ratio)
        self._fit_rings, self._acceptable = fit_rings, acceptable

    def filters(self, half_axes_px: Floats) -> Floats:
        """Matched filters for rings with these half axes (n, 2)."""
        return ring_filters(half_axes_px, self.shape, self.config.edge_sigma_px)

    def calm(self, weights: Floats, steps_px: Floats) -> Floats:
        """Scatter times contrast (n,) below which nothing but noise disturbs a ring."""
        products = weights[..., 2]
        gain = np.sqrt(np.einsum("...i,...i->...", products, products).max())
        return np.asarray(_CALM * self.config.noise * gain * steps_px, np.float64)

    def fits(
        self,
        image: Image,
        coordinates: Samples | FixedMaps,
        steps_px: Floats,
        weights: Floats,
        calm: Floats,
    ) -> Floats:
        """Fits (n, 10) of rings at coordinates (n, K * 2 * m, 2), robust where not `calm`.

        Their columns: see `tracking.kernels`.
        """
        design, levels = self._design, grey_levels(image, coordinates)
        return self._fit_rings(
            levels, weights, steps_px, calm,
            design.model, design.inverse, design.products, design.weights,
        )  # fmt: skip

    def acceptable(self, fits: Floats, half_axes_px: Floats) -> npt.NDArray[np.bool_]:
        """Which fits (n,) are those of rings of the size that their plane demands."""
        return self._acceptable(fits, half_axes_px, self.limits)
