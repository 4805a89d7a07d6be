"""Finding again what is lost: a search where it can be, and a match only when it is certain."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats, View, at_height, circle_centres
from tracking.identity import NOBODY, CarMemory, RingPair, pair_match
from tracking.images import Image
from tracking.outlines import RingPlanes, half_axes
from tracking.rings import RingSearch, RingSightings, find_rings

_SIZE_SHARE, _SIZE_PX = 0.05, 0.6
"""By how much a ring's axes may differ from what its plane demands."""
_IN_PLACE_M = 0.03
_ROOM = 2.0
"""A region reaches so many diameters beyond where the marker's middle can be."""


class Recovery:
    """Searches in pictures of one view."""

    def __init__(self, view: View, planes: RingPlanes, search: RingSearch) -> None:
        self._view, self._planes, self._search = view, planes, search

    def region(
        self, which: npt.NDArray[np.int64], xy: Floats, reach_m: Floats
    ) -> tuple[slice, slice] | None:
        """The part of the picture where markers within reach (k,) of (k, 2) can be.

        None is the whole picture: where a place is not known.
        """
        size = np.array([self._view.camera.width_px, self._view.camera.height_px])
        reach = reach_m[:, None] + _ROOM * 2.0 * self._planes.radii[which][:, None]
        corners = xy[:, None] + reach[:, None] * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
        pixels = self._view.project(at_height(corners, self._planes.heights[which][:, None]))
        if not np.isfinite(pixels).all():
            return None
        low = np.clip(np.floor(pixels.min(axis=(0, 1))), 0, size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=(0, 1))), 0, size).astype(int)
        if (high - low < 1).any():
            return slice(0, 0), slice(0, 0)
        return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))

    def sightings(
        self, image: Image, region: tuple[slice, slice] | None, known_px: Floats
    ) -> RingSightings:
        """Rings in the region that are not one of those already known to be at (j, 2)."""
        found = find_rings(image, self._search, region)
        if not len(found) or not len(known_px):
            return found
        apart = np.linalg.norm(found.centres_px[:, None] - known_px[None], axis=2).min(axis=1)
        return found.take(apart > 0.5 * found.diameters_px[:, 1])

    def places(self, found: RingSightings, which: npt.NDArray[np.int64]) -> Floats:
        """World x, y (k, m, 2) of the rings, were they these markers; NaN if of another size."""
        places = np.full((len(which), len(found), 2), np.nan)
        heights, radii = self._planes.heights[which], self._planes.radii[which]
        for height, radius in {*zip(heights.tolist(), radii.tolist(), strict=True)}:
            same = (heights == height) & (radii == radius)
            places[same] = self._at_height(found, height, radius)
        return places

    def _at_height(self, found: RingSightings, height: float, radius: float) -> Floats:
        if not len(found):
            return np.zeros((0, 2))
        xy = circle_centres(self._view, found.centres_px, height, radius)
        known = np.asarray(np.isfinite(xy).all(axis=1))
        slopes = self._view.plane_jacobian(np.where(known[:, None], xy, 0.0), height)
        demanded = 2.0 * half_axes(slopes, np.full(len(xy), radius))
        wrong = np.abs(found.diameters_px - demanded) > _SIZE_SHARE * demanded + _SIZE_PX
        return np.where((known & ~wrong.any(axis=1))[:, None], xy, np.nan)


def match_moving(
    places: Floats,
    expected: Floats,
    gates_m: Floats,
    lost: npt.NDArray[np.bool_],
    seen_xy: Floats,
    pair: RingPair | None,
    memory: CarMemory | None,
) -> npt.NDArray[np.int64]:
    """The found ring of each moving marker (k, 2), or -1; places (k, m, 2), each at its height.

    lost : (k,) which are looked for; seen_xy : (k, 2) where the others are. A pair is matched
    together, or the lost one by its distance from the one that is seen.
    """
    matches = np.full(len(expected), NOBODY, np.int64)
    rest = lost.copy()
    if pair is not None and lost[[pair.front, pair.rear]].any():
        rest[[pair.front, pair.rear]] = False
        both = np.array([pair.front, pair.rear])
        candidates = places[pair.front]
        if lost[both].all():
            gate = float(gates_m[both].max())
            found = pair_match(pair, expected[both], gate, candidates, memory)
            if found is not None:
                matches[both] = found
        else:
            alone, other = (both[lost[both]][0], both[~lost[both]][0])
            apart = np.linalg.norm(places[alone] - seen_xy[other], axis=1)
            fits = np.flatnonzero(np.abs(apart - pair.distance_m) <= pair.tolerance_m)
            if len(fits) == 1:
                matches[alone] = fits[0]
    for i in np.flatnonzero(rest):
        near = np.isfinite(places[i]).all(axis=1)
        if np.isfinite(expected[i]).all():
            near &= np.linalg.norm(places[i] - expected[i], axis=1) <= gates_m[i]
        fits = np.flatnonzero(near)
        if len(fits) == 1:
            matches[i] = fits[0]
    taken, counts = np.unique(matches[matches != NOBODY], return_counts=True)
    matches[np.isin(matches, taken[counts > 1])] = NOBODY
    return matches


def may_be(places: Floats, expected: Floats, reach_m: Floats) -> npt.NDArray[np.bool_]:
    """Which of the m rings may be any of the lost movers: places (k, m, 2), expected (k, 2)."""
    off = np.linalg.norm(places - expected[:, None], axis=2)
    # Where nothing is expected, anything of the right size will do.
    within = (off <= reach_m[:, None]) | ~np.isfinite(reach_m)[:, None]
    return np.asarray((within & np.isfinite(places).all(axis=2)).any(axis=0))


def in_place(
    matches: npt.NDArray[np.int64], places: Floats, expected: Floats
) -> npt.NDArray[np.bool_]:
    """Which matches (k,) are of rings right at the places (k, 2) expected; places (k, m, 2)."""
    matched = np.asarray(matches != NOBODY)
    if not matched.any():
        return matched
    off = np.linalg.norm(places[np.arange(len(matches)), matches] - expected, axis=1)
    return np.asarray(matched & (off <= _IN_PLACE_M))
