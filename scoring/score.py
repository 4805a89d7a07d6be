"""One estimate against the truth: pair in time, align, pair the maps, measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from capture import Estimate, GroundTruth
from dialogue import UsageError
from geometry import Floats, SpacePath, Trajectory
from scoring.alignment import align_planar, align_space, pose_of
from scoring.distance_error import Scene, distance_error
from scoring.map_metrics import MAP_METRICS, map_metrics
from scoring.multi_error import landmark_errors, path_errors, weigh
from scoring.options import ScoreOptions
from scoring.pairing import pair_landmarks
from scoring.path_metrics import (
    STATISTICS,
    PosedPath,
    consistency,
    heading_metrics,
    normalised_squares,
    planar_errors,
    relative_metrics,
    space_errors,
    statistics,
)
from scoring.placement import in_frame, on_clock, shifted_stamps
from scoring.result import Alignment, MapErrors, PathErrors, Score
from scoring.synchronise import PairedPaths, Rows, synchronise

METRIC_NAMES = (
    *(f"{prefix}_{name}" for prefix in ("ate", "rpe", "rpe_rotation") for name in STATISTICS),
    *(f"heading_{name}{unit}" for unit in ("", "_deg") for name in ("rmse", "mean", "max")),
    "path_nees",
    "path_nees_within",
    *MAP_METRICS,
)
"""Keys of `Score.metrics`, always all of them; None where undefined."""

WELL_SPANNED = 0.9
"""A path that spans less of the truth's time than this gets a remark."""


def score(truth: GroundTruth, estimate: Estimate, options: ScoreOptions | None = None) -> Score:
    """The score of a planar path and, where both sides have one, its map.

    Raises `TooFewPosesError` and `UndefinedScoreError`. Without landmarks on one side the four
    landmark errors are None and a remark says why.
    """
    options = options or ScoreOptions()
    if options.space != "2d":
        raise UsageError("--space 3d is for paths without a map: use score_space()")
    shifted = on_clock(estimate, options.offset_s)
    paths = synchronise(truth.path, shifted.path, options)
    true_map = truth.landmarks
    own_map = None if shifted.map is None else shifted.map.landmarks
    alignment = align_planar(paths, true_map, own_map, options)
    aligned = in_frame(shifted, pose_of(alignment))
    own_path = paths.estimate.transformed(pose_of(alignment))
    errors = planar_errors(paths.truth, own_path)
    pieces = [
        _path_part(PosedPath.planar(paths.truth), PosedPath.planar(own_path), errors, options),
        _path_consistency(errors, paths.rows, aligned),
        _map_part(truth, aligned, options),
    ]
    return _assembled(
        estimate.name,
        paths,
        alignment,
        pieces,
        options,
        path=errors,
        true_path=truth.path.positions,
        provenance=estimate.provenance,
    )


def score_space(
    truth: SpacePath, estimate: SpacePath, name: str, options: ScoreOptions | None = None
) -> Score:
    """The score of a path in space: pose, maximum pose and path metrics, no map.

    Raises `TooFewPosesError` and `UndefinedScoreError`.
    """
    options = options or ScoreOptions(space="3d")
    if options.space != "3d":
        raise UsageError("--space 2d is for paths on a floor: use score()")
    t_ns = shifted_stamps(estimate.t_ns, options.offset_s)
    shifted = SpacePath(t_ns, estimate.positions, estimate.quaternions)
    paths = synchronise(truth, shifted, options)
    alignment = align_space(paths, options)
    matrix = np.array(alignment.matrix)
    rotation, translation = matrix[:3, :3], matrix[:3, 3]
    posed_truth = PosedPath(paths.truth.t_ns, paths.truth.positions, paths.truth.rotations)
    aligned = PosedPath(
        paths.truth.t_ns,
        paths.estimate.positions @ rotation.T + translation,
        rotation @ paths.estimate.rotations,
    )
    errors = space_errors(posed_truth, aligned)
    pieces = [
        _path_part(posed_truth, aligned, errors, options),
        _Piece(remarks=("a path in space has no map: landmark errors are undefined",)),
    ]
    return _assembled(
        name, paths, alignment, pieces, options, path=errors, true_path=truth.positions
    )


@dataclass(frozen=True, eq=False)
class _Piece:
    """What one part of the comparison adds to the score."""

    errors: Mapping[str, float | None] = field(default_factory=dict)
    metrics: Mapping[str, float | None] = field(default_factory=dict)
    counts: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    map: MapErrors | None = None


