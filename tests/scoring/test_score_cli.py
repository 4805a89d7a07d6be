from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from score_scenes import estimate_of, landmark_map, space_spiral, truth_lap

from capture import (
    EstimatedMap,
    MissingStreamError,
    Session,
    SessionInfo,
    TextFileError,
    ns_to_stamp,
    write_estimated_map,
    write_landmarks,
    write_tum,
)
from dialogue import UsageError
from scoring import METRIC_NAMES, TooFewPosesError
from scoring.cli import score


@dataclass(frozen=True)
class Files:
    """One scene as text files and as a session with two estimates."""

    folder: Path

    @property
    def flags(self) -> list[str]:
        names = {"truth": "car.tum", "cones": "cones.csv", "path": "est.tum", "map": "map.csv"}
        return [word for flag, name in names.items() for word in (f"--{flag}", self.at(name))]

    def at(self, name: str) -> str:
        return str(self.folder / name)


@pytest.fixture
def files(tmp_path: Path) -> Files:
    truth, estimate = truth_lap(), estimate_of(truth_lap(), shift=(0.03, 0.04))
    assert truth.landmarks is not None
    assert estimate.map is not None
    write_tum(tmp_path / "car.tum", truth.path)
    write_landmarks(tmp_path / "cones.csv", truth.landmarks)
    write_tum(tmp_path / "est.tum", estimate.path)
    write_estimated_map(tmp_path / "map.csv", estimate.map)
    info = SessionInfo(start_utc="2026-05-14T10:00:00+00:00")
    with Session.create(tmp_path / "run", info) as session:
        session.add_ground_truth(truth)
        session.add_estimate(estimate)
        session.add_estimate(replace(estimate_of(truth), name="fast"))
    return Files(tmp_path)


def _run(*arguments: str) -> Result:
    result = CliRunner().invoke(score, list(arguments))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_the_table_tells_errors_conditions_and_metrics(files: Files) -> None:
    text = _run(*files.flags).stdout
    assert re.search(r"^map \[m\] +0\.050 +1\.000 +0\.050$", text, re.MULTILINE)
    assert re.search(r"^false_negatives +0 +0\.300 +0\.000$", text, re.MULTILINE)
    assert re.search(r"^Total", text, re.MULTILINE)
    assert "200 paired by interpolate, 100.0 % of the estimate, 0 dropped, offset 0 s" in text
    assert "alignment: origin, x 0.000 m, y 0.000 m, heading 0.00 deg" in text
    assert "8 true, 8 estimated, q = 8 pairs (saturated, c = 0.3 m), q' = 8 for" in text
    assert re.search(r"^ospa \[m\] +0\.050$", text, re.MULTILINE)


def test_nothing_is_written_unless_asked_for(files: Files) -> None:
    before = sorted(files.folder.rglob("*"))
    _run(*files.flags)
    assert sorted(files.folder.rglob("*")) == before


def test_json_is_what_the_file_holds(files: Files) -> None:
    printed = _run(*files.flags, "--format", "json", "-o", files.at("s.json")).stdout
    document = json.loads(printed)
    assert document == json.loads(Path(files.at("s.json")).read_text())
    (only,) = document["scores"]
    assert document["format"] == 1
    assert only["name"] == "est"
    assert only["errors"]["map"] == pytest.approx(0.05)
    assert only["counts"]["pairs"] == 8
    assert only["choices"]["gospa_cutoff_m"] == 0.6


def test_csv_holds_every_number_in_one_row(files: Files) -> None:
    rows = list(csv.DictReader(io.StringIO(_run(*files.flags, "--format", "csv").stdout)))
    assert len(rows) == 1
    assert float(rows[0]["map"]) == pytest.approx(0.05)
    assert float(rows[0]["weighted_map"]) == pytest.approx(0.05)
    assert set(METRIC_NAMES) < set(rows[0])
    assert rows[0]["path_nees"] == ""


@pytest.mark.parametrize(
    ("form", "mark"), [("md", "| map [m] | 0.050 |"), ("latex", "map [m] & 0.050")]
)
def test_tables_for_papers(files: Files, form: str, mark: str) -> None:
    assert mark in _run(*files.flags, "--format", form).stdout


