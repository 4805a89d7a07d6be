"""`trackside slam tune` through the real command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from driven_sessions import make_session, make_sessions

from capture import MissingStreamError, Session
from dialogue import TracksideError, UsageError
from slam.preset_file import read_preset_file
from trackside.cli import trackside


def run(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    return make_sessions(tmp_path / "sessions")


def tune(sessions: Path, output: Path, *words: object) -> Result:
    return run("slam", "tune", sessions, "--jobs", 1, "-o", output, *words)


def test_from_parameters_to_a_preset_that_slam_takes(sessions: Path, tmp_path: Path) -> None:
    space = tmp_path / "space.yaml"
    space.write_text("accept_gate: [6, 9.21]\nobservation.range_sigma_m: [0.02, 3.0]\n")
    out = tmp_path / "out"
    done = tune(sessions, out, "--parameters", space, "--set", "min_seen=2")
    assert done.exit_code == 0, done.exception
    assert "15 runs, 0 of them known before" in done.stderr
    assert (out / "table.csv").read_text().count("\n") == 6
    best = read_preset_file(out / "best.yaml")
    assert best.algorithm == "ekf"
    assert best.settings["min_seen"] == 2
    assert sorted(best.evidence["sessions"]) == ["run0", "run1", "run2"]  # type: ignore[call-overload]
    assert best.evidence["total"] <= best.evidence["preset_total"]  # type: ignore[operator]
    again = tune(sessions, out, "--parameters", space, "--set", "min_seen=2", "--format", "json")
    assert "15 runs, 15 of them known before" in again.stderr
    rows = json.loads(again.stdout)["rows"]
    assert rows[0]["Total"] == best.evidence["total"]
    session = sessions / "run0"
    used = run("slam", session, "--preset", out / "best.yaml", "--set", "min_seen=1")
    assert used.exit_code == 0, used.exception
    config = Session.open(session).estimate("ekf").provenance["config"]
    assert isinstance(config, dict)
    assert config["min_seen"] == 1
    assert config["accept_gate"] == best.settings.get("accept_gate", 9.21)


def test_the_same_search_in_processes_gives_the_same_files(sessions: Path, tmp_path: Path) -> None:
    words = ("--parameters", "accept_gate={min: 4, max: 12}", "--runs", 2)
    one = tune(sessions, tmp_path / "one", *words)
    two = run("slam", "tune", sessions, "--jobs", 2, "-o", tmp_path / "two", *words)
    assert (one.exit_code, two.exit_code) == (0, 0), two.exception
    for name in ("table.csv", "best.yaml"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_a_run_that_fails_is_listed_and_the_rest_is_ranked(sessions: Path, tmp_path: Path) -> None:
    (sessions / "run1" / "car.mcap").write_bytes(b"no log")
    done = tune(sessions, tmp_path / "out", "--parameters", "accept_gate=6")
    assert isinstance(done.exception, TracksideError)
    lines = str(done.exception).splitlines()
    assert lines[0] == "2 of 6 runs gave no score:"
    assert lines[1].startswith("run1 ekf set 0 seed 0: ")
    assert "no MCAP file" in lines[1]
    assert (tmp_path / "out" / "best.yaml").exists()


def test_where_nothing_was_scored_nothing_is_best(tmp_path: Path) -> None:
    session = make_session(tmp_path / "run")
    (session / "car.mcap").write_bytes(b"no log")
    done = tune(session, tmp_path / "out", "--parameters", "accept_gate=6")
    assert "2 of 2 runs gave no score" in str(done.exception)
    assert not (tmp_path / "out" / "best.yaml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--parameters", "accept_gat=1"), "did you mean 'accept_gate'"),
        (("--parameters", "accept_gate=1", "--algorithms", "efk"), "ekf"),
        (("--parameters", "accept_gate=1", "--algorithms", ","), "name at least one"),
        (("--parameters", "accept_gate=1", "--scheduler", "tcp://x:1"), "--jobs is for"),
        (("--parameters", "accept_gate=1", "--cutoff", "-1"), "--cutoff"),
    ],
)
def test_a_wrong_word_is_told_before_any_run(
    sessions: Path, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    refused = tune(sessions, tmp_path / "out", *words)
    assert isinstance(refused.exception, UsageError)
    assert message in str(refused.exception)
    assert not (tmp_path / "out").exists()


def test_a_session_without_truth_is_named(sessions: Path, tmp_path: Path) -> None:
    make_session(sessions / "bare", truth=False)
    refused = tune(sessions, tmp_path / "out", "--parameters", "accept_gate=6")
    assert isinstance(refused.exception, MissingStreamError)
    assert "bare" in str(refused.exception)


def test_a_preset_file_of_another_algorithm_is_refused(sessions: Path, tmp_path: Path) -> None:
    tune(sessions, tmp_path / "out", "--parameters", "accept_gate=6")
    best = tmp_path / "out" / "best.yaml"
    refused = run("slam", sessions / "run0", "--preset", best, "--algorithm", "fastslam")
    assert isinstance(refused.exception, UsageError)
    assert "is a preset of ekf" in str(refused.exception)
    best.write_text(best.read_text().replace("algorithm: ekf", "algo: ekf"))
    wrong = run("slam", sessions / "run0", "--preset", best)
    assert isinstance(wrong.exception, TracksideError)
    assert "best.yaml:2:1: algo" in str(wrong.exception)
    newer = tmp_path / "newer.yaml"
    newer.write_text("format: 2\nalgorithm: ekf\npreset: robust\n")
    refused = run("slam", sessions / "run0", "--preset", newer)
    assert "has format 2" in str(refused.exception)


def test_both_commands_answer_to_help() -> None:
    assert "--parameters" in run("slam", "tune", "--help").output
    assert "trackside slam tune [OPTIONS] SESSIONS" in run("slam", "tune", "--help").output
    assert "--follow" in run("slam", "--help").output
    assert "slam tune" in run("--help").output