def _path_part(
    truth: PosedPath, estimate: PosedPath, errors: PathErrors, options: ScoreOptions
) -> _Piece:
    metrics = {
        **statistics("ate", errors.position_m),
        **heading_metrics(errors.heading_rad),
        **relative_metrics(truth, estimate, options),
    }
    remarks: tuple[str, ...] = ()
    if metrics["rpe_rmse"] is None:
        step = f"{options.rpe_delta:g} {options.rpe_unit}"
        remarks = (f"relative pose error undefined: the path is shorter than one step of {step}",)
    return _Piece(path_errors(errors.position_m), metrics, remarks=remarks)


def _path_consistency(errors: PathErrors, rows: Rows, aligned: Estimate) -> _Piece:
    if aligned.path_covariances is None:
        return _Piece()
    error = np.column_stack([errors.estimate - errors.truth, errors.heading_rad])
    nees = normalised_squares(error, aligned.path_covariances[rows])
    left_out = rows.size - nees.size
    remarks = (
        f"path NEES leaves out {left_out} of {rows.size} poses: their covariance is singular",
    ) * bool(left_out)
    return _Piece(metrics=consistency("path", nees, degrees=3), remarks=remarks)


def _map_part(truth: GroundTruth, aligned: Estimate, options: ScoreOptions) -> _Piece:
    true_map, own = truth.landmarks, aligned.map
    if true_map is None or own is None:
        side = "the truth has no landmarks" if true_map is None else "the estimate has no map"
        return _Piece(remarks=(f"landmark errors undefined: {side}",))
    pairs = pair_landmarks(
        true_map.positions, own.landmarks.positions, options.pairing, options.cutoff_m
    )
    distance = distance_error(Scene(truth.path, true_map, aligned.path, own), pairs, options)
    remarks = distance.remarks
    if not len(pairs):
        remarks = (f"map and distance undefined: no landmarks within {options.cutoff_m:g} m",)
    return _Piece(
        landmark_errors(pairs, len(true_map), len(own), distance),
        map_metrics(true_map, own.landmarks, pairs, options),
        {
            "pairs": len(pairs),
            "distance_pairs": distance.counted,
            "landmarks_true": len(true_map),
            "landmarks_estimated": len(own),
        },
        remarks,
        MapErrors(
            true_map,
            own.landmarks,
            np.column_stack([pairs.rows, pairs.columns]),
            pairs.distance_m,
            options.cutoff_m,
        ),
    )


def _assembled(
    name: str,
    paths: PairedPaths[Trajectory] | PairedPaths[SpacePath],
    alignment: Alignment,
    pieces: list[_Piece],
    options: ScoreOptions,
    *,
    path: PathErrors,
    true_path: Floats,
    provenance: Mapping[str, object] | None = None,
) -> Score:
    result = weigh({k: v for piece in pieces for k, v in piece.errors.items()}, options)
    metrics = {k: v for piece in pieces for k, v in piece.metrics.items()}
    counts: dict[str, float] = {
        "poses": len(paths.truth),
        "poses_dropped": paths.dropped,
        "coverage": paths.coverage,
        "span": paths.span,
    }
    for piece in pieces:
        counts |= piece.counts
    return Score(
        name=name,
        total=result.total,
        errors=result.errors,
        weighted=result.weighted,
        counts=counts,
        metrics={key: metrics.get(key) for key in METRIC_NAMES},
        alignment=alignment,
        choices=options.choices(),
        provenance=provenance or {},
        remarks=(
            *_pairing_remarks(paths, alignment),
            *(remark for piece in pieces for remark in piece.remarks),
            *result.remarks,
        ),
        path=path,
        map=next((piece.map for piece in pieces if piece.map is not None), None),
        true_path=true_path,
    )


def _pairing_remarks(
    paths: PairedPaths[Trajectory] | PairedPaths[SpacePath], alignment: Alignment
) -> list[str]:
    remarks = []
    if paths.dropped:
        remarks.append(f"{paths.dropped} of {paths.given} poses have no true pose at their time")
    if paths.span < WELL_SPANNED:
        remarks.append(f"the estimate spans {100 * paths.span:.0f} % of the truth's time only")
    if not alignment.heading_observed:
        remedy = "--align path" if alignment.mode == "origin" else "--align origin or none"
        remarks.append(f"the heading of the alignment is not observed by these data: {remedy}")
    return remarks
