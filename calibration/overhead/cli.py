"""The commands `trackside calibrate camera|world|verify`: the overhead camera and its place."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from calibration.cli import FOLDER, say_verdict
from calibration.length import grid_size, length
from dialogue import UsageError

if TYPE_CHECKING:
    from calibration.camera import Sightings
    from calibration.pictures import Picture, Skipped

_Command = TypeVar("_Command", bound=Callable[..., Any])
_PATH = click.Path(path_type=Path)

_RIG = click.option(
    "--rig",
    "rig_file",
    type=click.Path(path_type=Path),
    help="Use the overhead camera of this rig, live, instead of a SOURCE.",
)


def _length(name: str, text: str, **more: Any) -> Callable[[_Command], _Command]:
    return click.option(name, callback=length, metavar="LENGTH", help=text, **more)


FRESH_SHARE = 0.03
"""Of the picture's width: how far a board must have moved to be a new view."""


@click.command("camera")
@click.argument("source", type=click.Path(path_type=Path), required=False)
@click.option(
    "--board",
    "kind",
    type=click.Choice(("charuco", "chessboard", "rings")),
    default="charuco",
    show_default=True,
)
@_length("--square", "Side of a square, or middle to middle of rings.")
@_length("--marker", "Side of a ChArUco board's markers.")
@_length("--diameter", "Outer diameter of a board's rings.")
@_length("--inner", "Their inner diameter.")
@click.option("--size", callback=grid_size, metavar="9x6", help="Squares, inner corners or rings.")
@click.option("--views", type=click.IntRange(min=3), default=30, show_default=True)
@_RIG
@FOLDER
@click.pass_context
def camera(
    ctx: click.Context,
    source: Path | None,
    kind: str,
    size: tuple[int, int] | None,
    square: float | None,
    marker: float | None,
    diameter: float | None,
    inner: float | None,
    views: int,
    rig_file: Path | None,
    output: Path,
) -> None:
    """The inside of a camera from pictures of a board.

    SOURCE is a folder of pictures, a video or a filmed session. Of videos and live cameras only
    new views are taken, up to --views. Exit code 1 when the result is rejected.
    """
    from calibration.boards import board_of
    from calibration.camera import Sightings, calibrate_camera
    from calibration.camera_picture import write_camera_picture
    from calibration.tables import camera_table
    from capture import write_calibration

    board = board_of(kind, size, square, marker, diameter, inner)
    seen = Sightings(board)
    with _pictures(source, rig_file) as (pictures, skipped):
        _collect(seen, pictures, views, moving=source is None or not _is_stills(source))
    for line in skipped.lines:
        click.echo(line, err=True)
    result = calibrate_camera(seen, {"source": str(source or rig_file)})
    file = write_calibration(output, result.calibration)
    write_camera_picture(file.with_suffix(".png"), result)
    click.echo(camera_table(result.calibration).render("table"))
    click.echo(f"{len(seen.found)} of {seen.pictures} pictures gave a new view of the board")
    say_verdict(result.calibration.accepted, result.calibration.reasons)
    click.echo(f"wrote {file} and {file.with_suffix('.png').name}")
    click.echo(f"next: trackside calibrate world SOURCE --camera {file}")
    ctx.exit(0 if result.calibration.accepted else 1)


_CALIBRATION = click.option(
    "--calibration",
    "place",
    type=click.Path(path_type=Path),
    default=Path("calibration"),
    show_default=True,
    help="A file, or a folder whose newest one is taken.",
)
_PICTURES = click.option(
    "--pictures", "most", type=click.IntRange(min=1), default=60, show_default=True,
    help="How many are averaged.",
)  # fmt: skip


@click.command("world")
@click.argument("source", type=click.Path(path_type=Path), required=False)
@click.option(
    "--floor",
    "floor_file",
    type=_PATH,
    default=Path("floor.yaml"),
    show_default=True,
    help="Which rings stand where, and the measured lengths.",
)
@click.option(
    "--camera",
    "camera_place",
    type=_PATH,
    help="The camera's calibration.  [default: the newest in --output]",
)
@_PICTURES
@_RIG
@FOLDER
@click.pass_context
def world(
    ctx: click.Context,
    source: Path | None,
    floor_file: Path,
    camera_place: Path | None,
    most: int,
    rig_file: Path | None,
    output: Path,
) -> None:
    """The camera's place above the floor, from four corner rings and measured lengths.

    SOURCE is a folder of pictures, a video or a filmed session. Exit code 1 when the result is
    rejected.
    """
    from calibration.survey import read_floor
    from calibration.tables import world_tables
    from calibration.world import calibrate_world
    from calibration.world_picture import write_world_picture
    from capture import calibration_file, read_camera_calibration, write_calibration
    from tracking import average_rings

    floor = read_floor(floor_file)
    camera_file = calibration_file(camera_place or output, "camera")
    click.echo(f"camera: {camera_file}")
    with _pictures(source, rig_file) as (pictures, skipped):
        rings = average_rings((one.image for one in pictures), floor.ring, most)
    for line in skipped.lines:
        click.echo(line, err=True)
    how = {"source": str(source or rig_file), "camera_file": camera_file.name}
    result = calibrate_world(floor, rings, read_camera_calibration(camera_file), how)
    file = write_calibration(output, result.calibration)
    write_world_picture(file.with_suffix(".png"), result)
    for table in world_tables(result.calibration):
        click.echo(table.render("table"))
    say_verdict(result.calibration.accepted, result.calibration.reasons)
    click.echo(f"wrote {file} and {file.with_suffix('.png').name}")
    click.echo("next: trackside calibrate verify SOURCE --distance 1.000")
    ctx.exit(0 if result.calibration.accepted else 1)


