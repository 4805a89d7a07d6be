"""Rings that stand still, averaged over many pictures of a camera that stands still too."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from calibration.errors import CalibrationError
from calibration.pictures import Picture
from geometry import Floats, RingShape
from tracking import Image, RingSearch, find_rings

_SAME_PX = 3.0
_LEAST_SHARE = 0.6
"""Of the pictures in which a ring must be seen to be one that stands there."""
_SYSTEMATIC_PX = 0.01
"""No average is better than this: print, lens and shadows do not average out."""
_MOVED_PX = 0.3
_BLACK = 8


@dataclass(frozen=True, eq=False)
class StillRings:
    """n rings. centres_px : (n, 2) of their ellipses; sigma_px : (n,) of either coordinate.

    image : the first picture, for the eye; pictures : how many were averaged.
    """

    centres_px: Floats
    sigma_px: Floats
    pictures: int
    image: Image

    @property
    def size_px(self) -> tuple[int, int]:
        """Width, height."""
        return self.image.shape[1], self.image.shape[0]


def average_rings(
    shown: Iterable[Picture], shape: RingShape, most: int = 60, smallest_px: float = 6.0
) -> StillRings:
    """The rings that most of the pictures show at one place.

    most : pictures that are looked at. Raises `CalibrationError` for no picture, black ones, and a
    camera that moved.
    """
    search = RingSearch(shape=shape, smallest_px=smallest_px)
    first: Image | None = None
    places: list[Floats] = []
    for picture in shown:
        if first is None:
            first = picture.image
        if picture.image.shape != first.shape:
            raise CalibrationError(f"{picture.name}: is not as large as the pictures before it")
        if int(picture.image.max()) < _BLACK:
            raise CalibrationError(f"{picture.name}: is black; is the lens cap on?")
        places.append(find_rings(picture.image, search).centres_px)
        if len(places) >= most:
            break
    if first is None:
        raise CalibrationError("there is no picture that could be read")
    tracks = _tracks(places)
    seen = np.isfinite(tracks[..., 0])
    tracks = tracks[:, seen.mean(axis=0) >= _LEAST_SHARE]
    _refuse_movement(tracks)
    count = np.maximum(np.isfinite(tracks[..., 0]).sum(axis=0), 1)
    centres = np.nanmean(tracks, axis=0) if tracks.shape[1] else np.zeros((0, 2))
    scatter = np.sqrt(np.nanmean((tracks - centres) ** 2, axis=(0, 2))) if len(centres) else count
    return StillRings(
        centres, np.hypot(scatter / np.sqrt(count), _SYSTEMATIC_PX), len(places), first
    )


def _tracks(places: list[Floats]) -> Floats:
    """(pictures, rings, 2): every ring's place in every picture, NaN where it was not seen."""
    known = np.zeros((0, 2))
    for found in places:
        apart = np.linalg.norm(found[:, None] - known[None], axis=2)
        new = found[(apart > _SAME_PX).all(axis=1)] if len(known) else found
        known = np.concatenate([known, new])
    tracks = np.full((len(places), len(known), 2), np.nan)
    for row, found in zip(tracks, places, strict=True):
        if not (len(found) and len(known)):
            continue
        apart = np.linalg.norm(found[:, None] - known[None], axis=2)
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
    moved = float(np.hypot(*np.median(step, axis=0)))
    if moved > _MOVED_PX:
        raise CalibrationError(
            f"the camera moved by {moved:.1f} px while the corners were filmed; fix it and film "
            "them again"
        )
