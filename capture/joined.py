"""A session of the car and a session of the camera above it as one, on the car's clock.

Raw data stay as they are, byte for byte; only `session.yaml` says how the film's stamps are read.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from capture.errors import MissingStreamError, SessionError
from capture.estimate import GroundTruth
from capture.session import Session
from capture.session_info import FilmClock, SessionInfo, write_session_info
from capture.session_writer import copy_calibration, write_rosbag_metadata, written_topics
from capture.topics import OVERHEAD_LOG_NAME
from capture.transaction import new_folder
from capture.yaml_file import plain
from geometry import Trajectory

_REWRITTEN = ("car.tum", "car_covariance.csv", "cones.csv", "ground_truth.yaml")


@contextmanager
def new_joined_session(
    target: Path, car: Session, film: Session, clock: FilmClock
) -> Iterator[Session]:
    """The session of both, which appears as `target` when the block ends well, and only then.

    What is written into it meanwhile comes along. Raises what `check_parts` raises, `SessionError`
    where `target` exists, `LogError` when the disk does not take it.
    """
    check_parts(car, film)
    with new_folder(target) as partial:
        for log in car.logs:
            _same_file(log.file, partial / log.file.name)
        _same_file(film.folder / OVERHEAD_LOG_NAME, partial / OVERHEAD_LOG_NAME)
        kept = set()
        for file in (*film.calibrations, *car.calibrations):
            if file.name not in kept:
                copy_calibration(partial, file)
                kept.add(file.name)
        write_session_info(partial, _joined_info(car, film, clock))
        made = Session.open(partial)
        write_rosbag_metadata(partial, {log.file.name: written_topics(log) for log in made.logs})
        yield made


def check_parts(car: Session, film: Session) -> None:
    """Raise `SessionError` or `MissingStreamError` where two sessions cannot become one."""
    if car.overhead_count or car.info.film_clock is not None:
        raise SessionError(
            f"{car.folder}: has a film already; give first a session that trackside record made, "
            "then one of trackside film"
        )
    if film.info.film_clock is not None:
        raise SessionError(f"{film.folder}: is joined already; give the film as it was recorded")
    if not film.overhead_count:
        raise MissingStreamError(
            f"{film.folder}: has no pictures of the overhead camera; the second session is that of "
            "trackside film"
        )
    broken = [
        session.folder for session in (car, film) if any(log.truncated for log in session.logs)
    ]
    if broken:
        raise SessionError(
            f"{broken[0]}: a log has no end (power loss or kill); trackside recover {broken[0]} "
            "first"
        )


def mapped_truth(truth: GroundTruth, clock: FilmClock) -> GroundTruth:
    """The truth of a film on the clock of the session, which its provenance says."""
    path = truth.path
    moved = Trajectory(clock.all_session_ns(path.t_ns), path.x, path.y, path.heading)
    told: Mapping[str, object] = {
        "stamps_mapped": "from the film's clock to the car's by trackside join: "
        "t_car = t_film + offset + skew (t_film - ref)",
        "film_clock": {
            name: value for name, value in _mapping(plain(clock)).items() if name != "film"
        },
    }
    return replace(truth, path=moved, provenance={**truth.provenance, **told})


def keep_pictures(film: Session, made: Session) -> None:
    """Take the pictures of a film's truth along, whose truth was written into `made`."""
    for file in sorted((film.folder / "ground_truth").glob("[!.]*")):
        if file.is_file() and file.name not in _REWRITTEN:
            _same_file(file, made.folder / "ground_truth" / file.name)


def _joined_info(car: Session, film: Session, clock: FilmClock) -> SessionInfo:
    info = film.info
    told: dict[str, object] = {
        "folder": str(film.folder.resolve()),
        "map": info.map,
        "power": info.power,
        "trial": info.trial,
        "start_utc": info.start_utc,
        "clocks": info.clocks,
        "chrony": info.chrony,
        "devices": info.devices,
        "verdict": info.verdict,
        "verdict_reason": info.verdict_reason,
        "notes": info.notes,
    }
    origin = {**car.info.origin, "joined_of": [str(car.folder.resolve()), told["folder"]]}
    return replace(
        car.info,
        film_clock=replace(clock, film=_mapping(plain(told))),
        devices={**info.devices, **car.info.devices},
        origin=origin,
    )


def _mapping(value: object) -> dict[str, object]:
    assert isinstance(value, dict)
    return value


def _same_file(file: Path, name: Path) -> None:
    """The same bytes under another name; a copy where the disk has no links."""
    try:
        os.link(file, name)
    except OSError:
        shutil.copy2(file, name)