@click.command("verify")
@click.argument("source", type=click.Path(path_type=Path), required=False)
@_length("--distance", "The length, between the middles of two rings.", required=True)
@_length("--height", "Of the two rings above the floor.  [default: 0]")
@click.option("--between", metavar="A,B", help="Two markers of the calibration.")
@_length("--tolerance", "How far off it may be.", default="5mm", show_default=True)
@_CALIBRATION
@_PICTURES
@_RIG
@click.pass_context
def verify(
    ctx: click.Context,
    source: Path | None,
    distance: float,
    height: float | None,
    between: str | None,
    tolerance: float,
    place: Path,
    most: int,
    rig_file: Path | None,
) -> None:
    """Does a known length come out right? Lay two rings down so far apart; exit code 1 if not."""
    from calibration.verify import verify_length
    from capture import calibration_file, read_world_calibration
    from tracking import average_rings

    file = calibration_file(place, "world")
    known = read_world_calibration(file)
    pair = None
    if between is not None:
        first, comma, second = between.partition(",")
        if not (comma and first.strip() and second.strip()):
            raise UsageError(f"--between takes two names, A,B; got {between!r}")
        pair = (first.strip(), second.strip())
    with _pictures(source, rig_file) as (pictures, _):
        rings = average_rings((one.image for one in pictures), known.ring, most)
    found = verify_length(
        known, rings, distance, height_m=height or 0.0, between=pair, tolerance_m=tolerance
    )
    click.echo(f"calibration: {file}")
    (ax, ay), (bx, by) = found.places_m
    click.echo(f"rings at ({ax:.4f}, {ay:.4f}) and ({bx:.4f}, {by:.4f}) m")
    click.echo(
        f"measured {found.measured_m:.4f} m, known {found.known_m:.4f} m: "
        f"{1e3 * found.error_m:+.1f} mm (predicted sigma {1e3 * found.sigma_m:.1f} mm)"
    )
    click.echo("pass" if found.passed else f"fail: more than {1e3 * tolerance:g} mm off")
    ctx.exit(0 if found.passed else 1)


@contextlib.contextmanager
def _pictures(
    source: Path | None, rig_file: Path | None
) -> Iterator[tuple[Iterator[Picture], Skipped]]:
    """Pictures of a place or of a rig's camera, which is closed in any case."""
    from calibration.pictures import Skipped, pictures_from, pictures_of

    skipped = Skipped()
    if (source is None) == (rig_file is None):
        raise UsageError("give either a SOURCE with pictures or --rig for a live camera")
    if source is not None:
        yield pictures_of(source, skipped), skipped
        return
    from capture.recording.rig import read_rig
    from drivers.camera import V4l2Camera

    assert rig_file is not None
    rig = read_rig(rig_file)
    if rig.overhead is None:
        raise UsageError(f"{rig_file}: has no overhead camera; add it, or give a SOURCE")
    with contextlib.closing(pictures_from(V4l2Camera(rig.overhead), skipped)) as live:
        yield live, skipped


def _is_stills(source: Path) -> bool:
    from capture.session_info import FILE_NAME

    return source.is_dir() and not (source / FILE_NAME).exists()


def _collect(seen: Sightings, pictures: Iterator[Picture], views: int, moving: bool) -> None:
    """Look at pictures; of moving ones until there are enough new views, or Ctrl-C."""
    from calibration.camera import coverage_cells, where_to_show

    with contextlib.suppress(KeyboardInterrupt):
        for picture in pictures:
            if moving:
                seen.fresh_px = FRESH_SHARE * picture.image.shape[1]
            if seen.add(picture) is None or not moving:
                continue
            assert seen.size_px is not None
            cells = coverage_cells(seen.found, seen.size_px)
            where = where_to_show(cells)
            advice = f"; now show it at the {where}" if where else ""
            covered = 100 * float((cells > 0).mean())
            click.echo(f"view {len(seen.found)}: {covered:.0f} % covered{advice}", err=True)
            if len(seen.found) >= views:
                return
