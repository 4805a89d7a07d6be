"""Steps that make small synthetic sessions in milliseconds, in place of the virtual track."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

from capture import GroundTruth, Observations, Odometry, Session, SessionInfo
from dialogue import TracksideError
from geometry import Floats, LandmarkMap, Trajectory, between, compose, wrap
from trackside.campaign import steps, work
from trackside.campaign.steps import Place, slam
from trackside.campaign.steps import score as real_score

TEXT = """\
title: A test
output: out
simulate: {maps: [turn, loop], powers: [low, high], trials: 2, seed: 5}
runs:
  - {algorithm: ekf, preset: thesis, odometry: viso}
  - {algorithm: fastslam, preset: thesis, odometry: viso, settings: {particles: 20}}
  - {algorithm: ekf, preset: robust, odometry: wheel}
resamples: 200
"""
SMALL = TEXT.replace("[turn, loop]", "[turn]").replace("trials: 2", "trials: 1")

Campaign = Callable[..., Result]

S = 1_000_000_000
HZ = 10
SLIP = {"low": 0.004, "medium": 0.008, "high": 0.016}
BAD = "bad_sessions"
"""A file beside the output folder that names sessions whose `join` fails."""


def calibrate(place: Place) -> None:
    place.shared.mkdir(parents=True)
    _note(place, "calibrate")


def simulate(place: Place) -> None:
    assert place.shared.is_dir()
    (place.folder / "car").mkdir(parents=True, exist_ok=True)
    _note(place, "simulate")


def join(place: Place) -> None:
    import shutil

    bad = place.shared.parent.parent / BAD
    if bad.exists() and place.drive.name in bad.read_text().split():
        raise TracksideError(f"{place.folder / 'car'}: the clocks do not meet")
    shutil.rmtree(place.session, ignore_errors=True)
    assert place.drive.seed is not None
    make_session(
        place.session, place.drive.map, place.drive.power, place.drive.trial, place.drive.seed
    )
    click.echo("joined car and film")
    _note(place, "join")


def track(place: Place) -> None:
    _note(place, "track")


def vo(place: Place) -> None:
    _note(place, "vo")


def slam_noted(place: Place) -> None:
    slam(place)
    assert place.run is not None
    _note(place, f"slam {place.run.name}")


def score(place: Place) -> None:
    real_score(place)
    assert place.run is not None
    _note(place, f"score {place.run.name}")


SHARED = {"calibrate": calibrate}
STEPS = {
    "simulate": simulate,
    "join": join,
    "track": track,
    "vo": vo,
    "slam": slam_noted,
    "score": score,
}


_REAL = {"STEPS": steps.STEPS, "SHARED": steps.SHARED}


def notes(output: Path) -> list[str]:
    """`session: step` for every step that was really done."""
    return [
        line
        for file in sorted(output.parent.glob("notes/*"))
        for line in file.read_text().splitlines()
    ]


def do_campaign(
    patch: pytest.MonkeyPatch, folder: Path, text: str, *words: str, workers: int | None = 1
) -> Result:
    """Write a campaign file into a folder and do it there, with the steps of this module."""
    from trackside.cli import trackside

    for name, table in (("STEPS", STEPS), ("SHARED", SHARED)):
        if getattr(work, name) is _REAL[name]:
            patch.setattr(work, name, table)
    patch.chdir(folder)
    (folder / "test.yaml").write_text(text)
    more = ["--workers", str(workers)] if workers else []
    return CliRunner().invoke(trackside, ["campaign", "test.yaml", *more, *words])


def steps_of(result: Result) -> Mapping[str, int]:
    """How many steps a campaign says that it did, and that it knew."""
    line = next(line for line in result.stdout.splitlines() if "steps done" in line)
    words = line.replace(",", "").split()
    return {"done": int(words[0]), "known": int(words[3])}


def _note(place: Place, what: str) -> None:
    folder = place.shared.parent.parent / "notes"
    folder.mkdir(exist_ok=True)
    with (folder / place.drive.name).open("a") as stream:
        stream.write(f"{place.drive.name}: {what}\n")


def make_session(folder: Path, name: str, power: str, trial: int | None, seed: int) -> None:
    """Some seconds between cones, with wheel and visual odometry and with truth."""
    random = np.random.default_rng(seed)
    truth, cones = _drive(name), _cones(name)
    info = SessionInfo(
        map=name, power=power, trial=trial, start_utc="2026-05-14T10:00:00Z", notes="synthetic"
    )
    with Session.create(folder, info) as writer:
        for source, factor in (("wheel", 1.0), ("viso", 2.0)):
            writer.add_odometry(_odometry(source, truth, factor * SLIP[power], random))
        writer.add_observations(_observations(truth, cones, random))
        writer.add_ground_truth(GroundTruth(truth, cones))


def _drive(name: str) -> Trajectory:
    t = np.linspace(0.0, 1.0, 8 * HZ)
    along = t - np.sin(2.0 * np.pi * t) / (2.0 * np.pi)
    turns = {"turn": 0.25, "s-curve": 0.0, "loop": 1.5}[name]
    if name == "s-curve":
        x, y = 0.4 + 3.2 * along, 2.0 + 0.6 * np.sin(2.0 * np.pi * along)
    else:
        angle = 2.0 * np.pi * turns * along - np.pi / 2
        x, y = 2.0 + 1.3 * np.cos(angle), 2.0 + 1.3 * np.sin(angle)
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    t_ns = S + (np.arange(t.size) * (S // HZ)).astype(np.int64)
    return Trajectory(t_ns, x, y, wrap(heading))


def _cones(name: str) -> LandmarkMap:
    path = _drive(name)
    rows = np.linspace(3, len(path) - 4, 7).astype(int)
    if name == "loop":
        rows = np.searchsorted(path.travelled_m, np.arange(7) / 7 * 2.6 * np.pi)
    aside = np.stack([-np.sin(path.heading[rows]), np.cos(path.heading[rows])], axis=1)
    positions = np.concatenate([path.positions[rows] + side * 0.45 * aside for side in (1, -1)])
    return LandmarkMap(np.arange(len(positions)), positions)


def _odometry(source: str, truth: Trajectory, slip: float, random: np.random.Generator) -> Odometry:
    steps = between(truth.poses[:-1], truth.poses[1:])
    steps += random.normal(0.0, [slip, slip / 2, slip], steps.shape)
    poses = np.zeros((len(truth), 3))
    for k, step in enumerate(steps):
        poses[k + 1] = compose(poses[k], step)
    speed = np.append(steps[:, 0], 0.0) * HZ
    return Odometry(source, truth.t_ns, poses, speed, np.append(steps[:, 2], 0.0) * HZ)


def _observations(
    truth: Trajectory, cones: LandmarkMap, random: np.random.Generator
) -> Observations:
    stamps: list[int] = []
    seen: list[Floats] = []
    for k in range(len(truth)):
        offset = cones.positions - truth.positions[k]
        ranges = np.hypot(offset[:, 0], offset[:, 1])
        bearings = np.arctan2(offset[:, 1], offset[:, 0]) - truth.heading[k]
        found = (ranges < 1.5) & (random.random(len(cones)) > 0.1)
        scan = np.stack([ranges[found], bearings[found]], axis=1)
        scan += random.normal(0.0, [0.03, 0.02], scan.shape)
        ghosts = random.uniform([0.4, -np.pi], [1.5, np.pi], (random.poisson(0.05), 2))
        stamps += [int(truth.t_ns[k])] * (len(scan) + len(ghosts))
        seen += [scan, ghosts]
    columns = np.concatenate(seen)
    nobody = np.full(len(columns), -1, dtype=np.int64)
    return Observations(np.array(stamps), nobody, columns[:, 0], np.asarray(wrap(columns[:, 1])))


def campaign_in(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Campaign:
    """What writes a campaign file into a folder and does it, by default in this process."""

    def run(text: str = SMALL, *words: str, workers: int | None = 1) -> Result:
        return do_campaign(monkeypatch, folder, text, *words, workers=workers)

    return run
