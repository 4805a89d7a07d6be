"""The report of a comparison as one file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from browser import Browser, faults

from scoring.comparison import COLUMNS, Bootstrap, Comparison, Run, Runs, compare
from scoring.report import write_comparison_report

QUICK = Bootstrap(resamples=200)


def run(algorithm: str, name_of_map: str, trial: int, pose: float, **others: float | None) -> Run:
    weighted = {**dict.fromkeys(COLUMNS, pose), "total": 6 * pose, **others}
    return Run(name_of_map, "Low", str(trial), algorithm, weighted, Path("by hand"))


def made(*runs: Run) -> Comparison:
    return compare(Runs(runs, ("a <remark>",)), how=QUICK)


FULL = made(
    *(run("ekf", name, trial, 0.1 * trial) for name in ("turn", "loop") for trial in range(1, 5)),
    *(run("fast", name, trial, 0.15 * trial) for name in ("turn", "loop") for trial in range(1, 4)),
    run("fast", "loop", 4, 0.2, total=9.0, map=None),
)


def written(folder: Path, comparison: Comparison) -> str:
    file = folder / "compare.html"
    write_comparison_report(file, comparison, "many runs")
    return file.read_text(encoding="utf-8")


def test_every_error_ratio_and_correlation_is_drawn(tmp_path: Path) -> None:
    page = written(tmp_path, FULL)
    # Seven errors, one rival, one scatter, pose and Total per data set.
    assert page.count("<svg viewBox") == 7 + 1 + 1 + 2
    assert "Errors of fast over ekf" in page
    assert "a &lt;remark&gt;" in page
    assert "the 1 of 7 data sets" in page
    assert "turn: ekf, weighted errors [m]" in page


def test_it_needs_nothing_else_and_repeats_itself(tmp_path: Path) -> None:
    page = written(tmp_path, FULL)
    assert not re.search(r"https?:|<script|<link|<img|@import", page)
    assert written(tmp_path, FULL) == page


def test_a_browser_shows_it_without_a_fault(browser: Browser, tmp_path: Path) -> None:
    written(tmp_path, FULL)
    assert faults(browser, tmp_path / "compare.html") == []


@pytest.mark.parametrize(
    "runs",
    [
        [run("ekf", "turn", 1, 0.1)],
        [run("ekf", "turn", 1, 0.1, total=None), run("fast", "turn", 2, 0.3)],
        [run("ekf", "turn", 1, 0.0), run("fast", "turn", 1, 0.3)],
        [run(name, "turn", 1, 0.3) for name in "abcdef"],
    ],
    ids=["alone", "nothing in common", "zero baseline", "six algorithms"],
)
def test_sparse_comparisons_are_drawn(tmp_path: Path, runs: list[Run]) -> None:
    assert "many runs" in written(tmp_path, made(*runs))
