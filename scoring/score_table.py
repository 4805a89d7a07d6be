"""Scores as tables: for the eye, for spreadsheets, and pose by pose."""

from __future__ import annotations

import math
from collections.abc import Sequence

from capture import ns_to_stamp
from dialogue import Cell, Table
from geometry import Floats
from scoring.result import ERROR_NAMES, ERROR_UNITS, Alignment, Score
from scoring.score import METRIC_NAMES

SHOWN_METRICS = {
    "ate_rmse": "m",
    "ate_median": "m",
    "rpe_rmse": "m",
    "rpe_rotation_rmse": "rad",
    "heading_rmse_deg": "deg",
    "heading_max_deg": "deg",
    "path_nees": "",
    "ospa": "m",
    "gospa": "m",
    "cola": "",
    "precision": "",
    "recall": "",
    "f1": "",
    "map_rmse": "m",
    "map_nees": "",
}
"""The metrics of the terminal's table with their units; JSON and CSV hold all."""

SERIES = ("estimate", "t_s", "error_m", "along_m", "cross_m", "heading_rad")


def error_table(score: Score, weights: Sequence[float]) -> Table:
    """The six errors, raw and weighted, the Total, and under them the conditions they hold for."""
    rows: list[tuple[Cell, ...]] = [
        (_with_unit(name, ERROR_UNITS[name]), _raw(score, name), weight, score.weighted[name])
        for name, weight in zip(ERROR_NAMES, weights, strict=True)
    ]
    return Table(
        columns=("error", "raw", "weight", "weighted"),
        rows=(*rows, ("Total", None, None, score.total)),
        title=score.name,
        note="\n".join(_conditions(score)),
    )


def overview_table(scores: Sequence[Score]) -> Table:
    """The weighted errors and the Total of several estimates, as the thesis prints them."""
    return Table(
        columns=("estimate", *ERROR_NAMES, "Total"),
        rows=tuple((s.name, *(s.weighted[name] for name in ERROR_NAMES), s.total) for s in scores),
        title="weighted errors",
    )


def metric_table(scores: Sequence[Score]) -> Table:
    """`SHOWN_METRICS` that any score defines, one column per estimate."""
    return Table(
        columns=("metric", *(score.name for score in scores)),
        rows=tuple(
            (_with_unit(name, unit), *(score.metrics[name] for score in scores))
            for name, unit in SHOWN_METRICS.items()
            if any(score.metrics[name] is not None for score in scores)
        ),
    )


def flat_table(scores: Sequence[Score]) -> Table:
    """All numbers of each score in one row, for spreadsheets."""
    counts = list(dict.fromkeys(key for score in scores for key in score.counts))
    weighted = tuple(f"weighted_{name}" for name in ERROR_NAMES)
    return Table(
        columns=("estimate", "total", *ERROR_NAMES, *weighted, *counts, *METRIC_NAMES),
        rows=tuple(
            (
                score.name,
                score.total,
                *(score.errors[name] for name in ERROR_NAMES),
                *(score.weighted[name] for name in ERROR_NAMES),
                *(score.counts.get(key) for key in counts),
                *(score.metrics[name] for name in METRIC_NAMES),
            )
            for score in scores
        ),
    )


def series_table(scores: Sequence[Score]) -> Table:
    """`SERIES` at each paired pose of each score; empty where a column has no meaning."""
    rows: list[tuple[Cell, ...]] = []
    for score in scores:
        if score.path is not None:
            path = score.path
            stamps = [ns_to_stamp(t_ns) for t_ns in path.t_ns.tolist()]
            columns = (path.position_m, path.along_m, path.cross_m, path.heading_rad)
            rows += zip(
                [score.name] * len(stamps), stamps, *(_cells(c) for c in columns), strict=True
            )
    return Table(SERIES, tuple(rows))


def _cells(values: Floats) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values.tolist()]


def _raw(score: Score, name: str) -> Cell:
    """The error, as a whole number where it counts landmarks."""
    value = score.errors[name]
    return value if value is None or ERROR_UNITS[name] else int(value)


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _conditions(score: Score) -> list[str]:
    counts, choices = score.counts, score.choices
    lines = [
        f"poses: {counts['poses']} paired by {choices['sync']}, "
        f"{100 * counts['coverage']:.1f} % of the estimate, {counts['poses_dropped']} dropped, "
        f"offset {choices['offset_s']:g} s",
        f"alignment: {_alignment_text(score.alignment)}",
    ]
    if "pairs" in counts:
        lines.append(
            f"landmarks: {counts['landmarks_true']} true, "
            f"{counts['landmarks_estimated']} estimated, q = {counts['pairs']} pairs "
            f"({choices['pairing']}, c = {choices['cutoff_m']:g} m), "
            f"q' = {counts['distance_pairs']} for the distance error"
        )
    return lines + [f"note: {remark}" for remark in score.remarks]


def _alignment_text(alignment: Alignment) -> str:
    moved = f"{alignment.mode}, x {alignment.x:.3f} m, y {alignment.y:.3f} m"
    if alignment.heading is not None:
        return f"{moved}, heading {math.degrees(alignment.heading):.2f} deg"
    height_m = alignment.matrix[2][3] if alignment.matrix else 0.0
    return f"{moved}, z {height_m:.3f} m, in space (the rotation is in the JSON)"
