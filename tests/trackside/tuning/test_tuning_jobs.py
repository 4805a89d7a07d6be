"""Runs that are named by what decides them, kept, and done anywhere."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from driven_sessions import make_session, make_sessions

from capture import MissingStreamError
from dialogue import TracksideError, UsageError
from scoring import ScoreOptions
from slam.algorithms import Request
from trackside.tuning.jobs import (
    Job,
    Outcome,
    ResultStore,
    attempt,
    full_software,
    run_job,
)
from trackside.tuning.plan import planned
from trackside.tuning.ranking import Run, best_preset, standings, table
from trackside.tuning.search import listed_runs, searched, sessions_with_truth
from trackside.tuning.space import parsed_space
from trackside.workers import Failure, on_cluster, on_cores
from trackside.workers import one_after_the_other as all_in_turn

OPTIONS = ScoreOptions()


def one_after_the_other(jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome | Failure]]:
    return all_in_turn(jobs, attempt)


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    return make_sessions(tmp_path / "sessions")


def runs_of(folder: Path, *words: str, seeds: int = 1, algorithm: str = "ekf") -> list[Run]:
    request = Request(algorithm=algorithm)
    plan = planned(parsed_space(words or ["accept_gate=6,12"]), [request], None, 0)
    return listed_runs(sessions_with_truth([folder]), plan, seeds, OPTIONS)


def values(results: dict[str, Outcome | Failure]) -> dict[str, object]:
    """Results without the time they took."""
    return {
        key: replace(result, work_s=0.0) if isinstance(result, Outcome) else result
        for key, result in results.items()
    }


def test_a_job_is_named_by_everything_that_decides_it() -> None:
    job = Job("a", "digest", Request(), OPTIONS, "software")
    others = [
        replace(job, digest="other"),
        replace(job, request=Request(seed=1)),
        replace(job, request=Request(settings=("accept_gate=6",))),
        replace(job, request=Request(algorithm="fastslam")),
        replace(job, request=Request(preset="thesis")),
        replace(job, request=Request(odometry="imu+vesc")),
        replace(job, options=ScoreOptions(align="path")),
        replace(job, software="newer"),
    ]
    assert len({one.key for one in [job, *others]}) == 9
    assert replace(job, session="moved elsewhere").key == job.key


def test_a_session_is_known_by_its_log_and_truth(sessions: Path) -> None:
    before = {run.job.key for run in runs_of(sessions)}
    (sessions / "run0" / "notes.txt").write_text("windy")
    (sessions / "run0" / "estimates").mkdir()
    sessions.rename(sessions.with_name("moved"))
    moved = sessions.with_name("moved")
    assert {run.job.key for run in runs_of(moved)} == before
    truth = moved / "run0" / "ground_truth" / "cones.csv"
    truth.write_text(truth.read_text().replace("0.8", "0.9"))
    assert len({run.job.key for run in runs_of(moved)} & before) == len(before) * 2 // 3


def test_a_rerun_does_nothing_again(sessions: Path, tmp_path: Path) -> None:
    runs, store = runs_of(sessions), ResultStore(tmp_path / "out")
    told: list[int] = []
    first = searched(runs, store, one_after_the_other, told.append)
    assert (len(first.results), first.known_before, told) == (9, 0, [0, *[1] * 9])

    def none(jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome | Failure]]:
        raise AssertionError(f"{len(jobs)} jobs were asked for")

    again = searched(runs, store, none)
    assert (again.results, again.known_before) == (first.results, 9)


@pytest.mark.parametrize("after", [0, 1, 4])
def test_a_killed_search_loses_at_most_what_was_at_hand(
    sessions: Path, tmp_path: Path, after: int
) -> None:
    runs, store = runs_of(sessions), ResultStore(tmp_path / "out")

    def killed(jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome | Failure]]:
        yield from one_after_the_other(jobs[:after])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        searched(runs, store, killed)
    asked: list[Job] = []

    def noting(jobs: Sequence[Job]) -> Iterator[tuple[Job, Outcome | Failure]]:
        asked.extend(jobs)
        return one_after_the_other(jobs)

    whole = searched(runs, store, noting)
    assert (len(asked), whole.known_before) == (9 - after, after)
    fresh = searched(runs, ResultStore(tmp_path / "fresh"), one_after_the_other)
    assert values(dict(whole.results)) == values(dict(fresh.results))


def test_a_result_that_cannot_be_read_is_made_again(sessions: Path, tmp_path: Path) -> None:
    runs, store = runs_of(sessions), ResultStore(tmp_path / "out")
    searched(runs, store, one_after_the_other)
    files = sorted((tmp_path / "out" / "jobs").iterdir())
    files[0].write_text('{"total": 1')
    files[1].write_text("[]")
    assert searched(runs, store, one_after_the_other).known_before == 7


def test_one_job_that_fails_does_not_stop_the_others(sessions: Path, tmp_path: Path) -> None:
    runs = runs_of(sessions)
    (sessions / "run1" / "car.mcap").write_bytes(b"no log")
    store = ResultStore(tmp_path / "out")
    found = searched(runs, store, one_after_the_other)
    failures = [r for r in found.results.values() if isinstance(r, Failure)]
    assert len(failures) == 3
    assert "no MCAP file" in failures[0].why
    # It is not kept, so that it is tried again.
    assert searched(runs, store, one_after_the_other).known_before == 6
    ranked = standings(runs, found.results)
    assert [(one.runs, one.failed) for one in ranked] == [(2, 1)] * 3


def test_a_fault_of_ours_is_a_failure_of_its_job(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: Job) -> Outcome:
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr("trackside.tuning.jobs.run_job", broken)
    job = Job("a", "digest", Request(), OPTIONS, "software")
    assert attempt(job) == Failure("a fault of trackside: ZeroDivisionError: by nothing")


def test_a_worker_of_another_software_refuses(sessions: Path) -> None:
    job = runs_of(sessions)[0].job
    assert run_job(job).total is not None
    with pytest.raises(TracksideError, match="install the same trackside"):
        run_job(replace(job, software="trackside 9"))
    assert full_software().startswith("trackside ")
    assert "numpy" in full_software()


def test_cores_and_one_after_the_other_give_the_same(sessions: Path) -> None:
    runs = runs_of(sessions, "particles=20", algorithm="fastslam", seeds=2)
    jobs = [run.job for run in runs]
    assert len({job.key for job in jobs}) == 12
    serial = {job.key: result for job, result in one_after_the_other(jobs)}
    parallel = {job.key: result for job, result in on_cores(jobs, 2, attempt)}
    assert values(parallel) == values(serial)
    assert all(isinstance(result, Outcome) for result in serial.values())
    assert "OPENBLAS_NUM_THREADS" not in os.environ or os.environ["OPENBLAS_NUM_THREADS"] != "1"


def dies_of_seed_3(job: Job) -> Outcome | Failure:
    """Work that ends its process as a lack of memory does."""
    if job.request.seed == 3:
        os._exit(9)
    threads = os.environ.get("NUMBA_NUM_THREADS")
    return Outcome(float(job.request.seed), {"threads": float(threads or 0)}, 0.0)


def test_a_job_that_kills_its_process_is_a_failure_of_its_own() -> None:
    jobs = [Job("a", "digest", Request(seed=k), OPTIONS, "software") for k in range(9)]
    found = {job.request.seed: result for job, result in on_cores(jobs, 2, dies_of_seed_3)}
    assert sorted(found) == list(range(9))
    (dead,) = (seed for seed, result in found.items() if isinstance(result, Failure))
    assert dead == 3
    assert all(
        result.errors == {"threads": 1.0}
        for result in found.values()
        if isinstance(result, Outcome)
    )


def test_a_cluster_gives_the_same(sessions: Path) -> None:
    distributed = pytest.importorskip("distributed")
    runs = runs_of(sessions)
    jobs = [run.job for run in runs]
    with distributed.LocalCluster(
        n_workers=2, processes=False, protocol="tcp", dashboard_address=None
    ) as cluster:
        assert cluster.scheduler_address.startswith("tcp://")
        found = {
            job.key: result for job, result in on_cluster(jobs, cluster.scheduler_address, attempt)
        }
    serial = {job.key: result for job, result in one_after_the_other(jobs)}
    assert values(found) == values(serial)


def test_without_the_extra_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(UsageError, match=r"pip install 'trackside\[cluster\]'"):
        list(on_cluster([], "tcp://localhost:1", attempt))


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("trackside.workers.CONNECT_S", 0.3)
    with pytest.raises(TracksideError, match=r"no scheduler answered.*dask scheduler"):
        list(on_cluster([], "tcp://127.0.0.1:9", attempt))


def test_sessions_without_truth_are_all_named(tmp_path: Path) -> None:
    make_sessions(tmp_path, 1)
    for name in ("bare1", "bare2"):
        make_session(tmp_path / name, truth=False)
    with pytest.raises(MissingStreamError, match=r"no ground truth in .*bare1, .*bare2:"):
        sessions_with_truth([tmp_path])
    twice = sessions_with_truth([tmp_path / "run0", tmp_path / "run0"])
    assert len(twice) == 1


def fake(runs: Sequence[Run], totals: dict[int, list[float]]) -> dict[str, Outcome | Failure]:
    """Results by the number of the trial, one Total for each session in turn."""
    left = {number: list(own) for number, own in totals.items()}
    return {
        run.job.key: Outcome(total, {"pose": total / 10, "false_negatives": 0.0}, 0.0)
        for run in runs
        for total in [left[run.trial.number].pop(0)]
    }


def test_the_lowest_mean_is_first_and_its_evidence_is_kept(sessions: Path) -> None:
    runs = runs_of(sessions)
    results = fake(runs, {0: [1.0, 2.0, 3.0], 1: [0.1, 0.3, 0.2], 2: [9.0, 9.0, 9.5]})
    ranked = standings(runs, results)
    assert [one.trial.number for one in ranked] == [1, 0, 2]
    assert ranked[0].total == pytest.approx(0.2)
    assert ranked[0].errors["pose"] == pytest.approx(0.02)
    bounds = ranked[0].interval
    assert bounds is not None
    assert 0.1 <= bounds.low < 0.2 < bounds.high <= 0.3
    best = best_preset(ranked, {"sessions": 3})
    assert (best.algorithm, best.preset, dict(best.settings)) == (
        "ekf",
        "robust",
        {"accept_gate": 6},
    )
    assert best.words == ("accept_gate=6",)
    assert best.evidence["preset_total"] == pytest.approx(2.0)
    assert (best.evidence["sets_tried"], best.evidence["sessions"]) == (3, 3)
    shown = table(ranked, 3, 2)
    assert shown.columns[:3] == ("algorithm", "set", "accept_gate")
    assert [row[:3] for row in shown.rows] == [("ekf", 1, "6"), ("ekf", 0, ""), ("ekf", 2, "12")]
    assert "over the sessions" in shown.note
    assert "2 sets were left out" in shown.note


def test_an_incomplete_trial_comes_after_the_complete_ones(sessions: Path) -> None:
    runs = runs_of(sessions)
    results = fake(runs, {0: [1.0, 2.0, 3.0], 1: [0.1, 0.3, 0.2], 2: [9.0, 9.0, 9.5]})
    lost = next(run.job.key for run in runs if run.trial.number == 1)
    ranked = standings(runs, {**results, lost: Failure("gone")})
    assert [one.trial.number for one in ranked] == [0, 2, 1]
    assert ranked[-1].failed == 1
    undefined = {**results, lost: Outcome(None, {}, 0.0)}
    assert [one.total for one in standings(runs, undefined)][-1] is None


def test_seeds_of_one_session_are_not_sessions(tmp_path: Path) -> None:
    """A mean over sessions, each the mean of its seeds; resampled as such."""
    make_sessions(tmp_path, 3)
    runs = runs_of(tmp_path, "particles=20", algorithm="fastslam", seeds=4)
    results: dict[str, Outcome | Failure] = {
        run.job.key: Outcome(float(run.session[-1]) + run.job.request.seed, {}, 0.0) for run in runs
    }
    one = standings(runs, results)[0]
    assert one.runs == 12
    assert one.total == pytest.approx(1.0 + 1.5)
    few = [run for run in runs if run.session[-1] == "0"]
    bounds = standings(few, results)[0].interval
    assert bounds is not None
    assert 0.0 <= bounds.low < 1.5 < bounds.high <= 3.0
