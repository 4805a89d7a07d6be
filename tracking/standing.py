"""The markers that stand: their geometry is worked out once, a frame costs one look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, View
from tracking.edges import area_filter
from tracking.images import Image
from tracking.marker_fit import MarkerFits
from tracking.measuring import Look, line_steps, ring_coordinates
from tracking.outlines import RingPlanes, ring_templates
from tracking.profiles import Samples, fixed_maps

_SETTLING = 3
_PROBE_PX = 0.25
_STRAYED_PX = 0.5
"""Further from where it stands it is measured afresh: the filter is exact near the edge only."""


@dataclass(frozen=True, eq=False)
class Found:
    """n markers in one frame: whether each was found, where, and how it was fitted.

    centres_px, xy : (n, 2); floor_slopes : (n, 2, 2) d world / d pixel.
    """

    good: npt.NDArray[np.bool_]
    centres_px: Floats
    xy: Floats
    floor_slopes: Floats
    fits: MarkerFits


class StandingMarkers:
    """n markers with a place each."""

    def __init__(self, view: View, planes: RingPlanes, xy: Floats, look: Look) -> None:
        n = len(xy)
        self._view, self._planes, self._look = view, planes, look
        self.xy = np.array(xy, np.float64)
        self._centres = np.zeros((n, 2))
        self._floor_slopes = np.zeros((n, 2, 2))
        self._axes = np.ones((n, 2))
        self._steps = np.ones(n)
        self._gain = np.ones(n)
        self._calm = np.ones(n)
        self.settled = np.zeros(n, bool)
        lines = look.config.lines
        self._coordinates = ring_coordinates(np.zeros((n, lines, 2, 2)), self._steps)
        self._maps = fixed_maps(self._coordinates)
        self._filters: Samples | None = None
        if n:
            self._lay_out(np.arange(n))

    def look(self, image: Image) -> Found:
        """Where they are now."""
        assert self._filters is not None
        fits = self._look.fits(image, self._maps, self._steps, self._filters, self._calm)
        shift = fits.shift_px / self._gain[:, None]
        good = self.settled & self._look.acceptable(fits, self._axes)
        with np.errstate(invalid="ignore"):
            good &= (shift * shift).sum(axis=1) < (_STRAYED_PX * self._steps) ** 2
        xy = self.xy + np.einsum("nij,nj->ni", self._floor_slopes, shift)
        return Found(good, self._centres + shift, xy, self._floor_slopes, fits)

    def settle(
        self, image: Image, which: npt.NDArray[np.int64], xy: Floats
    ) -> npt.NDArray[np.int64]:
        """Let some of them stand near these places (k, 2); the ones that are really there.

        Those are laid out at the place where this picture shows them; the others keep their place.
        A marker is settled once at least before it is followed: places from outside are off by
        more than a look can bear.
        """
        if not which.size:
            return which
        before = self.xy[which].copy()
        self.xy[which] = xy
        good = np.ones(len(which), bool)
        for _ in range(_SETTLING):
            self._lay_out(which)
            steps = self._steps[which]
            calm = self._look.calm(area_filter(2), steps)
            spots = self._coordinates[which]
            fits = self._look.fits(image, spots, steps, area_filter(2), calm)
            good &= self._look.acceptable(fits, self._axes[which])
            moved = np.einsum("nij,nj->ni", self._floor_slopes[which], fits.shift_px)
            self.xy[which] += np.where(good[:, None], moved, 0.0)
        self.xy[which[~good]] = before[~good]
        self.settled[which[good]] = True
        self._lay_out(which)
        self._calibrate(image, which[good])
        return which[good]

    def _lay_out(self, which: npt.NDArray[np.int64]) -> None:
        """Edges, sample points and filters for the present places."""
        planes, lines = self._planes.take(which), self._look.config.lines
        rings = ring_templates(self._view, self.xy[which], planes, lines)
        edges, self._centres[which] = rings.placed(self._view, self.xy[which])
        self._axes[which], self._steps[which] = rings.axes_px, line_steps(rings.axes_px)
        self._floor_slopes[which] = rings.inverse
        self._coordinates[which] = ring_coordinates(edges, self._steps[which])
        self._maps = fixed_maps(self._coordinates)
        self._filters = self._look.filters(self._axes)
        self._calm = self._look.calm(self._filters, self._steps)

    def _calibrate(self, image: Image, which: npt.NDArray[np.int64]) -> None:
        """The gain of the matched filter for the blur that the picture really has."""
        if not which.size:
            return
        assert self._filters is not None
        filters = self._filters if self._filters.ndim == 2 else self._filters[which]
        seen = []
        for aside in (-_PROBE_PX, _PROBE_PX):
            shifted = self._coordinates[which] + np.array([aside, 0.0], np.float32)
            calm = self._calm[which]
            fits = self._look.fits(image, shifted, self._steps[which], filters, calm)
            seen.append(fits.shift_px[:, 0])
        gain = (seen[0] - seen[1]) / (2.0 * _PROBE_PX)
        self._gain[which] = np.where((gain > 0.3) & (gain < 2.0), gain, 1.0)
