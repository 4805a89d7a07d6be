"""The report: its numbers are those of `trackside compare`, and it needs nothing else."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pytest
from click.testing import CliRunner
from fake_steps import do_campaign

from trackside.cli import trackside

TEXT = """\
title: The <whole> experiment
output: out
simulate: {maps: [turn, s-curve, loop], powers: [low, high], trials: 2, seed: 5}
runs:
  - {algorithm: ekf, preset: thesis, odometry: viso}
  - {algorithm: fastslam, preset: thesis, odometry: viso, settings: {particles: 20}}
  - {algorithm: ekf, preset: robust, odometry: wheel}
resamples: 300
"""


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of one campaign, made once."""
    folder = tmp_path_factory.mktemp("campaign")
    with pytest.MonkeyPatch.context() as patch:
        done = do_campaign(patch, folder, TEXT)
    assert done.exit_code == 0, done.exception
    return folder / "out"


def tables(page: str) -> dict[str, list[list[str]]]:
    """Title -> rows of every table that stands under a title of its own."""
    found = re.findall(
        r"<(h3|summary)[^>]*>([^<]*)</\1><div class=\"scroll\"><table.*?</table>", page, re.S
    )
    assert found
    parts = re.split(r"<(?:h3|summary)[^>]*>", page)[1:]
    made: dict[str, list[list[str]]] = {}
    for part in parts:
        title, _, rest = part.partition("</")
        body = re.search(r"<tbody>(.*?)</tbody>", rest, re.S)
        if body:
            rows = re.findall(r"<tr>(.*?)</tr>", body[1], re.S)
            made.setdefault(
                unescape(title),
                [[unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", r)] for r in rows],
            )
    return made


def compared(out: Path, preset: str) -> dict[str, list[dict[str, object]]]:
    """What `trackside compare` says of the same runs."""
    files = [
        str(
            out / "sessions" / f"{name}_{power}_{trial}" / "run" / "scores" / f"{preset}-{own}.json"
        )
        for name in ("turn", "s-curve", "loop")
        for power in ("low", "high")
        for trial in (1, 2)
        for own in ("ekf", "fastslam")
    ]
    done = CliRunner().invoke(
        trackside, ["compare", *files, "--resamples", "300", "--format", "json"]
    )
    assert done.exit_code == 0, done.exception
    content = json.loads(done.stdout)
    assert isinstance(content, dict)
    return content


def text(value: object) -> str:
    if value is None:
        return "\N{EN DASH}"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def test_every_number_is_that_of_compare(out: Path) -> None:
    shown, told = tables((out / "report.html").read_text()), compared(out, "thesis")
    errors = ("pose", "max_pose", "map", "false_negatives", "false_positives", "distance", "total")
    checked = 0
    for run in told["runs"]:
        own = str(run["algorithm"]).removeprefix("thesis-")
        rows = {row[0]: row[1:] for row in shown[f"{run['map']}: {own}, weighted errors [m]"]}
        assert rows[str(run["dataset"])] == [text(run[f"{name}_m"]) for name in errors]
        checked += 1
    for summary in told["summaries"]:
        if summary["group"] == "all":
            continue
        own = str(summary["algorithm"]).removeprefix("thesis-")
        rows = {r[0]: r[1:] for r in shown[f"{summary['group']}: {own}, weighted errors [m]"]}
        place = errors.index(str(summary["error"]))
        for name, key in (("mean", "mean_m"), ("std", "std_m"), ("95% from", "low_m")):
            assert rows[name][place] == text(summary[key])
            checked += 1
    for contrast in told["contrasts"]:
        rows_of = shown[f"{contrast['group']}: over ekf"]
        row = rows_of[errors.index(str(contrast["error"]))]
        names = ("n", "mean_m", "baseline_mean_m", "ratio", "ratio_low", "ratio_high", "p")
        assert row[2:9] == [text(contrast[name]) for name in names]
        checked += 1
    table = shown["Correlation of pose error and Total, 95% intervals"]
    for row, found in zip(table, told["correlations"], strict=True):
        keys = ("n", "pearson", "pearson_low", "pearson_high", "spearman")
        assert row[2:7] == [text(found[key]) for key in keys]
        checked += 1
    odd = [r for r in told["rankings"] if r["disagrees"]]
    last = shown["Data sets on which pose error and Total name different best algorithms"][-1]
    assert last[:3] == ["all", "12", str(len(odd))]
    assert checked == 24 + 42 * 3 + 28 + 8


def test_each_figure_of_chapter_4_is_answered(out: Path) -> None:
    page = (out / "report.html").read_text()
    for number in range(1, 8):
        assert f"figure 4.{number} of the thesis" in page
    for tables_of in ("4.2 and 4.3", "4.5 and 4.6", "4.8 and 4.9"):
        assert f"Answers tables {tables_of} of the thesis" in page
    for ratios in ("4.4", "4.7", "4.10"):
        assert f"Answers table {ratios} of the thesis" in page
    # Of thesis: 3 maps x (2 scenes + 1 of errors), pose and Total, scatter, ratios; of robust one
    # algorithm: 3 x 2, 2, 1.
    assert page.count('role="img"') == 3 * 3 + 4 + 3 * 2 + 3
    assert "ekf on loop Low-1, preset thesis, from above" in page
    assert "The &lt;whole&gt; experiment" in page
    assert "seed 5" in page
    assert "2026-05-14T10:00:00Z" in page
    assert str(out) not in page


def test_it_needs_nothing_else(out: Path) -> None:
    page = (out / "report.html").read_text()
    assert not re.search(r"https?:|<script|<link|<img|@import|url\((?!#)", page)


def test_a_browser_opens_it_without_a_word(out: Path, tmp_path: Path) -> None:
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("chromium is not installed: nobody can open the report here")
    log = tmp_path / "net.json"
    done = subprocess.run(
        [
            *(chromium, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"),
            *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
            *(f"--user-data-dir={tmp_path / 'profile'}", "--enable-logging=stderr", "--v=0"),
            *(f"--log-net-log={log}", "--window-size=900,4000"),
            *(f"--screenshot={tmp_path / 'shot.png'}", f"file://{out / 'report.html'}"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "CONSOLE" not in done.stderr
    assert (tmp_path / "shot.png").stat().st_size > 50_000
    # The browser itself asks its maker for updates; what the page asks for has an origin.
    asked = [
        line
        for line in log.read_text(errors="replace").splitlines()
        if '"initiator"' in line and '"initiator":"not an origin"' not in line
    ]
    assert not [line for line in asked if re.search(r'"url":"(https?|wss?)://', line)]
