"""The markers that move: predicted, looked at twice, and their motion kept."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from geometry import Floats, View
from tracking.edges import area_filter, line_offsets
from tracking.images import Image
from tracking.measuring import Look, line_steps
from tracking.outlines import RingPlanes, RingTemplates, ring_templates
from tracking.profiles import Samples, line_points, line_vectors
from tracking.standing import Found

_Prepared: TypeAlias = tuple[
    npt.NDArray[np.int64], Floats, tuple[RingTemplates, Floats, Samples, Floats]
]

_NEAR_PX = 0.4
_TEMPLATE_SERVES_M = 0.1


class MovingMarkers:
    """n markers without a place. What is not known of them is NaN."""

    def __init__(self, view: View, planes: RingPlanes, look: Look) -> None:
        n = len(planes.radii)
        self._view, self._planes, self._look = view, planes, look
        self.xy = np.full((n, 2), np.nan)
        self.velocity = np.full((n, 2), np.nan)
        self._acceleration = np.zeros((n, 2))
        self._last: _Prepared | None = None
        self._t_ns = np.zeros(n, np.int64)
        self._before_s = np.zeros(n)
        """Between the last two sights."""

    def predicted(self, t_ns: int) -> Floats:
        """Where they should be (n, 2) at constant acceleration, or were if no speed is known."""
        after_s = self.since(t_ns)[:, None]
        bend = self._acceleration * ((after_s + self._before_s[:, None]) / 2.0)
        step = (self.velocity + bend) * after_s
        return np.where(np.isfinite(step), self.xy + step, self.xy)

    def since(self, t_ns: int) -> Floats:
        """Seconds (n,) since each was last seen."""
        return np.asarray((t_ns - self._t_ns) * 1e-9)

    def look(self, image: Image, which: npt.NDArray[np.int64], expected: Floats) -> Found:
        """Measure some of them near the places (k, 2) where they should be.

        The edge's area is asked: motion blur does not bias it. Where the prediction was off, a
        second look from the place that the first one gave is as exact as on a marker that stands.
        """
        look = self._look
        rings, steps, vectors, calm = self._prepared(which, expected)
        edges, centres = rings.placed(self._view, expected)
        coordinates = line_points(edges, vectors)
        fits = look.fits(image, coordinates, steps, area_filter(2), calm)
        shift = fits.shift_px
        if not np.abs(shift).max() < _NEAR_PX:
            good = np.isfinite(shift).all(axis=1) & (fits.contrast > 0.0)
            first = np.where(good[:, None], shift, 0.0)
            coordinates += first.astype(np.float32)[:, None, :]
            fits = look.fits(image, coordinates, steps, area_filter(2), calm)
            shift = first + fits.shift_px
        good = look.acceptable(fits, rings.axes_px)
        centres = centres + shift
        # The picture of the floor is bent; one step of Newton's method makes the line exact.
        xy = expected + _times(rings.inverse, shift)
        xy += _times(rings.inverse, centres - rings.centres(self._view, xy))
        return Found(good, centres, xy, rings.inverse, fits)

    def _prepared(
        self, which: npt.NDArray[np.int64], expected: Floats
    ) -> tuple[RingTemplates, Floats, Samples, Floats]:
        """Templates, steps and lines for places near these: those of before, if they serve."""
        last = self._last
        if last is not None and np.array_equal(last[0], which):
            off = last[1] - expected
            if np.abs(off).max() < _TEMPLATE_SERVES_M:
                return last[2]
        lines = self._look.config.lines
        rings = ring_templates(self._view, expected, self._planes.take(which), lines)
        steps = line_steps(rings.axes_px)
        calm = self._look.calm(area_filter(2), steps)
        prepared = rings, steps, line_vectors(lines, line_offsets(steps)), calm
        self._last = (which, expected, prepared)
        return prepared

    def keep(self, which: npt.NDArray[np.int64], xy: Floats, t_ns: int, fresh: bool) -> None:
        """Take these places (k, 2) as seen at t; fresh ones, found by search, tell no speed-up."""
        if not which.size:
            return
        after_s = (t_ns - self._t_ns[which]) * 1e-9
        # Of one never seen before, position and so velocity are NaN.
        velocity = (xy - self.xy[which]) / np.maximum(after_s, 1e-6)[:, None]
        if fresh:
            self._acceleration[which] = 0.0
        else:
            between_s = (after_s + self._before_s[which]) / 2.0
            limit = self._look.config.max_acceleration_m_s2
            bend = (velocity - self.velocity[which]) / between_s[:, None]
            self._acceleration[which] = np.minimum(np.maximum(bend, -limit), limit)
        self.velocity[which], self.xy[which] = velocity, xy
        self._before_s[which], self._t_ns[which] = after_s, t_ns


def _times(matrices: Floats, vectors: Floats) -> Floats:
    """Products (n, 2) of matrices (n, 2, 2) with vectors (n, 2)."""
    product: Floats = (matrices @ vectors[..., None])[..., 0]
    return product
