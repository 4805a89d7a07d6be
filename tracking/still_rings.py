"""Rings that stand still, averaged over many pictures of a camera that stands still too."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from geometry import Floats, RingShape
from tracking.errors import TrackingError
from tracking.images import Image
from tracking.rings import RingSearch, find_rings

_SAME_PX = 3.0
_LEAST_SHARE = 0.6
"""Of the pictures in which a ring must be seen to be one that stands there."""
_SYSTEMATIC_PX = 0.01
"""No average is better than this: print, lens and shadows do not average out."""
_MOVED_PX = 0.3
BLACK = 8
"""Grey level that a picture of anything exceeds somewhere."""


@dataclass(frozen=True, eq=False)
class StillRings:
    """n rings. centres_px : (n, 2) of their ellipses; sigma_px : (n,) of either coordinate.

    diameters_px : (n, 2) longer and shorter axis; image : the first picture, for the eye;
    pictures : how many were averaged.
    """

    centres_px: Floats
    sigma_px: Floats
    diameters_px: Floats
    pictures: int
    image: Image

    @property
    def size_px(self) -> tuple[int, int]:
        """Width, height."""
        return self.image.shape[1], self.image.shape[0]


def average_rings(
    shown: Iterable[Image], shape: RingShape, most: int = 60, smallest_px: float = 6.0
) -> StillRings:
    """The rings that most of the pictures show at one place.

    most : pictures that are looked at. Raises `TrackingError` for no picture, black ones, and a
    camera that moved.
    """
    search = RingSearch(shape=shape, smallest_px=smallest_px)
    first: Image | None = None
    places: list[Floats] = []
    for image in shown:
        first = image if first is None else first
        if image.shape != first.shape:
            raise TrackingError("not all pictures are of one size")
        if int(image.max()) < BLACK:
            raise TrackingError(f"picture {len(places)} is black; is the lens cap on?")
        found = find_rings(image, search)
        places.append(np.hstack([found.centres_px, found.diameters_px]))
        if len(places) >= most:
            break
    if first is None:
        raise TrackingError("there is no picture that could be read")
    tracks = _tracks(places)
    seen = np.isfinite(tracks[..., 0])
    tracks = tracks[:, seen.mean(axis=0) >= _LEAST_SHARE]
    _refuse_movement(tracks)
    if not tracks.shape[1]:
        return StillRings(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), len(places), first)
    count = np.isfinite(tracks[..., 0]).sum(axis=0)
    mean = np.nanmean(tracks, axis=0)
    scatter = np.sqrt(np.nanmean((tracks - mean)[..., :2] ** 2, axis=(0, 2)))
    sigma = np.hypot(scatter / np.sqrt(count), _SYSTEMATIC_PX)
    return StillRings(mean[:, :2], sigma, mean[:, 2:], len(places), first)


def _tracks(places: list[Floats]) -> Floats:
    """(pictures, rings, 4): every ring's place and axes in every picture, NaN where not seen."""
    known = np.zeros((0, 4))
    for found in places:
        apart = np.linalg.norm(found[:, None, :2] - known[None, :, :2], axis=2)
        new = found[(apart > _SAME_PX).all(axis=1)] if len(known) else found
        known = np.concatenate([known, new])
    tracks = np.full((len(places), len(known), 4), np.nan)
    for row, found in zip(tracks, places, strict=True):
        if not (len(found) and len(known)):
            continue
        apart = np.linalg.norm(found[:, None, :2] - known[None, :, :2], axis=2)
        nearest = apart.argmin(axis=1)
        near = apart.min(axis=1) <= _SAME_PX
        row[nearest[near]] = found[near]
    return tracks


def _refuse_movement(tracks: Floats) -> None:
    """Raise when the rings of the last third are not where those of the first third were."""
    third = len(tracks) // 3
    if not third or not tracks.shape[1]:
        return
    early, late = tracks[:third], tracks[-third:]
    both = np.isfinite(early[..., 0]).any(axis=0) & np.isfinite(late[..., 0]).any(axis=0)
    if not both.any():
        return
    step = np.nanmedian(late[:, both], axis=0) - np.nanmedian(early[:, both], axis=0)
    moved = float(np.hypot(*np.median(step[:, :2], axis=0)))
    if moved > _MOVED_PX:
        raise TrackingError(
            f"the camera moved by {moved:.1f} px while the corners were filmed; fix it and film "
            "them again"
        )
