"""The markers that move: predicted, looked at twice, and their motion kept."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from geometry import Floats, View
from tracking.edges import line_offsets
from tracking.images import Image
from tracking.marker_fit import CONTRAST, SHIFT
from tracking.measuring import Look, line_steps
from tracking.outlines import RingPlanes, RingTemplates, ring_templates
from tracking.profiles import Samples, line_vectors
from tracking.standing import Found

_Prepared: TypeAlias = tuple[
    npt.NDArray[np.int64], Floats, tuple[RingTemplates, Floats, Samples, Floats]
]

_NEAR_PX = 0.4
_TEMPLATE_SERVES_M = 0.1


class MovingMarkers:
    """n markers without a place. What is not known of them is NaN."""

    def __init__(self, view: View, planes: RingPlanes, look: Look) -> None:
        from tracking.kernels import moving_rows, predict, remember, ring_points

        n, camera = len(planes.radii), view.camera
        self._view, self._planes, self._look = view, planes, look
        self._floor = np.column_stack([view.rotation[:, :2], view.translation])
        self._lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])
        self._points, self._rows = ring_points, moving_rows
        self._predict, self._remember = predict, remember
        self.xy = np.full((n, 2), np.nan)
        self.velocity = np.full((n, 2), np.nan)
        self._acceleration = np.zeros((n, 2))
        self._last: _Prepared | None = None
        self._t_ns = np.zeros(n, np.int64)
        self._before_s = np.zeros(n)
        """Between the last two sights."""

    def predicted(self, t_ns: int) -> Floats:
        """Where they should be (n, 2) at constant acceleration, or were if no speed is known."""
        return self._predict(
            self.xy, self.velocity, self._acceleration, self._before_s, self._t_ns, t_ns
        )

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
        coordinates, centres = self._points(
            rings.spread, expected, vectors, self._floor, self._lens
        )
        fits = look.fits(image, coordinates, steps, look.area, calm)
        shift = fits[:, SHIFT]
        if not np.abs(shift).max() < _NEAR_PX:
            good = np.isfinite(shift).all(axis=1) & (fits[:, CONTRAST] > 0.0)
            first = np.where(good[:, None], shift, 0.0)
            coordinates += first.astype(np.float32)[:, None, :]
            fits = look.fits(image, coordinates, steps, look.area, calm)
            fits[:, SHIFT] += first
        return Found(
            *self._rows(
                fits, rings.axes_px, centres, expected, rings.inverse, rings.spread,
                self._floor, self._lens, look.limits,
            )
        )  # fmt: skip

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
        calm = self._look.calm(self._look.area, steps)
        prepared = rings, steps, line_vectors(lines, line_offsets(steps)), calm
        self._last = (which, expected, prepared)
        return prepared

    def keep(self, which: npt.NDArray[np.int64], found: Found, t_ns: int, *, fresh: bool) -> None:
        """Take what was found (k,) as seen at t; fresh ones, found by search, tell no speed-up."""
        limit = 0.0 if fresh else self._look.config.max_acceleration_m_s2
        self._remember(
            which, found.good, found.rows, t_ns, limit,
            self.xy, self.velocity, self._acceleration, self._before_s, self._t_ns,
        )  # fmt: skip
