"""The steps of a session, each a name and what does it; most are the real commands.

A step finds everything in its `Place` and leaves its result there whole or not at all. It is called
when what it made is not there, or was made by other inputs. What it says goes to the session's log.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from capture import Session, SessionError, write_text
from dialogue import TracksideError, UsageError
from scoring import ScoreOptions
from trackside.campaign.plan import VISUAL, Drive, RunPlan


def nobody(_: str) -> None:
    """Hear what is said, and forget it."""


@dataclass(frozen=True)
class Place:
    """Where a session of a campaign lies, and what is to be done with it.

    folder : what is simulated; session : the one that is estimated and scored; shared : of all
    sessions; run : of the steps `slam` and `score`; again : whether the step was done before, by
    other inputs; say : takes a line for the session's log.
    """

    drive: Drive
    folder: Path
    session: Path
    shared: Path
    options: ScoreOptions
    run: RunPlan | None = None
    again: bool = False
    say: Callable[[str], object] = nobody

    @property
    def ours(self) -> bool:
        """Whether the campaign made the session: a recorded one is only added to."""
        return self.drive.recorded is None


Action = Callable[[Place], None]


def calibrate(place: Place) -> None:
    """The overhead camera is hung and calibrated once: its calibration serves every session."""
    _clear(place.shared)
    command(place, "simulate", "--site-only", "-o", place.shared)


def simulate(place: Place) -> None:
    """The car's recording, the film from above, the scene and the exact truth."""
    _clear(place.folder)
    drive = place.drive
    words = ["--map", drive.map, "--power", drive.power, "--trial", str(drive.trial)]
    words += ["--seed", str(drive.seed)]
    command(place, "simulate", *words, "--site", place.shared, "-o", place.folder)


def join(place: Place) -> None:
    """One session of car and film, on the clock of the car."""
    _clear(place.session)
    car, film, scene = (place.folder / name for name in ("car", "film", "scene.yaml"))
    command(place, "join", car, film, "-o", place.session, "--scene", scene, "--no-clip")


def track(place: Place) -> None:
    """Ground truth from the film, where there is none yet."""
    session = Session.open(place.session)
    if session.has_ground_truth and not (place.ours and place.again):
        return
    if not session.has_ground_truth and not session.overhead_count:
        raise SessionError(
            f"{place.session}: has neither ground truth nor a film from above; it cannot be scored"
        )
    scene = place.folder / "scene.yaml"
    given = ("--scene", scene) if scene.exists() else ()
    replace = ("--replace",) if session.has_ground_truth else ()
    try:
        command(place, "track", place.session, *given, *replace, "--no-clip")
    except TracksideError:
        # A truth with a bad verdict is written all the same; it must not pass for given next time.
        if place.ours:
            shutil.rmtree(place.session / "ground_truth", ignore_errors=True)
        raise


def vo(place: Place) -> None:
    """Visual odometry from the stereo film, where the car did not record it."""
    has = VISUAL in Session.open(place.session).odometry_sources
    if has and not place.again:
        return
    command(place, "vo", place.session, *(("--replace",) if has else ()))


def slam(place: Place) -> None:
    """The estimate of one run."""
    run = _run(place)
    if not (place.ours or place.again) and run.name in Session.open(place.session).estimates:
        raise UsageError(
            f"{place.session} has an estimate {run.name!r} that this campaign did not make; give "
            "the run another name, or move the estimate away"
        )
    words = ["--algorithm", run.algorithm, "--preset", run.preset, "--seed", str(run.seed)]
    for flag, value in (("--odometry", run.odometry), ("--association", run.association)):
        words += [flag, value] if value is not None else []
    for setting in run.words:
        words += ["--set", setting]
    words += ["--smooth"] if run.smooth else []
    command(place, "slam", place.session, *words, "--name", run.name, "--replace")


def score(place: Place) -> None:
    """The score of one run, as `trackside score` keeps it in the session."""
    from scoring import score as scored
    from scoring import to_json

    name, session = _run(place).name, Session.open(place.session)
    result = scored(session.ground_truth(), session.estimate(name), place.options)
    file = session.score_file(name)
    file.parent.mkdir(exist_ok=True)
    write_text(file, json.dumps(to_json([result]), indent=2, allow_nan=False) + "\n")
    place.say(f"Total {result.total}, wrote {file}\n")


SHARED: Mapping[str, Action] = {"calibrate": calibrate}
"""What is done once for a whole campaign that simulates, before its sessions."""

STEPS: Mapping[str, Action] = {
    "simulate": simulate,
    "join": join,
    "track": track,
    "vo": vo,
    "slam": slam,
    "score": score,
}

CLEARING = frozenset({"simulate", "join"})
"""Steps that make a folder anew: what later steps left in it is gone."""

ROOMS: Mapping[str, tuple[str, ...]] = {
    "calibrate": ("geometry", "capture", "simulation", "calibration", "trackside.virtual"),
    "simulate": ("geometry", "drivers", "capture", "simulation", "trackside.virtual"),
    "join": ("geometry", "capture", "tracking", "calibration"),
    "track": ("geometry", "capture", "tracking"),
    "vo": ("geometry", "capture", "visual_odometry"),
    "slam": ("geometry", "capture", "slam"),
    "score": ("geometry", "capture", "scoring"),
}
"""The rooms whose code decides what a step makes: when that changes, it is made anew."""


def command(place: Place, *words: str | Path) -> None:
    """Run a command of trackside in this process; raises what it raises, and for a bad end."""
    from trackside.cli import trackside

    texts = [str(word) for word in words]
    place.say(f"$ trackside {' '.join(texts)}\n")
    code = trackside.main(args=texts, standalone_mode=False)
    if isinstance(code, int) and code != 0:
        raise TracksideError(f"trackside {' '.join(texts)} ended with exit code {code}")


def _run(place: Place) -> RunPlan:
    assert place.run is not None, "slam and score are done for a run"
    return place.run


def _clear(folder: Path) -> None:
    """Away with what an earlier or a broken step left."""
    for left in (folder, *folder.parent.glob(f".{folder.name}.*")):
        if left.is_dir():
            shutil.rmtree(left)
    folder.parent.mkdir(parents=True, exist_ok=True)
