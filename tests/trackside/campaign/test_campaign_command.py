"""`trackside campaign` as a person calls it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from fake_steps import SMALL, Campaign, campaign_in

from capture import ConfigurationError
from dialogue import UsageError
from trackside.cli import trackside
from trackside.shipped import example_campaigns

REPOSITORY = Path(__file__).parent.parent.parent.parent


@pytest.fixture
def run_campaign(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Campaign:
    return campaign_in(monkeypatch, tmp_path)


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, ["campaign", *map(str, words)])


def test_the_means_are_printed_with_those_of_the_thesis(run_campaign: Campaign) -> None:
    done = run_campaign(SMALL, "--format", "json")
    assert done.exit_code == 0, done.exception
    *table, last = done.stdout.splitlines()
    rows = json.loads("\n".join(table))["rows"]
    assert [(row["preset"], row["algorithm"], row["runs"]) for row in rows] == [
        ("thesis", "ekf", 2),
        ("thesis", "fastslam", 2),
        ("robust", "ekf", 2),
    ]
    assert [row["thesis Total [m]"] for row in rows] == [3.086, 6.542, 3.086]
    assert last.endswith("report.html")


def test_a_shipped_campaign_is_found_by_its_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert set(example_campaigns()) == {"thesis"}
    refused = call("thesi")
    assert isinstance(refused.exception, UsageError)
    assert "thesi: neither a file nor a campaign of trackside; did you mean 'thesis'" in str(
        refused.exception
    )
    # A file of that name goes before.
    (tmp_path / "thesis").write_text("runs: []\n")
    assert "thesis:1:1" in str(call("thesis").exception)
    (tmp_path / "thesis").unlink()
    both = call("thesis", "--workers", 2, "--scheduler", "tcp://127.0.0.1:9")
    assert isinstance(both.exception, UsageError)
    assert "--workers is for this machine" in str(both.exception)
    assert not any(tmp_path.iterdir())


def test_what_is_shipped_is_in_the_wheel() -> None:
    project = (REPOSITORY / "pyproject.toml").read_text(encoding="utf-8")
    for file in example_campaigns().values():
        assert f'"examples/{file.name}" = "trackside/examples/{file.name}"' in project


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    refused = call(tmp_path / "no.yaml")
    assert isinstance(refused.exception, ConfigurationError)
    assert "no.yaml" in str(refused.exception)


def test_the_output_goes_where_it_is_asked_to(run_campaign: Campaign, tmp_path: Path) -> None:
    done = run_campaign(SMALL, "-o", "elsewhere")
    assert done.stdout.rstrip().endswith("wrote elsewhere/report.html")
    assert (tmp_path / "elsewhere" / "report.html").exists()
    assert not (tmp_path / "out").exists()


def test_a_worker_of_another_software_refuses(
    run_campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    from trackside.campaign import work

    told = iter(["one", "one", "one"])
    monkeypatch.setattr(work, "software_now", lambda: next(told, "another"))
    refused = run_campaign()
    assert "this worker runs another, the job was made by one" in str(refused.exception)


def test_steps_are_the_commands_of_trackside(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The words that each step says, against the commands that there are."""
    import click

    from scoring import ScoreOptions
    from trackside.campaign import steps
    from trackside.campaign.plan import Drive, RunPlan
    from trackside.cli import COMMANDS

    said: list[list[str]] = []
    monkeypatch.setattr(steps, "command", lambda _, *words: said.append([str(w) for w in words]))
    drive = Drive("turn_low_1", "turn", "low", 1, seed=7)
    folder = tmp_path / "turn_low_1"
    run = RunPlan(algorithm="ekf", odometry="viso", association="nearest", smooth=True)
    place = steps.Place(drive, folder, folder / "run", tmp_path / "morning", ScoreOptions(), run)
    for step in (steps.calibrate, steps.simulate, steps.join, steps.slam):
        step(place)
    for words in said:
        assert words[0] in COMMANDS
        found = trackside.get_command(click.Context(trackside), words[0])
        assert found is not None
        found.make_parser(click.Context(found)).parse_args(words[1:])
    assert said[1][:9] == [
        *("simulate", "--map", "turn", "--power", "low", "--trial", "1", "--seed", "7"),
    ]