def test_the_errors_of_each_pose_keep_their_stamps(files: Files) -> None:
    _run(*files.flags, "--errors", files.at("errors.csv"), "--align", "none", "--offset", "0.001")
    with Path(files.at("errors.csv")).open() as stream:
        rows = list(csv.DictReader(stream))
    truth = truth_lap().path
    assert list(rows[0]) == ["estimate", "t_s", "error_m", "along_m", "cross_m", "heading_rad"]
    assert len(rows) == 199
    assert rows[5]["t_s"] == ns_to_stamp(int(truth.t_ns[5]) + 1_000_000)
    behind = -truth.speed_m_s[5] * 0.001
    assert float(rows[5]["along_m"]) == pytest.approx(behind, rel=0.01)


def test_in_space_columns_without_meaning_are_empty(tmp_path: Path) -> None:
    spiral = space_spiral()
    lines = [
        " ".join([ns_to_stamp(int(t)), *(repr(float(v)) for v in (*xyz, *q))])
        for t, xyz, q in zip(spiral.t_ns, spiral.positions, spiral.quaternions, strict=True)
    ]
    file = tmp_path / "spiral.tum"
    file.write_text("\n".join([*lines, "1 nan 0 0 0 0 0 1"]))
    same = ("--truth", str(file), "--path", str(file))
    errors = tmp_path / "errors.csv"
    text = _run(*same, "--space", "3d", "--align", "path", "--errors", str(errors)).stdout
    assert "1 poses of spiral.tum were not finite" in text
    assert "in space (the rotation is in the JSON)" in text
    assert errors.read_text().splitlines()[1].endswith(",,,")
    with pytest.raises(TextFileError, match=r"leaves the plane.*--space 3d"):
        _run(*same)
    with pytest.raises(UsageError, match="leave --cones and --map out"):
        _run(*same, "--space", "3d", "--map", str(file))


def test_several_estimates_are_paired_in_order(files: Files) -> None:
    other = files.folder / "other"
    other.mkdir()
    write_tum(other / "est.tum", truth_lap().path)
    write_estimated_map(other / "map.csv", EstimatedMap(landmark_map(np.zeros((0, 2)))))
    second = ("--path", str(other / "est.tum"), "--map", str(other / "map.csv"))
    document = json.loads(_run(*files.flags, *second, "--format", "json").stdout)
    names = [result["name"] for result in document["scores"]]
    assert names == [f"{files.folder.name}/est", "other/est"]
    assert [r["errors"]["false_negatives"] for r in document["scores"]] == [0.0, 8.0]
    assert "weighted errors" in _run(*files.flags, *second).stdout


def test_a_session_keeps_its_scores(files: Files) -> None:
    run = files.at("run")
    result = _run(run, "--no-report")
    assert "weighted errors" in result.stdout
    kept = sorted((files.folder / "run" / "scores").iterdir())
    assert [file.name for file in kept] == ["ekf.json", "fast.json"]
    assert json.loads(kept[0].read_text())["scores"][0]["choices"]["cutoff_m"] == 0.3
    _run(run, "--estimate", "ekf", "--cutoff", "0.5", "--no-report")
    assert json.loads(kept[0].read_text())["scores"][0]["choices"]["cutoff_m"] == 0.5
    assert json.loads(kept[1].read_text())["scores"][0]["choices"]["cutoff_m"] == 0.3
    assert not (files.folder / "run" / "report.html").exists()


def test_a_session_gets_a_report_and_files_get_one_where_asked(files: Files) -> None:
    result = _run(files.at("run"), "--estimate", "ekf")
    page = files.folder / "run" / "report.html"
    assert "<html" in page.read_text()
    assert f"report: {page}" in result.stderr
    _run(*files.flags, "--report", files.at("own.html"))
    assert "<html" in Path(files.at("own.html")).read_text()


