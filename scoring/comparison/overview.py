"""Presets side by side: what each algorithm scored in the mean, and what it did in the thesis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dialogue import Cell, Table
from scoring.comparison.compare import Comparison, Summary
from scoring.comparison.records import interval_cells
from scoring.comparison.thesis import MEANS, Means
from scoring.result import ERROR_NAMES

COLUMNS = (
    *("preset", "algorithm", "runs", "failed", "Total [m]", "from", "to"),
    *("missed", "false", "pose [m]"),
    *("thesis Total [m]", "thesis missed", "thesis false", "thesis pose [m]"),
)


def overview(comparisons: Mapping[str, Comparison]) -> Table:
    """A row per preset and algorithm, over all its runs; the thesis' numbers behind them."""
    rows = [
        _row(preset, comparison, algorithm)
        for preset, comparison in comparisons.items()
        for algorithm in comparison.algorithms
    ]
    level = next((c.how.level for c in comparisons.values()), 0.95)
    return Table(
        COLUMNS,
        tuple(rows),
        title="Means over all runs",
        note=f"from, to: {level:.0%} bootstrap interval of the mean Total; missed, false: a run's "
        "landmarks; thesis: F. Caesar, KTH 2019, 26 runs of each algorithm, Totals by Eq. 3.1",
    )


def summary_of(comparison: Comparison, algorithm: str, column: str, group: str = "") -> Summary:
    """The summary of one column; the group is by default all runs together."""
    wanted = (group or comparison.groups[-1], algorithm, column)
    return next(s for s in comparison.summaries if (s.group, s.algorithm, s.column) == wanted)


def landmarks_a_run(comparison: Comparison, algorithm: str, column: str) -> float | None:
    """The mean of `false_negatives` or `false_positives` as a number of landmarks."""
    mean = summary_of(comparison, algorithm, column).mean
    weights = next((r.choices.get("weights") for r in comparison.runs if r.choices), None)
    if mean is None or not isinstance(weights, Sequence):
        return None
    weight = float(weights[ERROR_NAMES.index(column)])
    return mean / weight if weight > 0.0 else None


def thesis_means(algorithm: str, group: str = "all") -> Means | None:
    """What the thesis found, None for an algorithm or a map that it does not have."""
    return MEANS.get(group, {}).get(algorithm)


def _row(preset: str, comparison: Comparison, algorithm: str) -> tuple[Cell, ...]:
    total = summary_of(comparison, algorithm, "total")
    own = [run for run in comparison.runs if run.algorithm == algorithm]
    found = thesis_means(algorithm)
    thesis: tuple[Cell, ...] = (None,) * 4
    if found is not None:
        thesis = (found.weighted["total"], found.missed, found.false, found.weighted["pose"])
    return (
        *(preset, algorithm, total.n, sum(run.missing for run in own)),
        *(total.mean, *interval_cells(total.interval)),
        landmarks_a_run(comparison, algorithm, "false_negatives"),
        landmarks_a_run(comparison, algorithm, "false_positives"),
        summary_of(comparison, algorithm, "pose").mean,
        *thesis,
    )
