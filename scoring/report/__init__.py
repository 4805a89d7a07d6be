"""Scores and comparisons as pages: one HTML file each, that needs nothing else."""

from scoring.report.campaign_page import CampaignReport, Part, write_campaign_report
from scoring.report.comparison_page import write_comparison_report
from scoring.report.page import write_report
from scoring.report.thesis_figures import Panel, Scene

__all__ = [
    "CampaignReport",
    "Panel",
    "Part",
    "Scene",
    "write_campaign_report",
    "write_comparison_report",
    "write_report",
]
