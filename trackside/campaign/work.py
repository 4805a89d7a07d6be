"""All steps of one session, in their order, each only where it must be done."""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TextIO

from capture import Session, software
from dialogue import TracksideError
from trackside.campaign.plan import VISUAL, Campaign, Drive, RunPlan
from trackside.campaign.state import State
from trackside.campaign.steps import CLEARING, ROOMS, SHARED, STEPS, Action, Place
from trackside.fingerprints import files_digest, rooms_digest, told_libraries, values_digest
from trackside.workers import Failure

MORNING = "morning"
"""The folder of what all simulated sessions share, and the name of the job that makes it."""


@dataclass(frozen=True)
class Task:
    """One step of a session.

    name : unique in the session; step : which of the table; needs : the tasks it builds upon;
    inputs : what decides the result besides those and the code; output : exists once it is done.
    """

    name: str
    step: str
    needs: tuple[str, ...]
    inputs: Mapping[str, object]
    output: Path
    run: RunPlan | None = None


@dataclass(frozen=True)
class SessionJob:
    """A session with all its tasks; `table` is what does the steps, `software` who made the job."""

    place: Place
    tasks: tuple[Task, ...]
    table: Mapping[str, Action]
    state: Path
    log: Path
    software: str

    @property
    def name(self) -> str:
        """Of the session."""
        return self.place.drive.name


@dataclass(frozen=True)
class Done:
    """What became of a session: tasks done now, done before, and why others were not."""

    made: tuple[str, ...]
    kept: tuple[str, ...]
    failed: Mapping[str, str]


def shared_job(output: Path, drives: Sequence[Drive], campaign: Campaign) -> SessionJob | None:
    """What is done before any session; None where nothing is, as for recorded ones."""
    if campaign.simulate is None or not SHARED:
        return None
    drive = replace(drives[0], name=MORNING)
    folder = output / MORNING
    place = Place(drive, folder, folder, folder, campaign.scoring)
    tasks = tuple(Task(step, step, (), {}, folder) for step in SHARED)
    return _job(place, tasks, SHARED, output)


def session_job(output: Path, drive: Drive, campaign: Campaign) -> SessionJob:
    """Everything that the campaign does with one session."""
    folder = drive.recorded or output / "sessions" / drive.name
    session = drive.recorded or folder / "run"
    place = Place(drive, folder, session, output / MORNING, campaign.scoring)
    return _job(place, tuple(_tasks(place, campaign)), STEPS, output)


def attempt(job: SessionJob) -> Done | Failure:
    """Do what is to be done; one task that fails stops only those that build upon it.

    Everything the steps say goes to the end of the log.
    """
    if job.software != software_now():
        return Failure(
            f"this worker runs {software_now()}, the job was made by {job.software}; install the "
            "same trackside and libraries everywhere"
        )
    try:
        job.log.parent.mkdir(parents=True, exist_ok=True)
        with job.log.open("a", encoding="utf-8") as log:
            return _done(job, log)
    except (OSError, TracksideError) as err:
        return Failure(str(err))


def done_before(job: SessionJob) -> Done | None:
    """What became of a session of which everything is there already; None where there is work."""
    state = State.of(job.state)
    keys: dict[str, str] = {}
    try:
        for task in job.tasks:
            keys[task.name] = key_of(job, task, keys)
            if not _is_made(task, state, keys):
                return None
    except TracksideError:
        # Whoever does the work finds the same, and tells it as the fault of this session.
        return None
    return Done((), tuple(keys), {})


def software_now() -> str:
    """What a worker must have in common with who sends it work."""
    rooms = tuple(sorted({room for rooms in ROOMS.values() for room in rooms}))
    return f"{software()} ({rooms_digest(rooms)[:12]}), {told_libraries()}"


def key_of(job: SessionJob, task: Task, keys: Mapping[str, str]) -> str:
    """The digest of everything that decides what a task makes, and so of all before it (`keys`)."""
    return values_digest(
        {
            "inputs": task.inputs,
            "needs": [keys[name] for name in task.needs] or _recording_digest(job.place.drive),
            "truth": _truth_digest(job.place.session) if task.step == "score" else "",
            "code": rooms_digest(ROOMS[task.step]),
            "software": [software(), told_libraries()],
        }
    )


