"""The markers that move: predicted, looked at twice, and their motion kept."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats, View, at_height
from tracking.images import Image
from tracking.measuring import Look, line_steps, ring_coordinates
from tracking.outlines import RingPlanes, half_axes, inverse, outlines
from tracking.standing import Found


class MovingMarkers:
    """n markers without a place. What is not known of them is NaN."""

    def __init__(self, view: View, planes: RingPlanes, look: Look) -> None:
        n = len(planes.radii)
        self._view, self._planes, self._look = view, planes, look
        self.xy = np.full((n, 2), np.nan)
        self.velocity = np.full((n, 2), np.nan)
        self._acceleration = np.zeros((n, 2))
        self._slopes = np.zeros((n, 2, 2))
        self._t_ns = np.zeros(n, np.int64)
        self._before_s = np.zeros(n)
        """Between the last two sights."""

    def predicted(self, t_ns: int) -> Floats:
        """Where they should be, (n, 2): constant acceleration; where they were if no speed is known."""
        after_s = self.since(t_ns)[:, None]
        velocity = np.nan_to_num(self.velocity)
        bend = self._acceleration * (after_s + self._before_s[:, None]) / 2.0
        return self.xy + (velocity + bend) * after_s

    def since(self, t_ns: int) -> Floats:
        """Seconds (n,) since each was last seen."""
        return np.asarray((t_ns - self._t_ns) * 1e-9)

    def look(self, image: Image, which: npt.NDArray[np.int64], expected: Floats) -> Found:
        """Measure some of them near the places (k, 2) where they should be.

        A first look takes up the error of the prediction, a second one is as exact as on a marker
        that stands. The edge's area is asked both times: motion blur does not bias it.
        """
        planes, look = self._planes.take(which), self._look
        slopes = self._slopes[which]
        laid = outlines(
            self._view, expected, planes, look.config.lines, slopes if slopes.all() else None
        )
        axes = half_axes(laid.slopes, planes.radii)
        steps = line_steps(axes)
        coordinates = ring_coordinates(laid.edges, steps)
        first, _ = look.fits(image, coordinates, steps)
        good = np.isfinite(first.shift_px).all(axis=1) & (first.contrast > 0.0)
        shift = np.where(good[:, None], first.shift_px, 0.0)
        coordinates += shift.astype(np.float32)[:, None, :]
        fits, _ = look.fits(image, coordinates, steps)
        good &= look.acceptable(fits, axes)
        centres = laid.centres + shift + fits.shift_px
        # The picture of the floor is bent; one step of Newton's method makes the line exact.
        floor_slopes = inverse(laid.slopes)
        xy = expected + np.einsum("nij,nj->ni", floor_slopes, shift + fits.shift_px)
        missed = centres - self._view.project(at_height(xy, planes.heights))
        xy += np.einsum("nij,nj->ni", floor_slopes, missed)
        self._slopes[which[good]] = laid.slopes[good]
        return Found(good, centres, xy, floor_slopes, fits)

    def keep(self, which: npt.NDArray[np.int64], xy: Floats, t_ns: int, fresh: bool) -> None:
        """Take these places (k, 2) as seen at t. fresh : found by search, no speed follows."""
        after_s = self.since(t_ns)[which]
        with np.errstate(divide="ignore", invalid="ignore"):
            velocity = (xy - self.xy[which]) / after_s[:, None]
            bend = (velocity - self.velocity[which]) * (2.0 / (after_s + self._before_s[which]))[:, None]
        known = after_s > 0.0
        limit = self._look.config.max_acceleration_m_s2
        bend = np.where(np.isfinite(bend) & known[:, None], np.clip(bend, -limit, limit), 0.0)
        self.velocity[which] = np.where(known[:, None], velocity, np.nan)
        self._acceleration[which] = 0.0 if fresh else bend
        self._before_s[which] = after_s
        self.xy[which] = xy
        self._t_ns[which] = t_ns
