"""What should stand still, watched: a camera that was knocked, cones that were bumped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats
from tracking.following import Tracks

_REFERENCE = 30
"""Frames from whose median a ring's own place is taken."""
_FOR_FRAMES = 9
"""A step must last so long to be one."""
MOVED_PX = 0.3
BUMPED_M = 0.003


@dataclass(frozen=True)
class Bump:
    """A ring that moved by itself: when first seen so, and how far in the end."""

    name: str
    t_ns: int
    moved_m: float


@dataclass(frozen=True, eq=False)
class Watch:
    """moved_ns : when the camera had moved, None if it did not; moved_px : how far at most.

    watched : frames in which three rings that stand were seen, without which nothing is known of
    the camera. bumps : rings that moved alone. hidden : names of rings that stand and were seen in
    less than a tenth of the frames. residual_px : rms of rings that stand around their places.
    """

    moved_ns: int | None
    moved_px: float
    watched: int
    bumps: tuple[Bump, ...]
    hidden: tuple[str, ...]
    residual_px: float


def watch(tracks: Tracks) -> Watch:
    """What the rings that stand say about camera and cones."""
    pixels, xy = tracks.pixels[:, :-2], tracks.xy[:, :-2]
    seen = tracks.seen[:, :-2]
    names = tracks.names[:-2]
    hidden = tuple(n for n, share in zip(names, seen.mean(axis=0), strict=True) if share < 0.1)
    off_px, off_m = _away(pixels, seen), _away(xy, seen)
    common_px, enough = _common(off_px, seen)
    size = _median_of_nine(np.linalg.norm(common_px, axis=1))
    knocked = _lasting(size > MOVED_PX)
    common_m, _ = _common(off_m, seen)
    own_m = np.linalg.norm(off_m - np.nan_to_num(common_m)[:, None], axis=2)
    bumps = []
    for k, name in enumerate(names):
        rows = np.flatnonzero(seen[:, k])
        away = _lasting(own_m[rows, k] > BUMPED_M)
        if away is not None:
            moved = float(np.median(own_m[rows[-_FOR_FRAMES:], k]))
            bumps.append(Bump(name, int(tracks.t_ns[rows[away]]), moved))
    alone = np.linalg.norm(off_px - np.nan_to_num(common_px)[:, None], axis=2)
    still = [k for k, name in enumerate(names) if name not in {bump.name for bump in bumps}]
    residual = float(np.sqrt(np.nanmean(alone[:, still] ** 2))) if seen[:, still].any() else np.nan
    return Watch(
        None if knocked is None else int(tracks.t_ns[knocked]),
        float(np.nan_to_num(size).max(initial=0.0)),
        int(enough.sum()),
        tuple(bumps),
        hidden,
        residual,
    )


def _away(places: Floats, seen: npt.NDArray[np.bool_]) -> Floats:
    """Of each ring (n, m, 2) from its own first place; NaN where not seen."""
    away = np.full_like(places, np.nan)
    for k in range(places.shape[1]):
        rows = np.flatnonzero(seen[:, k])
        if rows.size:
            away[rows, k] = places[rows, k] - np.median(places[rows[:_REFERENCE], k], axis=0)
    return away


def _common(away: Floats, seen: npt.NDArray[np.bool_]) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """What most rings (n, m, 2) did together, (n, 2), and where three were seen, (n,)."""
    enough = seen.sum(axis=1) >= 3
    common = np.full((len(away), 2), np.nan)
    if enough.any():
        common[enough] = np.nanmedian(away[enough], axis=1)
    return common, enough


def _median_of_nine(values: Floats) -> Floats:
    """A running median; NaN where there is nothing."""
    padded = np.pad(values, _FOR_FRAMES // 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, _FOR_FRAMES)
    known = np.isfinite(windows).any(axis=1)
    result = np.full(len(values), np.nan)
    if known.any():
        result[known] = np.nanmedian(windows[known], axis=1)
    return result


def _lasting(flags: npt.NDArray[np.bool_]) -> int | None:
    """Where a run of enough true values begins, None if there is none."""
    if len(flags) < _FOR_FRAMES:
        return None
    windows = np.lib.stride_tricks.sliding_window_view(flags, _FOR_FRAMES).all(axis=1)
    return int(np.argmax(windows)) if windows.any() else None
