"""The tables of a campaign, the thesis' own numbers beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from dialogue import Cell, Table
from scoring.comparison import Comparison
from scoring.comparison.hypothesis import (
    Corrected,
    corrected_contrasts,
    disagreement,
    effects,
)
from scoring.comparison.overview import thesis_means
from scoring.comparison.records import contrast_cells, correlation_rows, interval_cells
from scoring.comparison.runs import COLUMNS
from scoring.comparison.tables import HEADINGS, run_table
from scoring.comparison.thesis import (
    DATASETS,
    PEARSON,
    PLACES,
    POSE_COUNTS_FALSE_RANKS,
    PRINTED_RATIOS,
    map_name,
)


def run_tables(comparison: Comparison, group: str) -> list[Table]:
    """Every error of every data set of one map, a table per algorithm: as 4.2 and 4.3.

    The last row has the thesis' own means, where it has the map and the algorithm.
    """
    tables = []
    for name in comparison.algorithms:
        table, found = run_table(comparison, group, name), thesis_means(name, map_name(group))
        if found is not None:
            last: tuple[Cell, ...] = (
                "thesis mean",
                *(found.weighted[column] for column in COLUMNS),
            )
            table = replace(table, rows=(*table.rows, last))
        tables.append(table)
    return tables


def table_words(group: str, comparison: Comparison) -> str:
    """Which tables of the thesis these answer, or nothing."""
    place = PLACES.get(map_name(group))
    numbers = [place.tables.get(name, "") for name in comparison.algorithms] if place else []
    return " and ".join(number for number in numbers if number)


def ratio_table(comparison: Comparison, group: str) -> Table:
    """Every algorithm over the baseline on one map: as 4.4, with intervals and p values."""
    printed = PRINTED_RATIOS.get(map_name(group), {})
    rows: list[tuple[Cell, ...]] = [
        (*_names(c), *contrast_cells(c.contrast), c.p_value, _printed(printed, c))
        for c in corrected_contrasts(comparison)
        if c.contrast.group == group
    ]
    level = f"{comparison.how.level:.0%}"
    base = comparison.baseline
    return Table(
        (
            *("algorithm", "error", "n", "mean [m]", f"{base} [m]", "ratio"),
            *(f"{level} from", f"{level} to", "p", "p (Holm)", "thesis ratio"),
        ),
        tuple(rows),
        title=f"{group}: over {base}",
    )


def correlation_table(comparison: Comparison) -> Table:
    """Pose error against Total, per map and over all, with the thesis' r over all 26 runs."""
    rows: list[tuple[Cell, ...]] = []
    for found, row in zip(comparison.correlations, correlation_rows(comparison), strict=True):
        over_all = found.group == comparison.groups[-1]
        thesis = PEARSON.get(found.algorithm) if over_all else None
        rows.append((*row, *(thesis or (None,) * 3)))
    return Table(
        (
            *("group", "algorithm", "n", "Pearson", "r from", "r to"),
            *("Spearman", "rho from", "rho to", "thesis r", "thesis from", "thesis to"),
        ),
        tuple(rows),
        title=f"Correlation of pose error and Total, {comparison.how.level:.0%} intervals",
    )


def ranking_table(comparison: Comparison) -> Table:
    """How often the pose error names another best algorithm than the Total, per map and in all."""
    maps = list(dict.fromkeys(ranking.map for ranking in comparison.rankings))
    rows: list[tuple[Cell, ...]] = []
    for name in maps:
        own = [ranking for ranking in comparison.rankings if ranking.map == name]
        odd = [ranking.dataset for ranking in own if ranking.disagrees]
        rows.append((name, len(own), len(odd), None, None, None, ", ".join(odd)))
    found = disagreement(comparison)
    rows.append(("all", found.n, found.count, found.share, *interval_cells(found.interval), ""))
    return Table(
        ("map", "data sets", "differ", "share", "from", "to", "which"),
        tuple(rows),
        title="Data sets on which pose error and Total name different best algorithms",
        note=f"from, to: {comparison.how.level:.0%} score interval (Wilson). In the thesis: "
        f"{POSE_COUNTS_FALSE_RANKS} of {DATASETS}.",
    )


def effect_table(comparison: Comparison) -> Table:
    """What power and map do to Total and pose error."""
    rows: list[tuple[Cell, ...]] = [
        (
            *(e.algorithm, HEADINGS[e.column], f"{e.what} minus {e.against}", e.n),
            *(e.mean, *interval_cells(e.interval), e.p_value),
        )
        for e in effects(comparison)
    ]
    level = f"{comparison.how.level:.0%}"
    return Table(
        ("algorithm", "error", "effect", "pairs", "mean [m]", f"{level} from", f"{level} to", "p"),
        tuple(rows),
        title="Power and map",
        note="Differences of paired runs: of two powers by map and trial, of two maps by power and "
        "trial. Bootstrap interval of their mean; p: sign-flip test, not corrected.",
    )


def disagreeing(comparison: Comparison) -> Mapping[str, int]:
    """How many data sets were ranked, and on how many the ranks differ."""
    found = disagreement(comparison)
    return {"n": found.n, "count": found.count}


def _names(corrected: Corrected) -> tuple[str, str]:
    return corrected.contrast.algorithm, HEADINGS[corrected.contrast.column]


def _printed(printed: Mapping[str, str], corrected: Corrected) -> Cell:
    """The ratio as the thesis prints it, which is FastSLAM over EKF-SLAM."""
    fits = corrected.contrast.algorithm == "fastslam"
    text = printed.get(corrected.contrast.column) if fits else None
    return None if text is None else float(text)
