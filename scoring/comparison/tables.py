"""A comparison as the tables of the thesis, for the eye."""

from __future__ import annotations

from collections.abc import Mapping

from dialogue import Cell, Table
from scoring.comparison.compare import Comparison, Summary, members
from scoring.comparison.records import (
    contrast_cells,
    correlation_rows,
    error_cells,
    interval_cells,
)
from scoring.comparison.runs import COLUMNS, Run
from scoring.comparison.thesis import check_totals

HEADINGS: Mapping[str, str] = {
    "pose": "pose",
    "max_pose": "max pose",
    "map": "map",
    "false_negatives": "missed",
    "false_positives": "false",
    "distance": "distance",
    "total": "Total",
}
"""The columns as a reader sees them; all are weighted errors in metres."""


def thesis_tables(comparison: Comparison) -> tuple[Table, ...]:
    """What the thesis prints, and how far to trust it.

    One table per group and algorithm (4.2, 4.3 ...), the ratios (4.4, 4.7, 4.10) with intervals and
    p values, the correlations of pose error and Total, and where the two rank differently.
    """
    tables = [
        run_table(comparison, group, algorithm)
        for group in comparison.groups
        for algorithm in comparison.algorithms
        if group != comparison.groups[-1] or len(comparison.groups) == 1
    ]
    if comparison.contrasts:
        tables += [_ratio_table(comparison), _contrast_table(comparison)]
    return (*tables, _correlation_table(comparison), *_ranking_tables(comparison))


def total_tables(comparison: Comparison) -> tuple[Table, ...]:
    """Whether the Totals are what a formula gives: a count per table, and each that fits none."""
    checks = check_totals(comparison.runs)
    places = list(dict.fromkeys((check.run.map, check.run.algorithm) for check in checks))
    rows: list[tuple[Cell, ...]] = []
    for name_of_map, algorithm in places:
        own = [c for c in checks if (c.run.map, c.run.algorithm) == (name_of_map, algorithm)]
        fits = (sum(c.fits_equation for c in own), sum(c.fits_print for c in own))
        rows.append((name_of_map, algorithm, len(own), *fits))
    sums = (len(checks), sum(c.fits_equation for c in checks), sum(c.fits_print for c in checks))
    rows.append(("all", "", *sums))
    odd = tuple(
        (c.run.map, c.run.algorithm, c.run.dataset, c.given, c.equation, c.printed)
        for c in checks
        if not (c.fits_equation or c.fits_print)
    )
    formulas = ("Eq. 3.1", "2 pose, no map")
    counted = Table(
        ("map", "algorithm", "Totals", *formulas),
        tuple(rows),
        title="Totals that a formula gives to within 0.003 m",
    )
    unexplained = Table(
        ("map", "algorithm", "dataset", "Total", *formulas),
        odd,
        title="Totals that no formula gives [m]",
    )
    return (counted, unexplained) if odd else (counted,)


def run_table(comparison: Comparison, group: str, algorithm: str) -> Table:
    """Every error of every data set of one algorithm in one group: as Table 4.2 of the thesis."""
    runs = [
        run
        for run in members(comparison.runs, comparison.group_by, group)
        if run.algorithm == algorithm
    ]
    rows = [(_row_name(run, comparison), *error_cells(run)) for run in runs]
    own = [s for s in comparison.summaries if (s.group, s.algorithm) == (group, algorithm)]
    counts = [f"{sum(run.missing for run in runs)} missing"] * any(run.missing for run in runs)
    counts += [f"{s.undefined} without {HEADINGS[s.column]}" for s in own if s.undefined]
    return Table(
        ("dataset", *HEADINGS.values()),
        (*rows, *_summary_rows(own, comparison.how.level)),
        title=f"{group}: {algorithm}, weighted errors [m]",
        note=f"left out: {', '.join(counts)}" if counts else "",
    )


def _summary_rows(own: list[Summary], level: float) -> tuple[tuple[Cell, ...], ...]:
    ends = [interval_cells(summary.interval) for summary in own]
    return (
        ("mean", *(summary.mean for summary in own)),
        ("std", *(summary.std for summary in own)),
        (f"{level:.0%} from", *(low for low, _ in ends)),
        (f"{level:.0%} to", *(high for _, high in ends)),
    )


def _row_name(run: Run, comparison: Comparison) -> str:
    """The data set, without what the group says already."""
    if comparison.group_by == "power":
        return f"{run.map} {run.trial}".strip()
    return run.dataset if comparison.group_by == "map" else f"{run.map} {run.dataset}"


def _ratio_table(comparison: Comparison) -> Table:
    ratios = {(c.group, c.algorithm, c.column): c.ratio for c in comparison.contrasts}
    places = dict.fromkeys((c.group, c.algorithm) for c in comparison.contrasts)
    return Table(
        ("group", "algorithm", *HEADINGS.values()),
        tuple(
            (group, algorithm, *(ratios[group, algorithm, column] for column in COLUMNS))
            for group, algorithm in places
        ),
        title=f"Ratio of the means to {comparison.baseline}",
    )


def _contrast_table(comparison: Comparison) -> Table:
    level = f"{comparison.how.level:.0%}"
    return Table(
        (
            *("group", "algorithm", "error", "n", "mean [m]", "baseline [m]"),
            *("ratio", f"{level} from", f"{level} to", "p"),
        ),
        tuple(
            (c.group, c.algorithm, HEADINGS[c.column], *contrast_cells(c))
            for c in comparison.contrasts
        ),
        title=f"Against {comparison.baseline}, over the data sets of both",
        digits=4,
        note="p: paired sign-flip test, not corrected for the number of rows. "
        "With fewer than ten data sets the intervals are somewhat too narrow.",
    )


def _correlation_table(comparison: Comparison) -> Table:
    return Table(
        ("group", "algorithm", "n", "Pearson", "r from", "r to", "Spearman", "rho from", "rho to"),
        correlation_rows(comparison),
        title=f"Correlation of pose error and Total, {comparison.how.level:.0%} intervals",
    )


def _ranking_tables(comparison: Comparison) -> tuple[Table, ...]:
    if not comparison.rankings:
        return ()
    odd = [r for r in comparison.rankings if r.disagrees]
    rows = tuple(
        (r.map, r.dataset, ", ".join(r.lowest_pose), ", ".join(r.lowest_total)) for r in odd
    )
    return (
        Table(
            ("map", "dataset", "lowest pose error", "lowest Total"),
            rows,
            title="Where pose error and Total name different winners: "
            f"{len(odd)} of {len(comparison.rankings)} data sets",
        ),
    )
