"""Pictures that are damaged within and decode all the same: parts of them are shifted or smeared.

No header tells of a bit that fell over in the middle of a JPEG. The rings do: those that stand jump
or vanish together for a moment, or the car jumps further than any car can.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tracking.following import Tracks
from tracking.markers import State

_JUMP_PX = 2.0
_LASTING = 9
"""A ring that is elsewhere for so many frames was moved; the picture is whole."""
_VANISHED = 1.0 / 3.0
_MOST_M_S2 = 20.0
"""What tyres can do, twice."""
_SLACK_M = 0.004
FAULT = "torn: within the picture something is shifted or smeared"


def without_torn(tracks: Tracks) -> Tracks:
    """The tracks with nothing seen in torn frames, which are told among the faults."""
    torn = _jumped(tracks) | _vanished(tracks) | _car_jumped(tracks)
    if not torn.any():
        return tracks
    states = tracks.states.copy()
    states[torn] = State.LOST
    told = [(int(number), FAULT) for number in tracks.sequence[torn]]
    return replace(tracks, states=states, faults=(*tracks.faults, *told))


def _jumped(tracks: Tracks) -> npt.NDArray[np.bool_]:
    """(n,): a ring that stands is elsewhere, though not for long."""
    seen, pixels = tracks.seen[:, :-2], tracks.pixels[:, :-2]
    torn = np.zeros(len(seen), bool)
    for k in range(seen.shape[1]):
        rows = np.flatnonzero(seen[:, k])
        if not rows.size:
            continue
        before = pixels[rows, k]
        usual = np.stack([_running_median(before[:, axis]) for axis in (0, 1)], axis=1)
        torn[rows] |= np.linalg.norm(before - usual, axis=1) > _JUMP_PX
    return torn


def _running_median(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Over twice as many values as last."""
    half = min(_LASTING, (len(values) - 1) // 2)
    padded = np.pad(values, half, mode="reflect") if half else values
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    return np.asarray(np.median(windows, axis=1))


def _vanished(tracks: Tracks) -> npt.NDArray[np.bool_]:
    """(n,): two rings that stand, or more, and a third of them, are gone from frame to frame."""
    seen = tracks.seen[:, :-2]
    gone = np.zeros(len(seen), bool)
    count = (seen[:-1] & ~seen[1:]).sum(axis=1)
    gone[1:] = (count >= 2) & (count >= _VANISHED * seen[:-1].sum(axis=1))
    return gone


def _car_jumped(tracks: Tracks) -> npt.NDArray[np.bool_]:
    """(n,): the car is off the line between its neighbours by more than it can accelerate."""
    torn = np.zeros(len(tracks.t_ns), bool)
    rows = np.flatnonzero(tracks.seen[:, -2:].all(axis=1))
    if rows.size < 3:
        return torn
    t_s = (tracks.t_ns[rows] - tracks.t_ns[0]) * 1e-9
    middle = tracks.xy[rows, -2:].mean(axis=1)
    before_s, after_s = np.diff(t_s)[:-1], np.diff(t_s)[1:]
    share = (before_s / (before_s + after_s))[:, None]
    off = middle[1:-1] - (1.0 - share) * middle[:-2] - share * middle[2:]
    limit = 0.5 * _MOST_M_S2 * before_s * after_s + _SLACK_M
    ratio = np.linalg.norm(off, axis=1) / limit
    # A jump spoils its neighbours' tests too: the worst of three is the one.
    padded = np.pad(ratio, 1)
    worst = (ratio >= padded[:-2]) & (ratio >= padded[2:])
    torn[rows[1:-1]] = (ratio > 1.0) & worst
    return torn
