"""Nothing is done twice, nothing wrong is kept, one fault stops no other session."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import fake_steps
import pytest
from fake_steps import (
    BAD,
    SMALL,
    TEXT,
    Campaign,
    campaign_in,
    make_session,
    notes,
    steps_of,
)

from capture import Session
from dialogue import TracksideError
from trackside.campaign.steps import Place
from trackside.fingerprints import rooms_digest

ROBUST = "  - {algorithm: ekf, preset: robust, odometry: wheel}\n"


@pytest.fixture
def run_campaign(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Campaign:
    return campaign_in(monkeypatch, tmp_path)


def test_a_rerun_redoes_nothing(run_campaign: Campaign, tmp_path: Path) -> None:
    first = run_campaign()
    assert first.exit_code == 0, first.exception
    assert steps_of(first) == {"done": 20, "known": 0}
    done, page = notes(tmp_path / "out"), (tmp_path / "out" / "report.html").read_bytes()
    assert done.count("morning: calibrate") == 1
    assert len(done) == 21
    stamp = (tmp_path / "out" / "report.html").stat().st_mtime_ns
    again = run_campaign()
    assert steps_of(again) == {"done": 0, "known": 20}
    assert notes(tmp_path / "out") == done
    assert (tmp_path / "out" / "report.html").stat().st_mtime_ns == stamp
    (tmp_path / "out" / "report.html").unlink()
    assert "wrote" in run_campaign().stdout
    assert (tmp_path / "out" / "report.html").read_bytes() == page


@pytest.mark.parametrize(
    ("before", "after", "redone"),
    [
        (
            "odometry: wheel}",
            "odometry: wheel, smooth: true}",
            {"slam robust-ekf", "score robust-ekf"},
        ),
        ("particles: 20", "particles: 21", {"slam thesis-fastslam", "score thesis-fastslam"}),
        ("resamples: 200", "resamples: 300", set()),
        (
            "resamples",
            "scoring: {align: path}\nresamples",
            {"score thesis-ekf", "score thesis-fastslam", "score robust-ekf"},
        ),
    ],
)
def test_a_change_redoes_what_depends_on_it(
    run_campaign: Campaign, tmp_path: Path, before: str, after: str, redone: set[str]
) -> None:
    run_campaign()
    done = notes(tmp_path / "out")
    changed = run_campaign(SMALL.replace(before, after))
    assert changed.exit_code == 0, changed.exception
    new = [line for line in notes(tmp_path / "out") if line not in done]
    more = sorted(notes(tmp_path / "out"))
    for line in done:
        more.remove(line)
    assert not new
    assert set(more) == {f"turn_{p}_1: {step}" for p in ("low", "high") for step in redone}
    assert "wrote" in changed.stdout


def test_another_seed_makes_the_sessions_anew(run_campaign: Campaign, tmp_path: Path) -> None:
    run_campaign()
    session = tmp_path / "out" / "sessions" / "turn_low_1" / "run"
    before = Session.open(session).observations().range_m.copy()
    other = run_campaign(SMALL.replace("seed: 5", "seed: 6"))
    assert steps_of(other) == {"done": 20, "known": 0}
    assert (
        before.shape != (now := Session.open(session).observations().range_m).shape
        or not (before == now).all()
    )


def test_more_sessions_leave_the_others_alone(run_campaign: Campaign, tmp_path: Path) -> None:
    run_campaign()
    more = run_campaign(SMALL.replace("trials: 1", "trials: 2"))
    assert steps_of(more) == {"done": 20, "known": 20}
    assert notes(tmp_path / "out").count("turn_low_1: join") == 1


def test_changed_code_redoes_its_steps(
    run_campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_campaign()

    def changed(rooms: tuple[str, ...]) -> str:
        return rooms_digest(rooms) + ("x" if "scoring" in rooms and "slam" not in rooms else "")

    monkeypatch.setattr("trackside.campaign.work.rooms_digest", changed)
    assert steps_of(run_campaign()) == {"done": 6, "known": 14}


def test_what_is_lost_is_made_again(run_campaign: Campaign, tmp_path: Path) -> None:
    run_campaign()
    out = tmp_path / "out"
    (out / "sessions" / "turn_low_1" / "run" / "scores" / "robust-ekf.json").unlink()
    assert steps_of(run_campaign()) == {"done": 1, "known": 19}
    (out / "state" / "turn_high_1.json").write_text("{")
    assert steps_of(run_campaign()) == {"done": 10, "known": 10}


def test_a_failed_session_stops_no_other_and_is_tried_again(
    run_campaign: Campaign, tmp_path: Path
) -> None:
    (tmp_path / BAD).write_text("turn_low_1 loop_high_2")
    failed = run_campaign(TEXT)
    assert isinstance(failed.exception, TracksideError)
    lines = str(failed.exception).splitlines()
    assert lines[0].startswith("2 of 8 sessions are not whole; the same command goes on")
    assert lines[1].startswith("turn_low_1: join: ")
    assert "the clocks do not meet; its log is" in lines[1]
    log = tmp_path / "out" / "logs" / "turn_low_1.log"
    assert str(log) in lines[1]
    assert "the clocks do not meet" in log.read_text()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "What is missing" in page
    assert "1 missing" in page
    (tmp_path / BAD).unlink()
    mended = run_campaign(TEXT)
    assert mended.exit_code == 0, mended.exception
    assert steps_of(mended) == {"done": 18, "known": 62}
    assert "What is missing" not in (tmp_path / "out" / "report.html").read_text()
    assert "joined car and film" in log.read_text()


def test_a_run_that_fails_leaves_the_others_of_its_session(
    run_campaign: Campaign, tmp_path: Path
) -> None:
    failed = run_campaign(SMALL.replace("odometry: wheel", "odometry: nothere"))
    told = str(failed.exception)
    assert "2 of 2 sessions are not whole" in told
    assert "slam robust-ekf: " in told
    assert "score robust-ekf: slam robust-ekf failed" in told
    assert "thesis" not in told.replace("thesis-", "")
    assert "thesis-ekf" in json.dumps(
        [p.stem for p in sorted((tmp_path / "out").rglob("scores/*.json"))]
    )
    assert (tmp_path / "out" / "report.html").exists()


def test_where_nothing_was_scored_there_is_no_report(
    run_campaign: Campaign, tmp_path: Path
) -> None:
    (tmp_path / BAD).write_text("turn_low_1 turn_high_1")
    failed = run_campaign()
    assert isinstance(failed.exception, TracksideError)
    assert failed.stdout == ""
    assert not (tmp_path / "out" / "report.html").exists()


def test_a_shared_step_that_fails_ends_it(
    run_campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: Place) -> None:
        raise TracksideError("no boards were seen")

    monkeypatch.setattr("trackside.campaign.work.SHARED", {"calibrate": broken})
    failed = run_campaign()
    assert "morning: no boards were seen; its log is" in str(failed.exception)


@pytest.mark.parametrize("at", ["turn_high_1: score thesis-ekf", "turn_low_1: slam robust-ekf"])
def test_an_interruption_loses_only_the_step_at_hand(
    run_campaign: Campaign, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, at: str
) -> None:
    whole = fake_steps._note

    def interrupted(place: Place, what: str) -> None:
        whole(place, what)
        if f"{place.drive.name}: {what}" == at:
            raise KeyboardInterrupt

    monkeypatch.setattr(fake_steps, "_note", interrupted)
    stopped = run_campaign()
    assert stopped.exit_code == 1
    assert "steps done" not in stopped.stdout
    done = notes(tmp_path / "out")
    monkeypatch.setattr(fake_steps, "_note", whole)
    resumed = run_campaign()
    assert resumed.exit_code == 0, resumed.exception
    # Each step was done once, the one at hand twice.
    again = notes(tmp_path / "out")
    assert set(done) <= set(again)
    assert (len(again), len(set(again)), again.count(at)) == (22, 21, 2)


def test_cores_give_the_same_as_one_process(run_campaign: Campaign, tmp_path: Path) -> None:
    one = run_campaign(SMALL)
    two = run_campaign(SMALL, "-o", "two", workers=2)
    assert (one.exit_code, two.exit_code) == (0, 0), two.exception
    pages = [(tmp_path / name / "report.html").read_bytes() for name in ("out", "two")]
    assert pages[0] == pages[1]


def kills_its_process(place: Place) -> None:
    """As a lack of memory does."""
    if place.drive.power == "high":
        os.kill(os.getpid(), signal.SIGKILL)
    fake_steps.join(place)


def test_a_session_that_kills_its_process_is_a_failure_of_its_own(
    run_campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = {**fake_steps.STEPS, "join": kills_its_process}
    monkeypatch.setattr("trackside.campaign.work.STEPS", table)
    failed = run_campaign(SMALL, workers=2)
    assert "1 of 2 sessions are not whole" in str(failed.exception)
    assert "turn_high_1: its process died" in str(failed.exception)


def test_a_cluster_gives_the_same(run_campaign: Campaign, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    run_campaign(SMALL)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, protocol="tcp", dashboard_address=None
    ) as cluster:
        words = ("--scheduler", cluster.scheduler_address, "-o", "far")
        far = run_campaign(SMALL, *words, workers=None)
    assert far.exit_code == 0, far.exception
    assert steps_of(far) == {"done": 20, "known": 0}
    pages = [(tmp_path / name / "report.html").read_bytes() for name in ("out", "far")]
    assert pages[0] == pages[1]
    assert "joined car and film" in (tmp_path / "far" / "logs" / "turn_low_1.log").read_text()


def recorded(folder: Path) -> str:
    for trial, power in enumerate(("low", "low", "high", "high"), start=1):
        make_session(folder / "mine" / f"day{trial}", "turn", power, trial, trial)
    return f"sessions: mine\noutput: out\nruns:\n{ROBUST}resamples: 200\n"


def test_recorded_sessions_are_estimated_where_they_lie(
    run_campaign: Campaign, tmp_path: Path
) -> None:
    text = recorded(tmp_path)
    done = run_campaign(text)
    assert done.exit_code == 0, done.exception
    assert steps_of(done) == {"done": 12, "known": 0}
    assert Session.open(tmp_path / "mine" / "day1").estimates == ("robust-ekf",)
    assert steps_of(run_campaign(text)) == {"done": 0, "known": 12}
    # A truth that was corrected changes the score alone.
    cones = tmp_path / "mine" / "day2" / "ground_truth" / "cones.csv"
    cones.write_text("\n".join(cones.read_text().splitlines()[:-1]) + "\n")
    assert steps_of(run_campaign(text)) == {"done": 1, "known": 11}
    again = run_campaign(text.replace("wheel}", "wheel, smooth: true}"))
    assert steps_of(again) == {"done": 8, "known": 4}


def test_an_estimate_of_somebody_else_is_not_replaced(
    run_campaign: Campaign, tmp_path: Path
) -> None:
    text = recorded(tmp_path)
    session = Session.open(tmp_path / "mine" / "day1")
    run_campaign(text)
    theirs = session.folder / "estimates" / "robust-ekf" / "path.tum"
    (tmp_path / "out" / "state" / "day1.json").unlink()
    before = theirs.stat().st_mtime_ns
    for _ in range(2):
        refused = run_campaign(text)
        assert "that this campaign did not make" in str(refused.exception)
        assert theirs.stat().st_mtime_ns == before
