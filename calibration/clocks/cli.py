"""The commands `trackside join` and `trackside calibrate camera-delay`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibration.cli import FOLDER
from dialogue import Cell, Progress, Table, UsageError
from dialogue.options import format_option

if TYPE_CHECKING:
    from calibration.clocks.joining import Joining, Tracked
    from capture import CameraDelayCalibration, Session

_PATH = click.Path(path_type=Path)


@click.command("join")
@click.argument("car", type=_PATH)
@click.argument("film", type=_PATH)
@click.option("-o", "--output", type=_PATH, help="The session to make.  [default: CAR_joined]")
@click.option(
    "--scene",
    "scene_file",
    type=_PATH,
    help="What carries rings, to track FILM.  [default: scene.yaml if there is one]",
)
@click.option(
    "--calibration",
    "place",
    type=_PATH,
    help="World calibration to track FILM with, and the camera's delay; a folder, or the world's "
    "file.  [default: FILM's own, else calibration]",
)
@click.option(
    "--clock",
    "clock_files",
    type=_PATH,
    multiple=True,
    help="What trackside clock ask kept on either machine; repeatable.",
)
@click.option(
    "--trust-data",
    is_flag=True,
    help="Join by the data even where the network contradicts, as before the camera's delay is "
    "calibrated.",
)
@click.option(
    "--without",
    type=click.Choice(("gyro", "wheels")),
    help="Leave one sensor of the car out of the fit.",
)
@click.option(
    "--most-sigma",
    type=click.FloatRange(min=0.1, max=100.0),
    default=2.0,
    show_default=True,
    metavar="MS",
    help="How uncertain the offset may be; a car without gyro needs some 6.",
)
@click.option("--start-heading", type=float, metavar="DEG", help="Of the car, to 60 degrees.")
@click.option("--no-clip", is_flag=True, help="Make no MP4, which takes as long as tracking.")
@format_option()
@click.pass_context
def join(
    ctx: click.Context,
    car: Path,
    film: Path,
    output: Path | None,
    scene_file: Path | None,
    place: Path | None,
    clock_files: tuple[Path, ...],
    trust_data: bool,
    without: str | None,
    most_sigma: float,
    start_heading: float | None,
    no_clip: bool,
    table_format: str,
) -> None:
    """One session on one clock, of CAR (trackside record) and FILM (trackside film).

    The clocks are told by the data: gyro and wheels against the filmed car. What the machines said
    over the network is compared with it. FILM is tracked unless it has its ground truth already.
    The logs are taken as they are, byte for byte; estimates and scores of CAR are not taken along.
    Nothing is made when the motion does not tell the clocks or anything contradicts it. Exit code 1
    when the ground truth is bad; it is written with its verdict all the same.
    """
    from calibration.clocks.joining import clock_of, motions_of, write_joined
    from capture import Session, check_parts, read_peer_clock

    target = output or _usual_target(car)
    if target.exists():
        raise UsageError(f"{target} exists already; give another name with -o, or move it away")
    sessions = Session.open(car), Session.open(film)
    check_parts(*sessions)
    peers = tuple(read_peer_clock(file) for file in clock_files)
    tracked = None
    if sessions[1].has_ground_truth:
        click.echo(f"ground truth: that of {film}", err=True)
        truth = sessions[1].ground_truth()
    else:
        tracked = _tracked(sessions[1], place, scene_file, start_heading)
        truth = tracked.result.truth
    motions = motions_of(sessions[0], truth, without)
    joining = clock_of(
        *sessions, motions, peers, place, trust_data=trust_data, most_sigma_s=1e-3 * most_sigma
    )
    click.echo(
        join_table(joining, f"{sessions[0].name} and {sessions[1].name}").render(table_format)
    )
    joining.check()
    write_joined(target, *sessions, truth, joining, tracked, clip=not no_clip)
    for remark in joining.remarks:
        click.echo(f"  note: {remark}", err=True)
    if tracked is not None:
        click.echo("\n".join(tracked.summary), err=True)
    click.echo(f"wrote {target}; look at its join.png", err=True)
    click.echo(f"next: trackside slam {target}", err=True)
    ctx.exit(1 if truth.provenance.get("verdict") == "bad" else 0)


def join_table(joining: Joining, title: str) -> Table:
    """Offset, skew and what is left, of each sensor, of all, of the network."""
    from calibration.clocks.record import offset_of

    fit, network = joining.fit, joining.network
    rows: list[tuple[Cell, ...]] = []
    for one in fit.sources:
        if one.fit is None:
            rows.append((one.source, None, None, None, None, None))
            continue
        unit = "deg" if one.source == "gyro" else "mm"
        size = one.fit.residual_rms * (math.degrees(1.0) if one.source == "gyro" else 1e3)
        ppm = 1e6 * one.fit.skew
        sigma_ms = 1e3 * one.fit.sigma_offset_s
        name = one.source if one.is_used else f"({one.source})"
        rows.append((name, offset_of(fit, one), sigma_ms, ppm, None, f"{size:.3f} {unit}"))
    together = "data" if len(rows) == 1 else "together"
    sigma_ms, ppm, sigma_ppm = 1e3 * fit.sigma_s, 1e6 * fit.skew, 1e6 * fit.sigma_skew
    rows.append((together, fit.offset_s, sigma_ms, ppm, sigma_ppm, None))
    if network is not None:
        rows.append(("network", network.offset_ns * 1e-9, 1e3 * network.sigma_s, None, None, None))
    columns = ("clock", "offset [s]", "sigma [ms]", "skew [ppm]", "sigma [ppm]", "left over")
    note = "\n".join(joining.lines)
    return Table(columns, tuple(rows), title, note, digits=5)


@click.command("camera-delay")
@click.argument("sessions", type=_PATH, nargs=-1, required=True)
@FOLDER
@format_option()
@click.pass_context
def camera_delay(
    ctx: click.Context, sessions: tuple[Path, ...], output: Path, table_format: str
) -> None:
    """What the overhead camera stamps wrong, of joined SESSIONS whose network clock is known.

    That is the offset by the data minus the offset by the network; below 0 where the camera stamps
    late. A film of the car's own machine has the network's offset by itself. Exit code 1 when the
    result is rejected.
    """
    from calibration.clocks.camera_delay import camera_delay as averaged
    from calibration.clocks.camera_delay import measured_delay
    from capture import Session, list_sessions, write_calibration

    folders = [folder for place in sessions for folder in list_sessions(place)]
    found = averaged([measured_delay(Session.open(folder)) for folder in folders])
    file = write_calibration(output, found)
    click.echo(delay_table(found).render(table_format))
    click.echo("accepted" if found.accepted else "rejected", err=True)
    for reason in found.reasons:
        click.echo(f"  {reason}", err=True)
    click.echo(f"wrote {file}", err=True)
    ctx.exit(0 if found.accepted else 1)


def delay_table(found: CameraDelayCalibration) -> Table:
    """Each session, and the mean below."""
    rows: list[tuple[Cell, ...]] = [
        (one.name, 1e3 * one.delay_s, 1e3 * one.sigma_s, 1e3 * one.residual_s)
        for one in found.sessions
    ]
    rows.append(("mean", 1e3 * found.delay_s, 1e3 * found.sigma_s, None))
    way = "late" if found.delay_s < 0 else "early"
    note = f"the film is stamped {1e3 * abs(found.delay_s):.2f} ms {way}"
    columns = ("session", "data - network [ms]", "sigma [ms]", "residual [ms]")
    return Table(columns, tuple(rows), f"camera delay, {found.made_utc}", note)


def _usual_target(car: Path) -> Path:
    """Beside the car's session; `.` and `..` have their name elsewhere."""
    named = car if car.name not in ("", "..") else car.resolve()
    return named.with_name(f"{named.name}_joined")


def _tracked(
    film: Session, place: Path | None, scene_file: Path | None, start_heading: float | None
) -> Tracked:
    from calibration.clocks.joining import Tracked
    from capture import calibration_file, read_world_calibration, usual_calibrations
    from tracking import scene_of, session_film, track_film

    scene, told = scene_of(scene_file, start_heading)
    click.echo(f"scene: {told}", err=True)
    world_file = calibration_file(place or usual_calibrations(film.folder, "world"), "world")
    world = read_world_calibration(world_file)
    click.echo(f"calibration: {world_file}", err=True)
    how = {"calibration_file": world_file.name, "cones_from": "this film"}
    played = session_film(film)
    with Progress(f"tracking {played.source}", played.count) as progress:
        result = track_film(played, world, scene, how=how, advance=progress.advance)
    return Tracked(played, result, world_file, scene)
