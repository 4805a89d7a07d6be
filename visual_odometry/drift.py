"""How far odometry runs away from the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from capture import Odometry
from geometry import Floats, Trajectory, between

_MAX_GAP_S = 0.2
_PIECE_M = 1.0


@dataclass(frozen=True)
class Drift:
    """Of the longest stretch over which the odometry was never lost.

    distance_m : driven there, by the truth; end_m, heading_rad : where the end is off when the
    beginning is right; per_metre : mean error of pieces of one metre over their length, None for
    less than that; scale : told length over true length.
    """

    distance_m: float
    end_m: float
    heading_rad: float
    per_metre: float | None
    scale: float


def drift_of(odometry: Odometry, truth: Trajectory) -> Drift | None:
    """The drift against a true path of the car; None where they share too little time."""
    inside = truth.covers(odometry.t_ns, _MAX_GAP_S)
    lost_before = np.searchsorted(odometry.lost_t_ns, odometry.t_ns)
    best: tuple[float, Floats, Floats] | None = None
    for piece in np.unique(lost_before[inside]):
        rows = np.flatnonzero(inside & (lost_before == piece))
        if rows.size < 2:
            continue
        true = truth.interpolated(odometry.t_ns[rows]).poses
        length = _length(true)
        if best is None or length > best[0]:
            best = length, odometry.pose_odom_base[rows], true
    if best is None or best[0] <= 0.0:
        return None
    length, told, true = best
    off = between(between(true[0], true[-1]), between(told[0], told[-1]))
    return Drift(
        length, float(np.hypot(*off[:2])), float(off[2]), _per_metre(told, true),
        _length(told) / length,
    )  # fmt: skip


def _per_metre(told: Floats, true: Floats) -> float | None:
    """As KITTI's benchmark does it, with pieces of a metre (Geiger, Lenz, Urtasun, 2012)."""
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T)))
    ends = np.searchsorted(way, way + _PIECE_M)
    starts = np.flatnonzero(ends < way.size)
    if not starts.size:
        return None
    ends = ends[starts]
    off = between(between(true[starts], true[ends]), between(told[starts], told[ends]))
    return float((np.hypot(off[:, 0], off[:, 1]) / (way[ends] - way[starts])).mean())


def _length(poses: Floats) -> float:
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())