def _tasks(place: Place, campaign: Campaign) -> Iterator[Task]:
    drive, session = place.drive, place.session
    before: tuple[str, ...] = ()
    if drive.recorded is None:
        what = {
            **{"map": drive.map, "power": drive.power, "trial": drive.trial, "seed": drive.seed},
            "shared": [rooms_digest(ROOMS[step]) for step in SHARED],
        }
        yield Task("simulate", "simulate", (), what, place.folder / "car")
        yield Task("join", "join", ("simulate",), {}, session / "session.yaml")
        before = ("join",)
    yield Task("track", "track", before, {}, session / "ground_truth" / "car.tum")
    if any(run.needs_film for run in campaign.runs):
        yield Task("vo", "vo", before, {}, session / "session.yaml")
    for run in campaign.runs:
        needs = (*before, "vo") if run.needs_film else before
        name = f"slam {run.name}"
        made = session / "estimates" / run.name / "path.tum"
        yield Task(name, "slam", needs, _run_inputs(run), made, run)
        kept = session / "scores" / f"{run.name}.json"
        choices = campaign.scoring.choices()
        yield Task(f"score {run.name}", "score", (name, "track"), choices, kept, run)


def _run_inputs(run: RunPlan) -> dict[str, object]:
    preset = Path(run.preset)
    text = files_digest([preset]) if preset.is_absolute() else run.preset
    return {**asdict(run), "preset": text}


def _job(
    place: Place, tasks: tuple[Task, ...], table: Mapping[str, Action], output: Path
) -> SessionJob:
    name = place.drive.name
    state, log = output / "state" / f"{name}.json", output / "logs" / f"{name}.log"
    return SessionJob(place, tasks, table, state, log, software_now())


def _done(job: SessionJob, log: TextIO) -> Done:
    state = State.of(job.state)
    keys: dict[str, str] = {}
    made: list[str] = []
    kept: list[str] = []
    failed: dict[str, str] = {}
    for task in job.tasks:
        keys[task.name] = key_of(job, task, keys)
        if _is_made(task, state, keys):
            kept.append(task.name)
            continue
        lost = next((name for name in task.needs if name in failed), None)
        why = f"{lost} failed" if lost else _attempted(job, task, state, log)
        if why is None:
            state.made(task.name, keys[task.name])
            made.append(task.name)
        else:
            failed[task.name] = why
    return Done(tuple(made), tuple(kept), failed)


def _is_made(task: Task, state: State, keys: Mapping[str, str]) -> bool:
    return state.keys.get(task.name) == keys[task.name] and task.output.exists()


def _attempted(job: SessionJob, task: Task, state: State, log: TextIO) -> str | None:
    """Do a task; why it failed, None where it did not."""
    again = task.name in state.keys
    state.begun(task.name)
    if task.step in CLEARING:
        later = [other.name for other in job.tasks]
        state.forget(later[later.index(task.name) + 1 :])
    place = replace(job.place, run=task.run, again=again, say=log.write)
    with _told(task.name, log) as told:
        try:
            job.table[task.step](place)
        except TracksideError as err:
            told.append(str(err))
        except Exception as err:
            told.append(f"a fault of trackside: {type(err).__name__}: {err}")
            traceback.print_exc()
        if not told and not task.output.exists():
            told.append(f"{task.output} did not come of it")
        return told[0] if told else None


@contextmanager
def _told(name: str, log: TextIO) -> Iterator[list[str]]:
    """Everything that is said within goes to the log, with how it ended: the list it yields."""
    started_s = time.perf_counter()
    faults: list[str] = []
    log.write(f"== {name} ({time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime())})\n")
    try:
        with redirect_stdout(log), redirect_stderr(log):
            yield faults
    finally:
        took = f"{time.perf_counter() - started_s:.1f} s"
        log.write(f"failed after {took}: {faults[0]}\n\n" if faults else f"took {took}\n\n")
        log.flush()


def _recording_digest(drive: Drive) -> str:
    """Of a recorded session what nobody computed: the car's log, the size of the stereo film."""
    if drive.recorded is None:
        return ""
    session = Session.open(drive.recorded)
    logs = [
        f for f in session.deciding_files if f.parent == drive.recorded and VISUAL not in f.name
    ]
    film = drive.recorded / "zed.mcap"
    return values_digest(
        {"logs": files_digest(logs), "film": film.exists() and film.stat().st_size}
    )


def _truth_digest(session: Path) -> str:
    folder = session / "ground_truth"
    return files_digest(
        file for file in sorted(folder.glob("*")) if file.suffix in (".tum", ".csv")
    )
