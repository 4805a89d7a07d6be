"""The commands `trackside calibrate camera|world|verify|show` and `trackside markers`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibration.length import grid_size, length
from dialogue import TABLE_FORMATS, Cell, Table, UsageError

if TYPE_CHECKING:
    from calibration.camera import Sightings
    from calibration.pictures import Picture, Skipped
    from capture import CameraCalibration

_FORMAT = click.option(
    "--format", "table_format", type=click.Choice(TABLE_FORMATS), default="table", show_default=True
)
_FOLDER = click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("calibration"),
    show_default=True,
    help="Folder for the dated file; nothing in it is overwritten.",
)
_RIG = click.option(
    "--rig",
    "rig_file",
    type=click.Path(path_type=Path),
    help="Use the overhead camera of this rig, live, instead of a SOURCE.",
)
FRESH_SHARE = 0.03
"""Of the picture's width: how far a board must have moved to be a new view."""


@click.group("calibrate")
def calibrate() -> None:
    """The overhead camera and its place; each makes a dated file with residuals and a verdict."""


@calibrate.command("camera")
@click.argument("source", type=click.Path(path_type=Path), required=False)
@click.option(
    "--board",
    "kind",
    type=click.Choice(("charuco", "chessboard", "rings")),
    default="charuco",
    show_default=True,
)
@click.option(
    "--size", callback=grid_size, metavar="COLUMNSxROWS", help="Squares, inner corners or rings."
)
@click.option(
    "--square",
    callback=length,
    metavar="LENGTH",
    help="Side of a square, or middle to middle of rings.",
)
@click.option(
    "--marker", callback=length, metavar="LENGTH", help="Side of a ChArUco board's markers."
)
@click.option(
    "--diameter", callback=length, metavar="LENGTH", help="Outer diameter of a board's rings."
)
@click.option("--inner", callback=length, metavar="LENGTH", help="Their inner diameter.")
@click.option("--views", type=click.IntRange(min=3), default=30, show_default=True)
@_RIG
@_FOLDER
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
    _say_verdict(result.calibration.accepted, result.calibration.reasons)
    click.echo(f"wrote {file} and {file.with_suffix('.png').name}")
    click.echo(f"next: trackside calibrate world SOURCE --camera {file}")
    ctx.exit(0 if result.calibration.accepted else 1)


def camera_table(calibration: CameraCalibration) -> Table:
    """Every parameter, its standard deviation, and below it the views."""
    from geometry import INTRINSICS, intrinsics_of

    values = intrinsics_of(calibration.camera).tolist()
    sigma = [row[i] ** 0.5 for i, row in enumerate(calibration.covariance)]
    rows: list[tuple[Cell, ...]] = [*zip(INTRINSICS, values, sigma, strict=True)]
    size = f"{calibration.camera.width_px}x{calibration.camera.height_px}"
    left_out = [view for view in calibration.views if not view.used]
    notes = [f"rms {calibration.rms_px:.3f} px in {len(calibration.views) - len(left_out)} views"]
    notes += [f"left out {one.name}: {one.rms_px:.2f} px, {one.why}" for one in left_out]
    title = f"camera {size}, {calibration.made_utc}"
    return Table(("parameter", "value", "sigma"), tuple(rows), title, "\n".join(notes), digits=5)


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


def _say_verdict(accepted: bool, reasons: tuple[str, ...]) -> None:
    click.echo("accepted" if accepted else "rejected")
    for reason in reasons:
        click.echo(f"  {reason}")
