"""Scores and comparisons as pages: one HTML file each, that needs nothing else."""

from scoring.report.comparison_page import write_comparison_report
from scoring.report.page import write_report

__all__ = ["write_comparison_report", "write_report"]
