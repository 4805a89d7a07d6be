"""Runs from tables, score files and sessions, and what is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from comparison_runs import HEADER, write_tables

from capture import Session, SessionInfo
from dialogue import UsageError
from scoring import ERROR_NAMES, ScoringError
from scoring.comparison import read_runs, read_table, total_of, with_totals

ROW = "Low-1,0.1,0.2,0.3,0.6,0.9,0.4,9.9\n"


def score_text(name: str, **changes: object) -> str:
    weighted = {**dict.fromkeys(ERROR_NAMES, 0.5), "distance": None}
    score = {"name": name, "total": 1.0, "weighted": weighted, "choices": {}}
    return json.dumps({"format": 1, "scores": [{**score, **changes}]})


def make_session(folder: Path, info: SessionInfo, *names: str) -> Path:
    with Session.create(folder, info):
        pass
    (folder / "scores").mkdir(exist_ok=True)
    for name in names:
        (folder / "scores" / f"{name}.json").write_text(score_text(name))
    return folder


def test_table_gives_map_algorithm_data_set_and_missing_rows(tmp_path: Path) -> None:
    runs = read_table(write_tables(tmp_path)[0])
    assert {(run.map, run.algorithm) for run in runs} == {("turn", "ekf")}
    assert [run.dataset for run in runs] == ["Low-1", "Low-2", "High-1", "High-2"]
    assert [run.missing for run in runs] == [False, True, False, False]
    assert (runs[3].power, runs[3].trial) == ("High", "2")
    assert runs[3].weighted["distance"] is None
    assert runs[3].weighted["false_positives"] == 0.6


def test_label_names_a_table(tmp_path: Path) -> None:
    file = tmp_path / "x.csv"
    file.write_text(HEADER + ROW)
    run = read_runs([file], ["hall 2:graph"]).runs[0]
    assert (run.map, run.algorithm) == ("hall 2", "graph")


@pytest.mark.parametrize(
    ("labels", "said"),
    [((), "--label MAP:ALGORITHM"), (("turn",), "turn"), (("a:b", "c:d"), "2 times for 1")],
)
def test_table_without_a_usable_name_is_refused(
    tmp_path: Path, labels: tuple[str, ...], said: str
) -> None:
    file = tmp_path / "x.csv"
    file.write_text(HEADER + ROW)
    with pytest.raises(UsageError, match=said):
        read_runs([file], labels)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"t_m_a\.csv:1: column dataset"),
        (HEADER.replace("efp", "fp") + ROW, r"t_m_a\.csv:1: column efp is missing"),
        (HEADER + ROW.replace("0.3", "0,3"), r"t_m_a\.csv:2: .*9 cells for 8 columns"),
        (HEADER + ROW + ROW.replace("0.9", "many"), r"t_m_a\.csv:3: efp is 'many'"),
        (HEADER + ROW.replace("0.9", "nan"), r"t_m_a\.csv:2: efp is 'nan'"),
        (HEADER + "Low-1,0.1\n", r"t_m_a\.csv:2: .*2 cells for 8 columns"),
    ],
)
def test_broken_table_names_file_and_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "t_m_a.csv"
    file.write_text(text)
    with pytest.raises(ScoringError, match=said):
        read_table(file)


def test_a_run_that_comes_twice_is_refused(tmp_path: Path) -> None:
    first, second = tmp_path / "a_turn_ekf.csv", tmp_path / "b_turn_ekf.csv"
    for file in (first, second):
        file.write_text(HEADER + ROW)
    with pytest.raises(ScoringError, match=r"ekf on turn Low-1 comes twice.*a_turn.*b_turn"):
        read_runs([first, second])


def test_sessions_tell_map_power_and_trial(tmp_path: Path) -> None:
    info = SessionInfo(map="loop", power="low", trial=2)
    folder = make_session(tmp_path / "s", info, "ekf", "fastslam")
    runs = read_runs([folder]).runs
    assert [(r.map, r.dataset, r.algorithm) for r in runs] == [
        ("loop", "Low-2", "ekf"),
        ("loop", "Low-2", "fastslam"),
    ]
    assert runs[0].weighted["distance"] is None
    assert runs[0].weighted["total"] == 1.0


def test_session_without_power_goes_by_its_name(tmp_path: Path) -> None:
    folder = make_session(tmp_path / "robot1", SessionInfo(map="mrclam"), "ekf")
    assert read_runs([folder]).runs[0].dataset == "robot1"


def test_score_file_outside_of_a_session_goes_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "hall.json"
    file.write_text(score_text("ekf"))
    run = read_runs([file]).runs[0]
    assert (run.dataset, run.algorithm) == ("hall", "ekf")


def test_session_without_scores_is_told_and_left_out(tmp_path: Path) -> None:
    good = make_session(tmp_path / "good", SessionInfo(map="turn", power="low", trial=1), "ekf")
    empty = make_session(tmp_path / "empty", SessionInfo(map="turn", power="low", trial=2))
    runs = read_runs([good, empty])
    assert len(runs.runs) == 1
    assert runs.remarks == (f"{empty} has no scores and is left out; run: trackside score {empty}",)
    with pytest.raises(ScoringError, match=r"nothing to compare.*trackside score"):
        read_runs([empty])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "holds no scores"),
        ("[1]", "holds no scores"),
        (score_text("ekf").replace('"format": 1', '"format": 2'), "format 2, this program reads 1"),
        (score_text("ekf", weighted=3), "holds no scores"),
        (score_text("ekf", total="much"), "holds no scores"),
    ],
)
def test_broken_score_file_is_named(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "x.json"
    file.write_text(text)
    with pytest.raises(ScoringError, match=rf"x\.json.*{said}"):
        read_runs([file])


def test_other_files_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "x.tum"
    file.write_text("")
    with pytest.raises(ScoringError, match="expected a session folder, a score file"):
        read_runs([file])


def test_total_by_each_formula() -> None:
    weighted = {
        "pose": 0.1,
        "max_pose": 0.2,
        "map": 0.3,
        "false_negatives": 0.6,
        "false_positives": 0.9,
        "distance": None,
        "total": 9.9,
    }
    assert total_of(weighted, "as-given") == 9.9
    assert total_of(weighted, "eq-3.1") == pytest.approx(2.1)
    assert total_of(weighted, "thesis-print") == pytest.approx(1.9)


def test_a_missing_run_stays_missing_by_any_formula(tmp_path: Path) -> None:
    runs = with_totals(read_runs(write_tables(tmp_path)), "eq-3.1").runs
    assert [run.missing for run in runs].count(True) == 2
