"""A comparison for programs: long tables, one figure per row; lengths in metres."""

from __future__ import annotations

from dialogue import Cell, Table
from scoring.comparison.compare import Comparison, Contrast, Summary
from scoring.comparison.runs import COLUMNS, Run
from scoring.comparison.statistics import Interval

RUNS = ("map", "dataset", "algorithm", *(f"{column}_m" for column in COLUMNS))

SUMMARIES = (
    *("group", "algorithm", "error", "n", "undefined"),
    *("mean_m", "std_m", "low_m", "high_m"),
)

CONTRASTS = (
    *("group", "algorithm", "error", "n", "mean_m", "baseline_mean_m"),
    *("ratio", "ratio_low", "ratio_high", "p"),
)

CORRELATIONS = (
    *("group", "algorithm", "n", "pearson", "pearson_low", "pearson_high"),
    *("spearman", "spearman_low", "spearman_high"),
)

RANKINGS = ("map", "dataset", "lowest_pose", "lowest_total", "disagrees")


def long_tables(comparison: Comparison) -> dict[str, Table]:
    """The tables by the name that json gives them; low and high are ends of intervals."""
    c = comparison
    return {
        "runs": Table(
            RUNS, tuple((r.map, r.dataset, r.algorithm, *error_cells(r)) for r in c.runs)
        ),
        "summaries": Table(
            SUMMARIES,
            tuple((s.group, s.algorithm, s.column, *_summary_cells(s)) for s in c.summaries),
        ),
        "contrasts": Table(
            CONTRASTS,
            tuple((x.group, x.algorithm, x.column, *contrast_cells(x)) for x in c.contrasts),
        ),
        "correlations": Table(CORRELATIONS, correlation_rows(c)),
        "rankings": Table(RANKINGS, _ranking_rows(c)),
    }


def error_cells(run: Run) -> tuple[float | None, ...]:
    """The weighted errors and the Total, in the order of `COLUMNS`."""
    return tuple(run.weighted[column] for column in COLUMNS)


def _summary_cells(summary: Summary) -> tuple[Cell, ...]:
    s = summary
    return (s.n, s.undefined, s.mean, s.std, *interval_cells(s.interval))


def contrast_cells(contrast: Contrast) -> tuple[Cell, ...]:
    """The cells of `CONTRASTS` behind the names."""
    c = contrast
    return (c.n, c.mean, c.baseline_mean, c.ratio, *interval_cells(c.interval), c.p_value)


def correlation_rows(comparison: Comparison) -> tuple[tuple[Cell, ...], ...]:
    """The rows of `CORRELATIONS`."""
    return tuple(
        (
            *(c.group, c.algorithm, c.n, c.pearson, *interval_cells(c.pearson_interval)),
            *(c.spearman, *interval_cells(c.spearman_interval)),
        )
        for c in comparison.correlations
    )


def interval_cells(interval: Interval | None) -> tuple[float | None, float | None]:
    """Both ends, None where there is no interval."""
    return (None, None) if interval is None else (interval.low, interval.high)


def _ranking_rows(comparison: Comparison) -> tuple[tuple[Cell, ...], ...]:
    return tuple(
        (r.map, r.dataset, " ".join(r.lowest_pose), " ".join(r.lowest_total), int(r.disagrees))
        for r in comparison.rankings
    )
