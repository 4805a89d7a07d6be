"""The sixth error: how late, in metres, landmarks entered the map (thesis section 3.1.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from capture import NO_STAMP, EstimatedMap
from geometry import Floats, LandmarkMap, Stamps, Trajectory
from scoring.assignment import NearPairs
from scoring.options import ScoreOptions


@dataclass(frozen=True)
class DistanceError:
    """Mean shortfall in metres over `counted` landmarks; None with the reason where undefined."""

    value: float | None
    counted: int
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Scene:
    """Truth and estimate in one frame: whole paths, both maps."""

    true_path: Trajectory
    true_map: LandmarkMap
    path: Trajectory
    map: EstimatedMap


def distance_error(scene: Scene, pairs: NearPairs, options: ScoreOptions) -> DistanceError:
    """Mean of g(l) = max(d - l, 0) over the paired landmarks, l from car to landmark at adding.

    Eq. 3.7, whose printed condition says the same (d - l if d > l, else 0; Fig. 3.4). Landmarks
    added before the car moved do not count, nor those whose adding is unknown.
    """
    column = "t_added" if options.distance_time == "added" else "t_first"
    stamps = scene.map.t_added_ns if column == "t_added" else scene.map.t_first_ns
    if stamps is None:
        return DistanceError(None, 0, (f"distance undefined: the map has no column {column}",))
    moved_ns = first_motion_ns(scene.true_path, options.move_threshold_m)
    if moved_ns is None:
        reason = f"the truth never moves more than {options.move_threshold_m:g} m"
        return DistanceError(None, 0, (f"distance undefined: {reason}",))
    t_ns = stamps[pairs.columns]
    length_m = _lengths(scene, pairs, t_ns, options)
    if length_m is None:
        return DistanceError(None, 0, ("distance undefined: the map has no column range_added",))
    known = (t_ns != NO_STAMP) & np.isfinite(length_m)
    counted = known & (t_ns > moved_ns)
    unknown = int(known.size - known.sum())
    remarks = [f"distance: {unknown} paired landmarks of unknown adding left out"] * bool(unknown)
    if not counted.any():
        reason = "distance undefined: no paired landmark was added after the car moved"
        return DistanceError(None, 0, (*remarks, reason))
    shortfall_m = np.maximum(options.detection_range_m - length_m[counted], 0.0)
    return DistanceError(float(shortfall_m.mean()), int(counted.sum()), tuple(remarks))


def first_motion_ns(path: Trajectory, threshold_m: float) -> int | None:
    """When the car is first farther than `threshold_m` from its start; None if it never is."""
    away = np.hypot(path.x - path.x[0], path.y - path.y[0]) > threshold_m
    return int(path.t_ns[np.argmax(away)]) if away.any() else None


def _lengths(scene: Scene, pairs: NearPairs, t_ns: Stamps, options: ScoreOptions) -> Floats | None:
    """Car to landmark of each pair in metres, NaN where unknown; None without the column."""
    estimate = scene.map
    if options.distance_at == "add":
        return None if estimate.range_added_m is None else estimate.range_added_m[pairs.columns]
    if options.distance_at == "truth":
        landmarks = scene.true_map.positions[pairs.rows]
        car = _positions_at(scene.true_path, t_ns, options)
    else:
        landmarks = estimate.landmarks.positions[pairs.columns]
        car = _positions_at(scene.path, t_ns, options)
        if estimate.added_from is not None and options.distance_time == "added":
            # Where the car was believed to be at that moment, not where a smoother put it later.
            believed = estimate.added_from[pairs.columns]
            car = np.where(np.isfinite(believed), believed, car)
    return np.hypot(car[:, 0] - landmarks[:, 0], car[:, 1] - landmarks[:, 1])


def _positions_at(path: Trajectory, t_ns: Stamps, options: ScoreOptions) -> Floats:
    """(k, 2), NaN where the path has no pose near that time."""
    covered = path.covers(t_ns, options.max_gap_s)
    positions = np.full((t_ns.size, 2), np.nan)
    if covered.any():
        # Landmarks may share a stamp, poses may not.
        unique_ns, back = np.unique(t_ns[covered], return_inverse=True)
        positions[covered] = path.interpolated(unique_ns).positions[back]
    return positions
