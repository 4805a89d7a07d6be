"""What a campaign file says, and every fault of it with its line."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_steps import make_session

from capture import ConfigurationError, SessionError
from dialogue import UsageError
from trackside.campaign.plan import (
    MAPS,
    POWERS,
    Campaign,
    drives_of,
    read_campaign,
    seed_of,
)
from trackside.shipped import example_campaigns

RUNS = "runs: [{algorithm: ekf}]\n"


def read(folder: Path, text: str) -> Campaign:
    file = folder / "mine.yaml"
    file.write_text(text)
    return read_campaign(file)


def test_the_shipped_campaign_is_the_experiment_of_the_thesis() -> None:
    plan = read_campaign(example_campaigns()["thesis"])
    drives = drives_of(plan)
    assert len(drives) == 27
    assert {(d.map, d.power, d.trial) for d in drives} == {
        (name, power, trial) for name in MAPS for power in POWERS for trial in (1, 2, 3)
    }
    assert [run.name for run in plan.runs] == [
        *("thesis-ekf", "thesis-fastslam", "robust-ekf", "robust-fastslam")
    ]
    assert [run.odometry for run in plan.runs] == ["viso", "viso", *["imu+viso"] * 2]
    assert [run.needs_film for run in plan.runs] == [True, True, True, True]
    assert plan.scoring.choices()["align"] == "origin"
    assert drives[0].dataset == "Low-1"


def test_every_session_has_a_seed_of_its_own_that_others_do_not_change(tmp_path: Path) -> None:
    whole = drives_of(read(tmp_path, f"simulate: {{seed: 3}}\n{RUNS}"))
    seeds = {drive.name: drive.seed for drive in whole}
    assert len(set(seeds.values())) == 27
    part = drives_of(read(tmp_path, f"simulate: {{maps: [loop], trials: 1, seed: 3}}\n{RUNS}"))
    assert {d.name: d.seed for d in part}.items() <= seeds.items()
    assert seeds["loop_high_1"] == seed_of(3, "loop", "high", 1)
    other = drives_of(read(tmp_path, f"simulate: {{seed: 4}}\n{RUNS}"))
    assert not set(seeds.values()) & {drive.seed for drive in other}


def test_names_follow_from_preset_and_algorithm(tmp_path: Path) -> None:
    plan = read(
        tmp_path,
        "simulate: {}\nbaseline: smooth\nruns:\n"
        "  - {algorithm: ekf}\n  - {algorithm: ekf, name: smooth, smooth: true}\n"
        "  - {algorithm: ekf, preset: thesis}\n",
    )
    assert [run.name for run in plan.runs] == ["robust-ekf", "smooth", "thesis-ekf"]
    # Where the algorithm is not enough to tell two runs apart, their names do.
    assert dict(plan.labels) == {
        "robust-ekf": "robust-ekf",
        "smooth": "smooth",
        "thesis-ekf": "ekf",
    }
    assert {name: len(runs) for name, runs in plan.groups.items()} == {"robust": 2, "thesis": 1}
    assert plan.output == Path("mine")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("simulate: {}\nruns:\n  - {algorithm: efk}\n", "mine.yaml:3:5: runs[0]: .*'ekf'"),
        ("simulate: {}\nruns:\n  - {algorithm: ekf, preset: best}\n", "mine.yaml:3:5: .*preset"),
        (
            "simulate: {}\nruns:\n  - {algorithm: ekf, settings: {accept_gat: 3}}\n",
            "mine.yaml:3:5: .*did you mean 'accept_gate'",
        ),
        ("simulate: {map: [turn]}\n" + RUNS, "mine.yaml:1:12: simulate.map: .*'maps'"),
        ("simulate: {maps: [tirn]}\n" + RUNS, "mine.yaml:1:18: simulate.maps: .*'turn'"),
        ("simulate: {trials: 0}\n" + RUNS, "mine.yaml:1:20: simulate.trials: 0 is too small"),
        ("simulate: {maps: []}\n" + RUNS, "maps is empty"),
        ("simulate: {maps: [turn, turn]}\n" + RUNS, "maps names one twice"),
        (
            "simulate: {}\nscoring: {alignn: path}\n" + RUNS,
            "mine.yaml:2:11: .*did you mean 'align'",
        ),
        ("simulate: {}\nscoring: {cutoff_m: -1}\n" + RUNS, "mine.yaml:2:10: scoring: --cutoff"),
        ("simulate: {}\nscoring: {space: 3d}\n" + RUNS, "a session is planar"),
        ("simulate: {}\nsessions: here\n" + RUNS, "give either simulate"),
        (RUNS, "give either simulate"),
        ("simulate: {}\nruns: []\n", "runs is empty"),
        ("simulate: {}\nruns: [{algorithm: ekf}, {algorithm: ekf}]\n", "two runs are named"),
        ("simulate: {}\nbaseline: fastslam\n" + RUNS, "expected one of ekf"),
        ("simulate: {}\nreport: a/b.html\n" + RUNS, "expected a name as report.html"),
        ("format: 2\nsimulate: {}\n" + RUNS, "has format 2"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message.replace("[0]", r"\[0\]")):
        read(tmp_path, text)


def test_a_preset_file_stands_beside_the_campaign(tmp_path: Path) -> None:
    (tmp_path / "best.yaml").write_text("algorithm: ekf\npreset: robust\n")
    runs = "runs: [{algorithm: ekf, preset: best.yaml}]\n"
    plan = read(tmp_path, f"simulate: {{}}\n{runs}")
    assert plan.runs[0].preset == str((tmp_path / "best.yaml").resolve())
    assert (plan.runs[0].name, plan.runs[0].group) == ("best-ekf", "best")
    with pytest.raises(ConfigurationError, match="is a preset of ekf, not of fastslam"):
        read(tmp_path, f"simulate: {{}}\n{runs.replace('ekf', 'fastslam')}")


def test_recorded_sessions_bring_their_own_names(tmp_path: Path) -> None:
    for trial in (1, 2):
        make_session(tmp_path / "all" / f"day{trial}", "turn", "low", trial, trial)
    plan = read(tmp_path, f"sessions: all\n{RUNS}")
    drives = drives_of(plan)
    assert [(d.name, d.map, d.dataset, d.seed) for d in drives] == [
        ("day1", "turn", "Low-1", None),
        ("day2", "turn", "Low-2", None),
    ]
    make_session(tmp_path / "all" / "day3", "turn", "low", 2, 3)
    with pytest.raises(UsageError, match=r"day2 and .*day3 are both turn Low-2; correct the trial"):
        drives_of(plan)
    with pytest.raises(SessionError, match="nowhere"):
        drives_of(read(tmp_path, f"sessions: nowhere\n{RUNS}"))
