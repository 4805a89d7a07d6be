"""One run of SLAM and its score, named by everything that decides the result."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from capture import LogError, Session, software, write_text
from dialogue import TracksideError
from scoring import ERROR_NAMES, ScoreOptions, score
from slam.algorithms import Request, estimate_session
from slam.session_defaults import for_session
from trackside.fingerprints import files_digest, rooms_digest, told_libraries, values_digest
from trackside.workers import Failure

_DECIDING_ROOMS = ("geometry", "capture", "slam", "scoring")


@dataclass(frozen=True)
class Job:
    """A session (and the digest of its content), a request, the choices of the score.

    software : of who made the job; a worker with another refuses it.
    """

    session: str
    digest: str
    request: Request
    options: ScoreOptions
    software: str

    @property
    def key(self) -> str:
        """A name that is the same exactly where the result must be; the place does not matter."""
        return values_digest(self.deciding())

    def deciding(self) -> dict[str, object]:
        """Everything that decides the result."""
        return {
            "session": self.digest,
            "request": asdict(self.request),
            "scoring": self.options.choices(),
            "software": self.software,
        }


@dataclass(frozen=True)
class Outcome:
    """What a run scored: the Total (None where undefined) and the six errors; seconds of work."""

    total: float | None
    errors: Mapping[str, float | None]
    work_s: float


def run_job(job: Job) -> Outcome:
    """Run SLAM and score it; writes nothing and says nothing.

    Raises whatever SLAM and scoring raise, and `TracksideError` for a job of another software.
    """
    if job.software != full_software():
        raise TracksideError(
            f"this worker runs {full_software()}, the job was made by {job.software}; install the "
            "same trackside and libraries everywhere"
        )
    started_s = time.perf_counter()
    session = Session.open(Path(job.session))
    estimate, _, _ = estimate_session(session, for_session(job.request, session), quiet=True)
    result = score(session.ground_truth(), estimate, job.options)
    errors = {name: result.errors.get(name) for name in ERROR_NAMES}
    return Outcome(result.total, errors, time.perf_counter() - started_s)


def attempt(job: Job) -> Outcome | Failure:
    """The outcome, or why there is none: no job stops the others."""
    try:
        return run_job(job)
    except TracksideError as err:
        return Failure(str(err))
    except Exception as err:
        return Failure(f"a fault of trackside: {type(err).__name__}: {err}")


@cache
def full_software() -> str:
    """Version, the text of the rooms that decide results, and the libraries under them."""
    return f"{software()} ({rooms_digest(_DECIDING_ROOMS)[:12]}), {told_libraries()}"


class ResultStore:
    """One small file for each job that has an outcome, in the folder `jobs` of an output folder.

    A failure is not kept: it is tried again by the next search.
    """

    def __init__(self, output: Path) -> None:
        self._folder = output / "jobs"

    def load(self, job: Job) -> Outcome | None:
        """The outcome of a job; None where there is none, or none that can be read."""
        try:
            held = json.loads((self._folder / f"{job.key}.json").read_text(encoding="utf-8"))
            return Outcome(held["total"], held["errors"], held["work_s"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def save(self, job: Job, outcome: Outcome) -> None:
        """Keep the outcome; raises `LogError` when the disk does not take it."""
        content = {**asdict(outcome), "job": {"folder": job.session, **job.deciding()}}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as err:
            why = err.strerror or str(err)
            raise LogError(f"cannot write {self._folder}: {why}; choose another -o") from err
        text = json.dumps(content, indent=1, default=str)
        write_text(self._folder / f"{job.key}.json", text + "\n")


def session_digest(session: Session) -> str:
    """A digest of what decides a result in a session: its log and its truth.

    Raises `TextFileError` when a file cannot be read.
    """
    return files_digest(session.deciding_files)
