"""The report of a campaign: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dialogue import Table
from dialogue.pages import SERIES, render, view
from scoring.comparison import Comparison
from scoring.comparison.compare import EVERYTHING
from scoring.comparison.overview import overview
from scoring.comparison.thesis import PLACES, map_name
from scoring.comparison.verdicts import verdicts
from scoring.report.campaign_tables import (
    correlation_table,
    disagreeing,
    effect_table,
    ranking_table,
    ratio_table,
    run_tables,
    table_words,
)
from scoring.report.comparison_figures import correlation_svg, dataset_svg, ratio_svg
from scoring.report.thesis_figures import Scene, errors_svg, scene_svgs

TEMPLATE = Path(__file__).parent / "templates" / "campaign.html"


@dataclass(frozen=True, eq=False)
class Part:
    """One preset: what its algorithms scored, and the scenes that are drawn of it."""

    comparison: Comparison
    scenes: tuple[Scene, ...]


@dataclass(frozen=True, eq=False)
class CampaignReport:
    """What the page tells.

    parts : by preset; facts : (what, value) of how it was made; drives : the sessions, as a table;
    failures : (session, why); definition : the text of the campaign file.
    """

    title: str
    parts: Mapping[str, Part]
    facts: tuple[tuple[str, str], ...]
    drives: Table
    failures: tuple[tuple[str, str], ...]
    definition: str


def write_campaign_report(path: Path, report: CampaignReport) -> None:
    """Write one self-contained HTML file: verdicts, tables, figures 4.1 to 4.7, tests, provenance.

    The same report gives the same bytes. Replaces `path` in one step; raises `LogError` when the
    disk does not take it.
    """
    from capture import write_text

    comparisons = {name: part.comparison for name, part in report.parts.items()}
    runs = sum(len(c.runs) for c in comparisons.values())
    page = render(
        TEMPLATE,
        title=report.title,
        subtitle=f"{len(report.drives.rows)} sessions, {runs} runs",
        overview=view(overview(comparisons)),
        verdicts=[(name, verdicts(c)) for name, c in comparisons.items()],
        campaign_parts=[_part(name, part) for name, part in report.parts.items()],
        facts=view(Table(("what", "value"), report.facts, title="How it was made")),
        drives=view(report.drives),
        failures=report.failures,
        definition=report.definition,
    )
    write_text(path, page)


def _part(name: str, part: Part) -> dict[str, object]:
    c = part.comparison
    maps = [group for group in c.groups if group != EVERYTHING] or list(c.groups)
    tables = [correlation_table(c), ranking_table(c), effect_table(c)]
    everything = [ratio_table(c, EVERYTHING)] if c.contrasts and EVERYTHING in c.groups else []
    return {
        "name": name,
        "series": [(SERIES[i % len(SERIES)], label) for i, label in enumerate(c.algorithms)],
        "maps": [_map(name, part, group) for group in maps],
        "datasets": [dataset_svg(c, column) for column in ("pose", "total")],
        "correlation": correlation_svg(c),
        "ratios": [ratio_svg(c, rival) for rival in _rivals(c)],
        "ranked": disagreeing(c),
        "tables": [view(table) for table in (*everything, *tables) if table.rows],
        "remarks": c.remarks,
        "level": f"{c.how.level:.0%}",
        "how": c.how,
        "baseline": c.baseline,
    }


def _rivals(comparison: Comparison) -> list[str]:
    return list(dict.fromkeys(contrast.algorithm for contrast in comparison.contrasts))


def _map(preset: str, part: Part, group: str) -> dict[str, object]:
    c, place = part.comparison, PLACES.get(map_name(group))
    scene = next((scene for scene in part.scenes if scene.map == group), None)
    ratios = [ratio_table(c, group)] if c.contrasts else []
    note = f"preset {preset}"
    return {
        "name": group,
        "dataset": scene.dataset if scene else "",
        "scenes": _labelled(scene, note) if scene else [],
        "errors": errors_svg(c, group, note),
        "place": place,
        "answers": table_words(group, c),
        "runs": [view(table) for table in run_tables(c, group)],
        "ratios": [view(table) for table in ratios if table.rows],
    }


def _labelled(scene: Scene, note: str) -> list[tuple[str, float | None, str]]:
    drawn = scene_svgs(scene, note)
    return [(p.label, p.score.total, svg) for p, svg in zip(scene.panels, drawn, strict=True)]
