"""A search: sessions times trials times seeds, done where they were not done before."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from capture import MissingStreamError, Session, list_sessions
from dialogue import UsageError
from scoring import ScoreOptions
from slam.algorithms import Request
from slam.catalogue import ALGORITHMS
from trackside.tuning.jobs import Job, Outcome, ResultStore, full_software, session_digest
from trackside.tuning.plan import Plan, Trial, seed_matters
from trackside.tuning.ranking import Run
from trackside.workers import Failure, Runner


@dataclass(frozen=True)
class Found:
    """What a search found: by job key; how many were there before."""

    results: Mapping[str, Outcome | Failure]
    known_before: int


def sessions_with_truth(paths: Sequence[Path]) -> list[Session]:
    """The sessions in the folders, each once.

    Raises `MissingStreamError` naming all that cannot be scored, `UsageError` for two of one name.
    """
    folders = dict.fromkeys(f.resolve() for path in paths for f in list_sessions(path))
    sessions = [Session.open(folder) for folder in folders]
    bare = [str(session.folder) for session in sessions if not session.has_ground_truth]
    if bare:
        raise MissingStreamError(
            f"no ground truth in {', '.join(bare)}: what they give cannot be scored; make it with "
            "trackside track, or leave them out"
        )
    return sessions


def listed_runs(
    sessions: Sequence[Session], plan: Plan, seeds: int, options: ScoreOptions
) -> list[Run]:
    """Every run, those of a session together; one seed where the algorithm draws no numbers."""
    software = full_software()
    digests = {session.folder: session_digest(session) for session in sessions}
    draws = {
        trial.request.algorithm: seed_matters(trial.request, _some_rule(trial.request))
        for trial in plan.trials
        if trial.number == 0
    }
    return [
        Run(
            trial,
            str(session.folder),
            Job(str(session.folder), digests[session.folder], request, options, software),
        )
        for session in sessions
        for trial in plan.trials
        for request in _seeded(trial, seeds if draws[trial.request.algorithm] else 1)
    ]


def searched(
    runs: Sequence[Run],
    store: ResultStore,
    runner: Runner[Job, Outcome],
    advance: Callable[[int], None] = lambda _: None,
) -> Found:
    """The result of every run; what the store has is not run again, what is new it keeps at once.

    `advance` is told of every job, those that were there before at once.
    """
    jobs = {run.job.key: run.job for run in runs}
    results: dict[str, Outcome | Failure] = {}
    for key, job in jobs.items():
        held = store.load(job)
        if held is not None:
            results[key] = held
    known_before = len(results)
    advance(known_before)
    waiting = [job for key, job in jobs.items() if key not in results]
    for job, result in runner(waiting) if waiting else ():
        if isinstance(result, Outcome):
            store.save(job, result)
        results[job.key] = result
        advance(1)
    return Found(results, known_before)


def requests_of(algorithms: str, base: Mapping[str, Any]) -> list[Request]:
    """One request for each algorithm of `a,b,...`; raises `UsageError` for words that name none."""
    names = dict.fromkeys(name.strip() for name in algorithms.split(",") if name.strip())
    if not names:
        raise UsageError("--algorithms: name at least one, as ekf,fastslam")
    return [Request(algorithm=name, **base) for name in names]


def _seeded(trial: Trial, seeds: int) -> list[Request]:
    return [replace(trial.request, seed=trial.request.seed + k) for k in range(seeds)]


def _some_rule(request: Request) -> str:
    return request.association or ALGORITHMS[request.algorithm].associations[-1]
