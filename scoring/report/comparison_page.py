"""The report of a comparison: one HTML file that needs nothing else."""

from __future__ import annotations

from pathlib import Path

from dialogue.pages import SERIES, render, view
from scoring.comparison import COLUMNS, Comparison
from scoring.comparison.tables import thesis_tables
from scoring.report.comparison_figures import correlation_svg, dataset_svg, mean_svg, ratio_svg

TEMPLATE = Path(__file__).parent / "templates" / "comparison.html"


def write_comparison_report(path: Path, comparison: Comparison, title: str = "Comparison") -> None:
    """Write one self-contained HTML file: means, ratios, every data set, correlations, tables.

    The same comparison gives the same bytes. Replaces `path` in one step; raises `LogError` when
    the disk does not take it.
    """
    from capture import write_text

    c = comparison
    missing = sum(run.missing for run in c.runs)
    rivals = list(dict.fromkeys(contrast.algorithm for contrast in c.contrasts))
    page = render(
        TEMPLATE,
        title=title,
        subtitle=f"{len(c.runs) - missing} runs, {missing} missing, {len(c.algorithms)} algorithms",
        series=[(SERIES[i % len(SERIES)], name) for i, name in enumerate(c.algorithms)],
        means=[mean_svg(c, column) for column in COLUMNS],
        ratios=[ratio_svg(c, algorithm) for algorithm in rivals],
        correlation=correlation_svg(c),
        correlations=[_correlation_line(c, name) for name in c.algorithms],
        datasets=[dataset_svg(c, column) for column in ("pose", "total")],
        disagreements=sum(ranking.disagrees for ranking in c.rankings),
        ranked=len(c.rankings),
        tables=[view(table) for table in thesis_tables(c)],
        remarks=c.remarks,
        level=f"{c.how.level:.0%}",
        how=c.how,
        baseline=c.baseline,
    )
    write_text(path, page)


def _correlation_line(comparison: Comparison, algorithm: str) -> str:
    """How an algorithm's pose error and Total go together, over all runs."""
    group = comparison.groups[-1]
    found = next(c for c in comparison.correlations if (c.group, c.algorithm) == (group, algorithm))
    if found.pearson is None:
        return f"{algorithm}: r undefined"
    ends = found.pearson_interval
    spread = "" if ends is None else f" ({ends.low:.2f} to {ends.high:.2f})"
    return f"{algorithm}: r = {found.pearson:.3f}{spread}, n = {found.n}"
