"""The group `trackside calibrate`, loaded piece by piece, and `trackside markers`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from calibration.length import grid_size, length
from dialogue import UsageError
from dialogue.lazy_group import LazyGroup
from dialogue.options import format_option

if TYPE_CHECKING:
    from capture import MeasuredCalibration

_Command = TypeVar("_Command", bound=Callable[..., Any])
_PATH = click.Path(path_type=Path)

COMMANDS = {
    "camera": ("calibration.overhead.cli:camera", "The inside of a camera, from a board."),
    "world": ("calibration.overhead.cli:world", "The overhead camera's place above the floor."),
    "verify": ("calibration.overhead.cli:verify", "Does a known length come out right?"),
    "markers": ("calibration.lever.cli:markers", "Where the rings sit on the car, from circles."),
    "odometry": ("calibration.odometry.cli:odometry", "Counts to metres, servo to curvature."),
    "imu": ("calibration.imu.cli:imu", "Bias, noise and scale of gyro, accelerometer, compass."),
    "lidar": ("calibration.lidar.cli:lidar", "Where the lidar sits on the car, from cones."),
    "stereo": ("calibration.stereo.cli:stereo", "The two eyes of the car's stereo camera."),
    "camera-delay": (
        "calibration.clocks.cli:camera_delay",
        "What the overhead camera stamps wrong, of joined sessions.",
    ),
    "show": ("calibration.cli:show", "What is in force in a folder or a session."),
    "apply": ("calibration.cli:apply", "Copy the newest accepted ones into sessions."),
}
"""Command -> where it is defined, and its line of help (`dialogue.lazy_group`)."""

FOLDER = click.option(
    "-o",
    "--output",
    type=_PATH,
    default=Path("calibration"),
    show_default=True,
    help="Folder for the dated file; nothing in it is overwritten.",
)


@click.group("calibrate", cls=LazyGroup, table=COMMANDS, noun="calibration")
def calibrate() -> None:
    """Measurements to parameters: each makes a dated file with residuals and a verdict."""


def say_verdict(accepted: bool, reasons: tuple[str, ...]) -> None:
    """Print a verdict and its reasons."""
    click.echo("accepted" if accepted else "rejected")
    for reason in reasons:
        click.echo(f"  {reason}")


def conclude(
    ctx: click.Context,
    folder: Path,
    calibration: MeasuredCalibration,
    draw: Callable[[Path], None],
    following: str,
) -> None:
    """Write a calibration of the car and its picture, tell it, and end with the verdict's code."""
    from calibration.tables import measured_table
    from capture import write_calibration

    file = write_calibration(folder, calibration)
    draw(file.with_suffix(".png"))
    click.echo(measured_table(calibration).render("table"))
    say_verdict(calibration.accepted, calibration.reasons)
    click.echo(f"wrote {file} and {file.with_suffix('.png').name}")
    if calibration.accepted:
        click.echo(f"next: {following}")
    ctx.exit(0 if calibration.accepted else 1)


@click.command("show")
@click.argument("place", type=_PATH, default=Path("calibration"), required=False)
@format_option()
def show(place: Path, table_format: str) -> None:
    """The calibrations in force: of a folder (the newest of every kind), a session, or one file.

    A session's odometry also falls back to what its rig says, which is told.
    """
    from calibration.tables import in_force_table, tables_of
    from capture import read_calibration

    files = _shown_files(place)
    for note in _notes(place, files):
        click.echo(note, err=True)
    if not files:
        raise UsageError(f"{place}: nothing to show; trackside calibrate camera makes the first")
    read = {kind: read_calibration(file, kind) for kind, file in files.items()}
    click.echo(in_force_table(files, read).render(table_format))
    for kind, one in read.items():
        click.echo(f"{files[kind]}", err=True)
        for table in tables_of(one):
            click.echo(table.render(table_format))
        say_verdict(one.accepted, one.reasons)


