"""Runs against runs: the tables of the thesis over many data sets, and how far to trust them.

Reads what `score` wrote (or tables as the thesis prints them) and never scores anything itself.
"""

from scoring.comparison.compare import (
    Comparison,
    Contrast,
    Correlation,
    Ranking,
    Summary,
    compare,
    members,
)
from scoring.comparison.reading import read_runs, read_table
from scoring.comparison.runs import COLUMNS, Run, Runs, total_of, with_totals
from scoring.comparison.statistics import Bootstrap, Interval, interval, mean

__all__ = [
    "COLUMNS",
    "Bootstrap",
    "Comparison",
    "Contrast",
    "Correlation",
    "Interval",
    "Ranking",
    "Run",
    "Runs",
    "Summary",
    "compare",
    "interval",
    "mean",
    "members",
    "read_runs",
    "read_table",
    "total_of",
    "with_totals",
]
