"""The report of a campaign from values made by hand."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from report_scores import make_map, make_path, make_score

from dialogue import Table
from scoring import Score
from scoring.comparison import COLUMNS, Bootstrap, Run, Runs, compare
from scoring.report import CampaignReport, Panel, Part, Scene, write_campaign_report
from scoring.report.thesis_figures import scene_svgs

QUICK = Bootstrap(resamples=200)
DRIVES = Table(("session", "seed"), (("turn_low_1", 7),), title="The sessions")


def run(algorithm: str, name: str, power: str, trial: int, pose: float | None) -> Run:
    weighted = dict.fromkeys(COLUMNS, pose)
    if pose is not None:
        weighted["total"] = 6 * pose
    return Run(name, power, str(trial), algorithm, weighted, Path("by hand"))


def part(*runs: Run, scenes: tuple[Scene, ...] = ()) -> Part:
    return Part(compare(Runs(runs), how=QUICK), scenes)


def written(folder: Path, parts: Mapping[str, Part], **others: object) -> str:
    report = CampaignReport("many <runs>", parts, (("seed", "7"),), DRIVES, (), "title: <x>")
    file = folder / "campaign.html"
    write_campaign_report(file, replace(report, **others))  # type: ignore[arg-type]
    return file.read_text(encoding="utf-8")


def full() -> dict[str, Part]:
    runs = [
        run(name, place, power, trial, scale * (0.1 + 0.01 * trial))
        for name, scale in (("ekf", 1.0), ("fastslam", 1.5))
        for place in ("turn", "loop")
        for power in ("Low", "High")
        for trial in (1, 2, 3)
    ]
    panel = Panel("ekf", score(), np.zeros(3), np.zeros((4, 3)))
    scene = Scene("turn", "Low-1", (panel, replace(panel, label="fastslam")))
    return {"thesis": part(*runs, scenes=(scene,)), "robust": part(*runs)}


def score() -> Score:
    return replace(make_score(), path=make_path(), map=make_map(), true_path=np.zeros((3, 3)))


def test_it_needs_nothing_else_and_repeats_itself(tmp_path: Path) -> None:
    page = written(tmp_path, full())
    assert not re.search(r"https?:|<script|<link|<img|@import", page)
    assert written(tmp_path, full()) == page
    assert "many &lt;runs&gt;" in page
    assert "title: &lt;x&gt;" in page
    # Every colour is one that light and dark have.
    style = (Path(__file__).parents[3] / "dialogue/pages/templates/style.css").read_text()
    for name in set(re.findall(r"var\(--([\w]+)\)", page)):
        assert len(re.findall(rf"--{name}:", style)) in (0, 3), name
    assert not re.search(r"#[0-9a-f]{6}", page.partition("</style>")[2])


def test_ids_of_figures_do_not_collide(tmp_path: Path) -> None:
    """Two elements of one id are the same element, as of a clip path of equal size."""
    page = written(tmp_path, full())
    clips = re.findall(r'<clipPath id="([^"]*)">(.*?)</clipPath>', page)
    assert clips
    assert len(set(clips)) == len({name for name, _ in clips})


def test_failures_are_told(tmp_path: Path) -> None:
    page = written(tmp_path, full(), failures=(("turn_low_1", "join: <clocks>"),))
    assert "What is missing" in page
    assert "turn_low_1: join: &lt;clocks&gt;" in page
    assert "What is missing" not in written(tmp_path, full())


@pytest.mark.parametrize(
    "runs",
    [
        [run("ekf", "turn", "Low", 1, 0.1)],
        [run("ekf", "turn", "Low", 1, 0.1), run("fastslam", "turn", "Low", 1, None)],
        [run("graph", "hall", "run", 1, 0.1), run("ekf", "hall", "run", 1, 0.0)],
        [run(name, "turn", "Low", k, 0.3) for name in "abcde" for k in (1, 2)],
    ],
    ids=["alone", "one missing", "elsewhere", "five algorithms"],
)
def test_sparse_campaigns_are_told(tmp_path: Path, runs: list[Run]) -> None:
    page = written(tmp_path, {"mine": part(*runs)})
    assert "Preset mine" in page
    assert ("Answers figure 4.2" in page) == (runs[0].map == "turn")


def test_scenes_of_one_data_set_share_their_floor() -> None:
    shifted = make_path()
    far = replace(make_score(), path=replace(shifted, estimate=shifted.estimate + 5.0))
    panels = (Panel("ekf", make_score()), Panel("fastslam", far))
    one, two = scene_svgs(Scene("turn", "Low-1", panels), "preset thesis")
    boxes = {re.search(r'viewBox="([^"]*)"', svg)[1] for svg in (one, two)}  # type: ignore[index]
    assert len(boxes) == 1
    ticks = [re.findall(r"<text[^>]*>([^<]*)</text>", svg) for svg in (one, two)]
    assert ticks[0] == ticks[1]


def test_odometry_that_is_lost_does_not_shrink_the_picture() -> None:
    score_of = make_score()
    path = np.column_stack([np.linspace(0.0, 500.0, 50), np.zeros(50), np.zeros(50)])
    near = scene_svgs(Scene("turn", "Low-1", (Panel("ekf", score_of),)), "near")[0]
    far = scene_svgs(Scene("turn", "Low-1", (Panel("ekf", score_of, None, path),)), "far")[0]
    assert "var(--odometry)" in far
    assert "var(--odometry)" not in near
    assert ">100<" not in far


def test_an_estimate_without_path_or_map_is_drawn_all_the_same() -> None:
    empty = replace(make_score(), path=None, map=None, true_path=None)
    (svg,) = scene_svgs(Scene("turn", "Low-1", (Panel("ekf", empty),)), "nothing")
    assert svg.startswith("<svg")
