"""The one rigid transform that brings path and map of an estimate into the frame of truth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import (
    AlignmentError,
    Floats,
    LandmarkMap,
    SpacePath,
    Trajectory,
    alignment_from_first_pose,
    planar_umeyama,
    transform_points,
    umeyama,
)
from scoring.errors import UndefinedScoreError
from scoring.options import ScoreOptions
from scoring.pairing import pair_landmarks
from scoring.result import Alignment
from scoring.synchronise import PairedPaths

MAX_ROUNDS = 50
"""Rounds of pairing and fitting per cut-off; real maps settle within five."""

REMEDY = "use --align origin or none"


def align_planar(
    paths: PairedPaths[Trajectory],
    truth: LandmarkMap | None,
    estimate: LandmarkMap | None,
    options: ScoreOptions,
) -> Alignment:
    """The pose of the estimate's frame in `world`, by `options.align`; never scale.

    `map` starts from the fit of the paths, pairs the landmarks, fits the pairs and repeats until
    the pairs stay; with fewer than two pairs it begins with a doubled cut-off, as often as needed,
    and halves it again. Ids of landmarks are never used.
    Raises `UndefinedScoreError` when the data do not fix the transform.
    """
    if options.align == "none":
        return Alignment("none", 0.0, 0.0, 0.0)
    if options.align == "origin":
        return _as_alignment("origin", _first_pose(paths), _turns_with_its_path(paths))
    if options.align == "path":
        return _as_alignment("path", _fitted_path(paths), _has_extent(paths, options))
    if truth is None or estimate is None:
        missing = "truth" if truth is None else "estimate"
        raise UndefinedScoreError(f"--align map: the {missing} has no landmarks; {REMEDY} or path")
    try:
        start = _fitted_path(paths)
    except UndefinedScoreError:
        start = _first_pose(paths)
    pose = _fitted_map(start, truth.positions, estimate.positions, options)
    return _as_alignment("map", pose, observed=True)


def align_space(paths: PairedPaths[SpacePath], options: ScoreOptions) -> Alignment:
    """The same for paths in space, by `origin`, `none` or `path`; the 4 x 4 `matrix` is set."""
    rotation, translation = np.eye(3), np.zeros(3)
    if options.align == "origin":
        rotation = paths.truth.rotations[0] @ paths.estimate.rotations[0].T
        translation = paths.truth.positions[0] - rotation @ paths.estimate.positions[0]
    elif options.align == "path":
        try:
            rotation, translation = umeyama(paths.estimate.positions, paths.truth.positions)
        except AlignmentError as err:
            raise UndefinedScoreError(f"--align path: {err}") from err
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    rows = tuple(tuple(float(value) for value in row) for row in matrix)
    return Alignment(
        options.align, float(translation[0]), float(translation[1]), heading=None, matrix=rows
    )


def pose_of(alignment: Alignment) -> Floats:
    """(3,): x, y, heading of the estimate's frame in `world`."""
    return np.array([alignment.x, alignment.y, alignment.heading or 0.0])


def _as_alignment(mode: str, pose: Floats, observed: bool) -> Alignment:
    return Alignment(mode, float(pose[0]), float(pose[1]), float(pose[2]), observed)


def _first_pose(paths: PairedPaths[Trajectory]) -> Floats:
    return alignment_from_first_pose(paths.estimate.poses[0], paths.truth.poses[0])


def _fitted_path(paths: PairedPaths[Trajectory]) -> Floats:
    try:
        return planar_umeyama(paths.estimate.positions, paths.truth.positions)
    except AlignmentError as err:
        raise UndefinedScoreError(f"--align path: {err}") from err


def _turns_with_its_path(paths: PairedPaths[Trajectory]) -> bool:
    """False where a path bends while its heading stays exactly the same: a position-only file."""
    return not any(
        np.ptp(path.heading) == 0.0 and _bends(path.positions)
        for path in (paths.truth, paths.estimate)
    )


def _bends(positions: Floats) -> bool:
    return bool(np.linalg.matrix_rank(positions - positions.mean(axis=0), tol=1e-6) > 1)


def _has_extent(paths: PairedPaths[Trajectory], options: ScoreOptions) -> bool:
    """Whether the car left its place: the fit of a parked car turns with the noise."""
    offsets = paths.truth.positions - paths.truth.positions[0]
    return bool(np.hypot(offsets[:, 0], offsets[:, 1]).max() > options.move_threshold_m)


def _fitted_map(start: Floats, truth: Floats, estimate: Floats, options: ScoreOptions) -> Floats:
    if min(truth.shape[0], estimate.shape[0]) < 2:
        raise UndefinedScoreError(
            f"--align map needs two landmarks on both sides, truth has {truth.shape[0]} and the "
            f"estimate {estimate.shape[0]}; {REMEDY} or path"
        )
    pose = start
    for cutoff_m in _shrinking_cutoffs(start, truth, estimate, options):
        pose = _iterated(pose, truth, estimate, options.pairing, cutoff_m)
    return pose


def _shrinking_cutoffs(
    pose: Floats, truth: Floats, estimate: Floats, options: ScoreOptions
) -> list[float]:
    """c, or from the first doubled c that gives two pairs down to c."""
    cutoffs = [options.cutoff_m]
    # Every landmark is in reach of every other once the cut-off passes all distances.
    placed = transform_points(pose, estimate)
    reach_m = float(np.ptp(np.vstack([truth, placed]), axis=0).sum())
    while cutoffs[-1] < reach_m and (
        len(pair_landmarks(truth, placed, options.pairing, cutoffs[-1])) < 2
    ):
        cutoffs.append(2.0 * cutoffs[-1])
    return cutoffs[::-1]


def _iterated(pose: Floats, truth: Floats, estimate: Floats, rule: str, cutoff_m: float) -> Floats:
    last: npt.NDArray[np.int64] | None = None
    for _ in range(MAX_ROUNDS):
        pairs = pair_landmarks(truth, transform_points(pose, estimate), rule, cutoff_m)
        if len(pairs) < 2:
            raise UndefinedScoreError(
                f"--align map: fewer than two landmarks come within {cutoff_m:g} m of true ones "
                f"together; {REMEDY} or path, or a larger --cutoff"
            )
        now = np.stack([pairs.rows, pairs.columns])
        if last is not None and np.array_equal(now, last):
            break
        last = now
        try:
            pose = planar_umeyama(estimate[pairs.columns], truth[pairs.rows])
        except AlignmentError as err:
            raise UndefinedScoreError(f"--align map: {err}") from err
    return pose
