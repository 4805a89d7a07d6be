"""`trackside compare` as a user calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from comparison_runs import write_tables

from scoring.comparison.cli import compare


def run(*arguments: object) -> str:
    words = [str(argument) for argument in arguments]
    result = CliRunner().invoke(compare, [*words, "--resamples", "200"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_tables_of_the_thesis(tmp_path: Path) -> None:
    text = run(*write_tables(tmp_path))
    assert "turn: ekf, weighted errors [m]" in text
    assert "left out: 1 missing, 1 without distance" in text
    # ekf: (0.1 + 0.3 + 0.2) / 3; fastslam: (0.2 + 0.1 + 0.6) / 3; their ratio.
    assert "mean      0.200" in text
    assert "turn   fastslam   1.500" in text
    assert "1 of 3 data sets" in text
    assert "Totals that a formula gives" in text


def test_totals_are_recomputed_when_asked(tmp_path: Path) -> None:
    found = json.loads(run(*write_tables(tmp_path), "--total", "thesis-print", "--format", "json"))
    totals = [r["total_m"] for r in found["runs"] if r["algorithm"] == "ekf"]
    # 2 pose + max pose + missed + false + distance
    assert totals == [pytest.approx(0.8), None, pytest.approx(1.7), pytest.approx(1.6)]
    assert found["choices"]["total"] == "thesis-print"


def test_json_holds_choices_and_every_table(tmp_path: Path) -> None:
    found = json.loads(run(*write_tables(tmp_path), "--format", "json", "--seed", "3"))
    assert found["format"] == 1
    assert found["choices"]["seed"] == 3
    assert set(found) == {
        *("format", "choices", "remarks"),
        *("runs", "summaries", "contrasts", "correlations", "rankings"),
    }
    assert len(found["runs"]) == 8
    assert found["contrasts"][0]["ratio"] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("table_format", "said"),
    [("csv", "# summaries"), ("latex", r"\begin{tabular}"), ("md", "| dataset | pose |")],
)
def test_other_formats(tmp_path: Path, table_format: str, said: str) -> None:
    assert said in run(*write_tables(tmp_path), "--format", table_format)


def test_same_seed_same_text_other_seed_other_intervals(tmp_path: Path) -> None:
    files = write_tables(tmp_path)
    assert run(*files) == run(*files) != run(*files, "--seed", "1")


def test_grouped_by_power(tmp_path: Path) -> None:
    text = run(*write_tables(tmp_path), "--group-by", "power")
    assert "High: fastslam" in text
    assert "turn 2" in text


def test_report_is_written(tmp_path: Path) -> None:
    file = tmp_path / "compare.html"
    run(*write_tables(tmp_path), "--report", file)
    assert "<svg" in file.read_text()