def _shown_files(place: Path) -> dict[str, Path]:
    """Kind -> file: of a file itself, of a session what is in force, of a folder the newest."""
    from capture import KINDS, accepted_file, kind_of
    from capture.session_info import FILE_NAME

    if place.is_file():
        kind = kind_of(place)
        if kind is None:
            raise UsageError(f"{place}: is no calibration; expected KIND_DATE.yaml")
        return {kind: place}
    if (place / FILE_NAME).exists():
        found = {kind: accepted_file(place / "calibration", kind) for kind in KINDS}
        return {kind: file for kind, file in found.items() if file is not None}
    if not place.is_dir():
        raise UsageError(f"{place}: there is no such file or folder")
    newest = {kind: sorted(place.glob(f"{kind}_*.yaml"))[-1:] for kind in KINDS}
    missing = ", ".join(kind for kind, files in newest.items() if not files)
    if missing:
        click.echo(f"{place}: has none of {missing}", err=True)
    return {kind: files[0] for kind, files in newest.items() if files}


def _notes(place: Path, files: dict[str, Path]) -> list[str]:
    """What else is in force: an older one where the newest was rejected, the words of a rig."""
    from capture import Session, accepted_file
    from capture.session_info import FILE_NAME

    if not (place / FILE_NAME).exists():
        older = {kind: accepted_file(place, kind) for kind in files if place.is_dir()}
        return [
            f"{files[kind].name} was rejected; a session takes {file.name}"
            for kind, file in older.items()
            if file is not None and file != files[kind]
        ]
    if "odometry" in files:
        return []
    known = Session.open(place).motor_calibration()
    return [f"odometry: {known or 'unknown'}, by the rig in {place / FILE_NAME}"]


@click.command("apply")
@click.argument("sessions", type=_PATH, nargs=-1, required=True)
@click.option(
    "--calibration",
    "folder",
    type=_PATH,
    default=Path("calibration"),
    show_default=True,
    help="Folder whose newest accepted calibration of every kind is taken.",
)
def apply(sessions: tuple[Path, ...], folder: Path) -> None:
    """Copy the calibrations in force into SESSIONS, so that they are read with them from now on.

    Sessions keep what they hold; nothing is overwritten, and a newer file of a kind goes before.
    """
    from capture import Session, accepted_files

    files = accepted_files(folder)
    if not files:
        raise UsageError(f"{folder}: holds no accepted calibration; see trackside calibrate --help")
    for session in map(Session.open, sessions):
        copied = session.adopt_calibrations(files)
        told = ", ".join(file.name for file in copied) or "nothing: it has them all"
        click.echo(f"{session.folder}: {told}")


def _length(name: str, text: str, **more: Any) -> Callable[[_Command], _Command]:
    return click.option(name, callback=length, metavar="LENGTH", help=text, **more)


@click.command("markers")
@click.option(
    "--kind",
    type=click.Choice(("ring", "charuco", "rings")),
    default="ring",
    show_default=True,
    help="One ring, or a board for calibrate camera.",
)
@_length("--diameter", "Outer diameter of rings.  [default: 122mm; of a board 30mm]")
@_length("--inner", "Inner diameter.  [default: 50/122 of the outer]")
@_length("--square", "Side of a square, or middle to middle of a board's rings.")
@_length("--marker", "Side of a ChArUco board's markers.")
@click.option("--size", callback=grid_size, metavar="10x7", help="Squares or rings of a board.")
@click.option("--paper", default="A4", show_default=True, help="A4 to A0, or letter.")
@click.option("--copies", type=click.IntRange(1, 200), default=1, show_default=True)
@click.option("-o", "--output", "file", type=_PATH, required=True, help="The PDF to write.")
def markers(
    kind: str,
    diameter: float | None,
    inner: float | None,
    square: float | None,
    marker: float | None,
    size: tuple[int, int] | None,
    paper: str,
    copies: int,
    file: Path,
) -> None:
    """Rings and boards to print, true to size, each sheet with a ruler of 100 mm."""
    from calibration.printed import marker_page, write_pages

    write_pages(file, [marker_page(kind, paper, diameter, inner, square, marker, size)] * copies)
    click.echo(f"wrote {file}: print at 100 %, measure the ruler, glue it on something flat")
