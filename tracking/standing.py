"""The markers that stand: their geometry is worked out once, a frame costs one look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, View
from tracking.images import Image
from tracking.marker_fit import SHIFT
from tracking.measuring import Look, line_steps, ring_coordinates
from tracking.outlines import RingPlanes, ring_templates
from tracking.profiles import fixed_maps

_SETTLING = 3
_PROBE_PX = 0.25


@dataclass(frozen=True, eq=False)
class Found:
    """n markers in one frame: whether each was found, and its row (11) of the frame's report.

    The columns of rows : (n, 11) are told in `tracking.kernels`.
    """

    good: npt.NDArray[np.bool_]
    rows: Floats

    @property
    def xy(self) -> Floats:
        """Places (n, 2) on the floor."""
        return self.rows[:, 2:4]


class StandingMarkers:
    """n markers with a place each."""

    def __init__(self, view: View, planes: RingPlanes, xy: Floats, look: Look) -> None:
        from tracking.kernels import standing_rows

        n = len(xy)
        self._view, self._planes, self._look, self._rows = view, planes, look, standing_rows
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
        self._filters = look.area
        if n:
            self._lay_out(np.arange(n))

    def look(self, image: Image) -> Found:
        """Where they are now."""
        look = self._look
        fits = look.fits(image, self._maps, self._steps, self._filters, self._calm)
        good, rows = self._rows(
            fits, self._axes, self._steps, self._gain, self._centres, self.xy, self._floor_slopes,
            look.limits,
        )  # fmt: skip
        return Found(good & self.settled, rows)

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
            calm = self._look.calm(self._look.area, steps)
            spots = self._coordinates[which]
            fits = self._look.fits(image, spots, steps, self._look.area, calm)
            good &= self._look.acceptable(fits, self._axes[which])
            moved = np.einsum("nij,nj->ni", self._floor_slopes[which], fits[:, SHIFT])
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
        filters = self._filters if len(self._filters) == 1 else self._filters[which]
        seen = []
        for aside in (-_PROBE_PX, _PROBE_PX):
            shifted = self._coordinates[which] + np.array([aside, 0.0], np.float32)
            calm = self._calm[which]
            fits = self._look.fits(image, shifted, self._steps[which], filters, calm)
            seen.append(fits[:, 0])
        gain = (seen[0] - seen[1]) / (2.0 * _PROBE_PX)
        self._gain[which] = np.where((gain > 0.3) & (gain < 2.0), gain, 1.0)
