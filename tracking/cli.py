"""The command `trackside track`: frames -> ground truth of car and cones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import Progress, UsageError

if TYPE_CHECKING:
    from capture import Session
    from geometry import LandmarkMap
    from tracking.ground_truth import TrackResult
    from tracking.scene import Scene

_PATH = click.Path(path_type=Path)


@click.command("track")
@click.argument("session", type=_PATH, required=False)
@click.option("--video", type=_PATH, help="Old footage instead of a SESSION; makes one of it.")
@click.option(
    "--calibration",
    "place",
    type=_PATH,
    help="World calibration, or a folder whose newest is taken.  [default: the session's own, "
    "else calibration]",
)
@click.option(
    "--scene",
    "scene_file",
    type=_PATH,
    help="What carries rings; see docs/formats.md.  [default: scene.yaml if there is one]",
)
@click.option(
    "--cones",
    "cones_from",
    type=_PATH,
    help="Where the cones are: a session that filmed their rings, or a cones.csv.  [default: the "
    "beginning of this film]",
)
@click.option("--start-heading", type=float, metavar="DEG", help="Of the car, to 60 degrees.")
@click.option("-o", "--output", type=_PATH, help="With --video: the session to make.")
@click.option("--replace", is_flag=True, help="Replace a ground truth that is there.")
@click.option("--no-clip", is_flag=True, help="Make no MP4, which takes as long as tracking.")
@click.pass_context
def track(
    ctx: click.Context,
    session: Path | None,
    video: Path | None,
    place: Path | None,
    scene_file: Path | None,
    cones_from: Path | None,
    start_heading: float | None,
    output: Path | None,
    replace: bool,
    no_clip: bool,
) -> None:
    """Turn the film of SESSION into ground truth: car at every frame, cones, pictures, a verdict.

    Exit code 1 when the verdict is bad; the truth is written with its verdict all the same.
    """
    from capture import calibration_file, read_world_calibration, usual_calibrations
    from tracking.film import session_film, video_film
    from tracking.ground_truth import track_film
    from tracking.whole_film import (
        scene_of,
        summary,
        write_pictures,
    )

    if (session is None) == (video is None):
        raise UsageError("give either a SESSION that was filmed or --video FILE")
    scene, told = scene_of(scene_file, start_heading)
    click.echo(f"scene: {told}", err=True)
    if video is not None:
        target = output or video.with_name(f"{video.stem}_session")
        film, recording = video_film(video), None
    else:
        assert session is not None
        if output is not None:
            raise UsageError("--output belongs to --video; a session keeps its own truth")
        recording = _opened(session, replace)
        target, film = session, session_film(recording)
    world_file = calibration_file(place or usual_calibrations(session, "world"), "world")
    world = read_world_calibration(world_file)
    click.echo(f"calibration: {world_file}", err=True)
    cones = None if cones_from is None else _cones(cones_from, world_file, scene)
    how = {"calibration_file": world_file.name, "cones_from": str(cones_from or "this film")}
    with Progress(f"tracking {film.source}", film.count) as progress:
        result = track_film(film, world, scene, cones=cones, how=how, advance=progress.advance)
    kept = recording or _new_session(target, video, result)
    kept.write_ground_truth(result.truth, replace=replace)
    if world_file.parent.resolve() != (target / "calibration").resolve():
        kept.adopt_calibrations([world_file])
    truth_folder = target / "ground_truth"
    write_pictures(truth_folder, film, result, world_file, scene, clip=not no_clip)
    click.echo("\n".join(summary(result)))
    click.echo(f"wrote {truth_folder}; look at its track.html")
    click.echo(f"next: {_following(kept)}")
    ctx.exit(0 if result.judgement.good else 1)


def _following(session: Session) -> str:
    """What to do next: a film alone knows nothing of the car's own sensors."""
    if session.odometry_sources or session.has_scans or session.has_observations:
        return f"trackside slam {session.folder}, trackside score {session.folder}"
    return f"trackside join CAR {session.folder}"


def _opened(session: Path, replace: bool) -> Session:
    from capture import Session

    recording = Session.open(session)
    if recording.has_ground_truth and not replace:
        raise UsageError(f"{session} has a ground truth already; give --replace to make it anew")
    return recording


def _cones(place: Path, world_file: Path, scene: Scene) -> LandmarkMap:
    """Of a table, or of a film of the rings on which cones will stand."""
    from capture import Session, read_landmarks, read_world_calibration
    from tracking.film import session_film
    from tracking.ground_truth import cones_of

    if place.suffix == ".csv":
        return read_landmarks(place)
    found = cones_of(session_film(Session.open(place)), read_world_calibration(world_file), scene)
    for remark in found.remarks:
        click.echo(f"{place}: {remark}", err=True)
    return found.cones


def _new_session(folder: Path, video: Path | None, result: TrackResult) -> Session:
    """A session for old footage, which has no log."""
    from capture import Session, SessionInfo

    origin: dict[str, object] = {
        "video": str(video),
        "stamps": str(result.truth.provenance["stamps"]),
    }
    with Session.create(folder, SessionInfo(map=folder.name, origin=origin)):
        pass
    return Session.open(folder)
