"""The command `compare`: many runs side by side, as the thesis' tables and with uncertainty."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue.options import format_option

if TYPE_CHECKING:
    from scoring.comparison.compare import Comparison, GroupBy
    from scoring.comparison.runs import TotalFormula
    from scoring.comparison.statistics import IntervalMethod

FORMAT = 1


@click.command()
@click.argument("inputs", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option(
    "--group-by",
    type=click.Choice(["map", "power", "none"]),
    default="map",
    show_default=True,
    help="One table per algorithm and map, or per algorithm and power setting.",
)
@click.option("--baseline", help="Algorithm that ratios and tests refer to (default: the first).")
@click.option(
    "--label",
    "labels",
    multiple=True,
    metavar="MAP:ALGORITHM",
    help="What a .csv input holds, once for each in their order (default: from its file name).",
)
@click.option(
    "--total",
    "formula",
    type=click.Choice(["as-given", "eq-3.1", "thesis-print"]),
    default="as-given",
    show_default=True,
    help="Total as read, as the sum of the six errors, or as the thesis' printed Totals were made "
    "(pose error twice, no map error).",
)
@click.option("--seed", default=0, show_default=True, help="Seed of resampling.")
@click.option(
    "--resamples",
    type=click.IntRange(100, 1_000_000),
    default=10_000,
    show_default=True,
    help="Bootstrap resamples; also sign patterns of the paired test beyond 16 data sets.",
)
@click.option(
    "--interval",
    "method",
    type=click.Choice(["bca", "percentile"]),
    default="bca",
    show_default=True,
    help="Kind of 95 % bootstrap interval.",
)
@format_option("How to print; json and csv hold one row per figure, csv one block per table.")
@click.option(
    "--report",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.html",
    help="Also write one self-contained HTML file with figures.",
)
def compare(
    inputs: tuple[Path, ...],
    group_by: GroupBy,
    baseline: str | None,
    labels: tuple[str, ...],
    formula: TotalFormula,
    seed: int,
    resamples: int,
    method: IntervalMethod,
    table_format: str,
    report: Path | None,
) -> None:
    """Compare algorithms over many runs.

    INPUTS are session folders (their scores/*.json), score files or tables with the columns
    dataset,ep1,ep2,emap,efn,efp,edist,total. Missing runs and undefined errors are counted and left
    out, never taken as 0.
    """
    from scoring.comparison.compare import compare as compare_runs
    from scoring.comparison.reading import read_runs
    from scoring.comparison.runs import with_totals
    from scoring.comparison.statistics import Bootstrap

    how = Bootstrap(seed=seed, resamples=resamples, method=method)
    runs = with_totals(read_runs(inputs, labels), formula)
    comparison = compare_runs(runs, group_by=group_by, baseline=baseline, how=how)
    from_tables = formula == "as-given" and any(path.suffix.lower() == ".csv" for path in inputs)
    click.echo(_rendered(comparison, formula, table_format, from_tables))
    for remark in comparison.remarks:
        click.echo(f"note: {remark}", err=True)
    if report is not None:
        from scoring.report import write_comparison_report

        write_comparison_report(report, comparison)
        click.echo(f"wrote {report}", err=True)


def _rendered(
    comparison: Comparison, formula: TotalFormula, table_format: str, from_tables: bool
) -> str:
    from scoring.comparison.records import long_tables
    from scoring.comparison.tables import thesis_tables, total_tables

    if table_format == "json":
        return _json(comparison, formula)
    if table_format == "csv":
        blocks = long_tables(comparison).items()
        return "\n\n".join(f"# {name}\n{table.render('csv')}" for name, table in blocks)
    tables = thesis_tables(comparison) + (total_tables(comparison) if from_tables else ())
    return "\n\n".join(table.render(table_format) for table in tables)


def _json(comparison: Comparison, formula: TotalFormula) -> str:
    """One object: the choices in force, remarks, and each long table as a list of records."""
    from scoring.comparison.records import long_tables

    how = comparison.how
    content: dict[str, object] = {
        "format": FORMAT,
        "choices": {
            "group_by": comparison.group_by,
            "baseline": comparison.baseline,
            "total": formula,
            "seed": how.seed,
            "resamples": how.resamples,
            "level": how.level,
            "interval": how.method,
        },
        "remarks": list(comparison.remarks),
    }
    for name, table in long_tables(comparison).items():
        content[name] = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    return json.dumps(content, indent=2)