def test_a_session_without_the_estimate_says_which_it_has(files: Files) -> None:
    with pytest.raises(MissingStreamError, match="ekf"):
        _run(files.at("run"), "--estimate", "slow")
    with Session.create(files.folder / "bare", SessionInfo(start_utc="")) as session:
        session.add_ground_truth(truth_lap())
    with pytest.raises(MissingStreamError, match="trackside slam"):
        _run(files.at("bare"))


def test_a_limit_that_is_passed_ends_with_3_after_the_table(files: Files) -> None:
    good = _run(*files.flags, "--fail-above", "map=0.06", "--fail-above", "ate_rmse=0.1")
    assert good.exit_code == 0
    bad = _run(*files.flags, "--fail-above", "map=0.04", "--fail-above", "path_nees=3")
    assert bad.exit_code == 3
    assert "Total" in bad.stdout
    assert "est: map 0.05 is above 0.04" in bad.stderr
    assert "est: path_nees is undefined, limit 3" in bad.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("totl=1", "did you mean 'total'"),
        ("total", "expected total=NUMBER"),
        ("total=low", "expected total=NUMBER"),
        ("total=nan", "nothing is above nan"),
    ],
)
def test_limits_that_mean_nothing_are_refused(files: Files, text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        _run(*files.flags, "--fail-above", text)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "expected either a SESSION, or --truth"),
        (["run", "--truth", "t.tum"], "expected either a SESSION, or --truth"),
        (["--truth", "t.tum"], "need both --truth T.tum and --path P.tum"),
        (["--path", "p.tum"], "need both --truth T.tum and --path P.tum"),
        (["--truth", "t", "--path", "p", "--estimate", "ekf"], "with --truth use --path"),
        (["--truth", "t", "--path", "p", "--path", "q", "--map", "m"], "1 --map for 2 --path"),
        (["--truth", "t", "--path", "p.tum", "--path", "p.tum"], "as --path twice"),
        (["--truth", "t", "--path", "p", "--weights", "1,2,x"], "expected six numbers"),
        (["--truth", "t", "--path", "p", "--cutoff", "-1"], "--cutoff -1.0: expected a number"),
        (["--truth", "t", "--path", "p", "--weights", "1,2"], "--weights has 2 values"),
    ],
)
def test_calls_that_mean_nothing_are_refused(arguments: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        _run(*arguments)


def test_a_session_is_not_scored_in_space(files: Files) -> None:
    with pytest.raises(UsageError, match="a session is planar"):
        _run(files.at("run"), "--space", "3d")


def test_flags_beat_the_preset(files: Files) -> None:
    printed = _run(*files.flags, "--preset", "thesis-print", "--format", "json").stdout
    (only,) = json.loads(printed)["scores"]
    assert only["choices"]["total_formula"] == "thesis-print"
    assert only["weighted"]["map"] == only["weighted"]["pose"]
    flags = ("--preset", "thesis-print", "--total-formula", "eq-3.1", "--weights", "0,0,2,0,0,0")
    (only,) = json.loads(_run(*files.flags, *flags, "--format", "json").stdout)["scores"]
    assert only["total"] == pytest.approx(2 * 0.05)


def test_a_wrong_clock_is_told_with_both_ranges(files: Files) -> None:
    with pytest.raises(TooFewPosesError, match=r"a clock set to another zone\? --offset"):
        _run(*files.flags, "--offset", "7200")


def test_help_has_headings_units_and_defaults() -> None:
    text = _run("--help").stdout
    for heading in ("Time:", "Alignment:", "Landmarks:", "Multi-error:", "Metrics:"):
        assert f"\n{heading}\n" in text
    assert "--cutoff M " in text
    assert "[default: 0.3 m]" in " ".join(text.split())
    assert "Changing --cutoff leaves the weights as they are" in " ".join(text.split())


def test_scoring_text_files_imports_nothing_heavy(files: Files) -> None:
    program = (
        "import sys\n"
        "from scoring.cli import score\n"
        "score(sys.argv[1:], standalone_mode=False)\n"
        "heavy = {'scipy', 'matplotlib', 'numba', 'rosbags', 'mcap', 'rich', 'jinja2', 'yaml'}\n"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *files.flags], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
