"""The report of one session: one HTML file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from dialogue import Cell, Table
from dialogue.pages import SERIES, render, view
from scoring.report.curves import distribution_svg, heading_svg, position_svg, track_svg
from scoring.report.scene import overlay_svg, scene_svg
from scoring.result import ERROR_NAMES, ERROR_UNITS, MapErrors, Score

TEMPLATE = Path(__file__).parent / "templates" / "score.html"

TERMS: Mapping[str, tuple[str, str]] = {
    "pose": ("pose", "mean distance of the path to the truth"),
    "max_pose": ("maximum pose", "largest distance of the path to the truth"),
    "map": ("map", "mean distance of paired landmarks"),
    "false_negatives": ("missed", "true landmarks without an estimate"),
    "false_positives": ("false", "estimated landmarks without a true one"),
    "distance": ("distance", "how much too late landmarks were added"),
}
"""The six errors of Eq. 3.1: name and meaning."""

FAMILIES: Mapping[str, str] = {
    "ate": "position [m]",
    "rpe": "relative position [m]",
    "rpe_rotation": "relative rotation [rad]",
    "heading": "heading [rad]",
}
"""Metrics that come as statistics of one quantity, by the prefix of their names."""

STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "sse")
"""How those end; the last, a sum over all poses, is for programs only."""

METRICS: Mapping[str, str] = {
    "heading_rmse_deg": "heading, rmse [deg]",
    "heading_mean_deg": "heading, mean [deg]",
    "heading_max_deg": "heading, largest [deg]",
    "path_nees": "path NEES, mean (3 if consistent)",
    "path_nees_within": "path NEES within 95 % bound, share",
    "ospa": "OSPA [m]",
    "cola": "COLA, equivalent missing landmarks",
    "gospa": "GOSPA [m]",
    "gospa_localisation": "GOSPA, localisation part",
    "gospa_missed": "GOSPA, missed part",
    "gospa_false": "GOSPA, false part",
    "missed_share": "missed per true landmark",
    "map_rmse": "map, rmse of pairs [m]",
    "map_nees": "map NEES, mean (2 if consistent)",
    "map_nees_within": "map NEES within 95 % bound, share",
}
"""What a reader calls a metric; others keep the name they have in the JSON."""

FORMULAS: Mapping[object, str] = {
    "eq-3.1": "Eq. 3.1",
    "thesis-print": "as the thesis printed it: pose error twice, no map error",
}

COMPARED = ("ate_rmse", "heading_rmse_deg", "gospa")
LARGER_IS_BETTER = ("precision", "recall", "f1")


def write_report(path: Path, scores: Sequence[Score], title: str, subtitle: str = "") -> None:
    """Write one self-contained HTML file on the scores of one session, in their order.

    The same scores give the same bytes. Replaces `path` in one step; raises `LogError` when the
    disk does not take it, `ValueError` without a score.
    """
    if not scores:
        raise ValueError("a report needs at least one score")
    from capture import write_text

    page = render(
        TEMPLATE,
        title=title,
        subtitle=subtitle,
        overview=_overview(scores) if len(scores) > 1 else None,
        estimates=[_estimate(scores, index) for index in range(len(scores))],
    )
    write_text(path, page)


def _overview(scores: Sequence[Score]) -> dict[str, object]:
    with_path = any(score.path is not None for score in scores)
    return {
        "series": [(SERIES[i % len(SERIES)], score.name) for i, score in enumerate(scores)],
        "scene": overlay_svg(scores),
        "curves": [position_svg(scores), distribution_svg(scores)] if with_path else [],
        "table": _side_by_side(scores),
    }


def _side_by_side(scores: Sequence[Score]) -> dict[str, object]:
    """Total, weighted errors and a few metrics, an estimate per column, the best of each row."""
    lines: list[tuple[str, list[float | None]]] = [("Total [m]", [s.total for s in scores])]
    for name in ERROR_NAMES:
        lines.append((f"{TERMS[name][0]} [m]", [s.weighted.get(name) for s in scores]))
    for name in (*COMPARED, *LARGER_IS_BETTER):
        values = [s.metrics.get(name) for s in scores]
        if any(value is not None for value in values):
            label = "position, rmse [m]" if name == "ate_rmse" else METRICS.get(name, name)
            lines.append((label, values))
    best = [_best(values, max if label in LARGER_IS_BETTER else min) for label, values in lines]
    note = "errors weighted; bold: best of the row"
    if len({tuple(s.weighted.get(name) is None for name in ERROR_NAMES) for s in scores}) > 1:
        # An undefined part adds nothing, so the emptier estimate would win.
        best[0] = [False] * len(scores)
        note += "; Totals with different undefined parts do not compare"
    rows = tuple((label, *values) for label, values in lines)
    return {**view(Table(("", *_distinct(scores)), rows, note=note)), "best": best}


def _best(values: Sequence[float | None], goal: Callable[[list[float]], float]) -> list[bool]:
    known = [value for value in values if value is not None]
    return [bool(known) and value == goal(known) for value in values]


def _distinct(scores: Sequence[Score]) -> list[str]:
    """Names as column headings: one that comes twice gets its place behind it."""
    names = [score.name for score in scores]
    return [name if names.count(name) == 1 else f"{name} ({i})" for i, name in enumerate(names, 1)]


def _estimate(scores: Sequence[Score], index: int) -> dict[str, object]:
    score = scores[index]
    curves: list[str | None] = []
    if score.path is not None:
        curves = [
            position_svg(scores, index),
            track_svg(scores, index),
            heading_svg(scores, index),
            distribution_svg(scores, index),
        ]
    return {
        "name": score.name,
        "colour": SERIES[index % len(SERIES)],
        "total": score.total,
        "formula": FORMULAS.get(score.choices.get("total_formula"), "weighted sum"),
        "terms": _terms(score),
        "facts": _facts(score),
        "remarks": score.remarks,
        "scene": scene_svg(score, index),
        "landmarks": None if score.map is None else _landmark_counts(score.map),
        "curves": [curve for curve in curves if curve],
        "tables": [view(table) for table in _tables(score)],
    }


def _terms(score: Score) -> list[dict[str, object]]:
    weights = score.choices.get("weights")
    given = weights if isinstance(weights, list | tuple) else [None] * len(ERROR_NAMES)
    largest = max([w for w in score.weighted.values() if w is not None], default=0.0)
    terms: list[dict[str, object]] = []
    for name, weight in zip(ERROR_NAMES, given, strict=True):
        weighted = score.weighted.get(name)
        terms.append(
            {
                "name": TERMS[name][0],
                "meaning": TERMS[name][1],
                "raw": score.errors.get(name),
                "unit": ERROR_UNITS[name],
                "weight": weight,
                "weighted": weighted,
                "share": 100.0 * weighted / largest if weighted and largest > 0 else 0.0,
            }
        )
    return terms


def _facts(score: Score) -> list[str]:
    """What the numbers rest on, in a line each."""
    counts, choices, at = score.counts, score.choices, score.alignment
    facts = []
    if "poses" in counts:
        share = f", {100 * counts['coverage']:.1f} % of the estimate" * ("coverage" in counts)
        facts.append(f"{counts['poses']:g} poses paired{share}")
    if "pairs" in counts:
        facts.append(
            f"{counts['pairs']:g} of {counts['landmarks_true']:g} landmarks found, "
            f"{counts['landmarks_estimated'] - counts['pairs']:g} false, "
            f"pairing {choices.get('pairing', 'unknown')}"
        )
    turned = "" if at.heading is None else f", {at.heading:.4f} rad"
    facts.append(f"aligned by {at.mode}: {at.x:.3f} m, {at.y:.3f} m{turned}")
    return facts


def _landmark_counts(landmarks: MapErrors) -> dict[str, float]:
    return {
        "pairs": len(landmarks.pairs),
        "missed": len(landmarks.missed),
        "false": len(landmarks.false),
        "cutoff_m": landmarks.cutoff_m,
    }


def _tables(score: Score) -> list[Table]:
    tables = [_statistics_table(score), _metric_table(score)]
    if score.map is not None:
        tables.append(_landmark_table(score.map))
    choices = tuple((name, _words(value)) for name, value in sorted(score.choices.items()))
    tables.append(Table(("choice", "value"), choices, title="Choices of the score"))
    tables.append(Table(("what", "value"), tuple(_flat(score.provenance)), title="The estimate"))
    return [table for table in tables if table.rows]


def _statistics_table(score: Score) -> Table:
    shown = STATISTICS[:-1]
    rows = [
        (label, *(score.metrics.get(f"{family}_{name}") for name in shown))
        for family, label in FAMILIES.items()
    ]
    defined = tuple(row for row in rows if any(value is not None for value in row[1:]))
    return Table(("error", *shown), defined, title="Path", digits=4)


def _metric_table(score: Score) -> Table:
    in_families = {f"{family}_{name}" for family in FAMILIES for name in STATISTICS}
    rows = tuple(
        (METRICS.get(name, name), value)
        for name, value in score.metrics.items()
        if name not in in_families and value is not None
    )
    return Table(("metric", "value"), rows, title="Metrics")


def _landmark_table(landmarks: MapErrors) -> Table:
    """Every landmark of both maps, by id, and how far the pairs are apart."""
    true, own = landmarks.truth, landmarks.estimate
    rows: list[tuple[Cell, ...]] = [
        (int(true.ids[row]), int(own.ids[column]), float(distance), "paired")
        for (row, column), distance in zip(landmarks.pairs, landmarks.distance_m, strict=True)
    ]
    rows += [(int(true.ids[row]), None, None, "missed") for row in landmarks.missed]
    rows += [(None, int(own.ids[row]), None, "false") for row in landmarks.false]
    columns = ("true id", "estimated id", "distance [m]", "verdict")
    return Table(columns, tuple(rows), title="Landmarks")


def _flat(values: Mapping[str, object], prefix: str = "") -> list[tuple[Cell, ...]]:
    """Nested settings as rows of dotted name and value."""
    rows: list[tuple[Cell, ...]] = []
    for name, value in values.items():
        if isinstance(value, Mapping):
            rows += _flat(value, f"{prefix}{name}.")
        else:
            rows.append((f"{prefix}{name}", _words(value)))
    return rows


def _words(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, sort_keys=True, default=str)
