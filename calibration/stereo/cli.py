"""The command `trackside calibrate stereo`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from calibration.length import grid_size, length
from dialogue import Cell, Table, UsageError

if TYPE_CHECKING:
    from capture import StereoCalibration
    from geometry import Mounting

FRESH_SHARE = 0.03
"""Of the eye's width: how far a board must have moved to be a new view, where pictures move."""
_Command = TypeVar("_Command", bound=Callable[..., Any])
_PATH = click.Path(path_type=Path)
_PLACE = re.compile(r"\s*([-+]?[0-9]*\.?[0-9]+)\s*(mm|cm|m|)\s*")
_PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0, "": 1.0}


def _place(_: click.Context, param: click.Parameter, text: str) -> float:
    """A length of either sign in metres, which it is in where it has no unit."""
    match = _PLACE.fullmatch(text)
    if match is None:
        raise click.BadParameter(f"{text!r} is no length; expected e.g. 0.2m or -60mm", param=param)
    return float(match[1]) / _PER_METRE[match[2]]


def _placed(name: str, text: str) -> Callable[[_Command], _Command]:
    return click.option(
        name, callback=_place, metavar="LENGTH", default="0", show_default=True, help=text
    )


def _turned(name: str, text: str) -> Callable[[_Command], _Command]:
    return click.option(
        name, type=click.FloatRange(-180.0, 180.0), metavar="DEG", default=0.0, show_default=True,
        help=text,
    )  # fmt: skip


@click.command("stereo")
@click.argument("source", type=_PATH, required=False)
@click.option(
    "--board",
    "kind",
    type=click.Choice(("charuco", "chessboard")),
    default="charuco",
    show_default=True,
)
@click.option("--square", callback=length, metavar="LENGTH", help="Side of a square.")
@click.option("--marker", callback=length, metavar="LENGTH", help="Side of ChArUco's markers.")
@click.option("--size", callback=grid_size, metavar="9x6", help="Squares, or inner corners.")
@click.option("--views", type=click.IntRange(min=3), default=30, show_default=True)
@click.option("--factory", type=_PATH, help="The ZED's own file, SN12345.conf, instead.")
@click.option("--mode", default="VGA", show_default=True, help="For --factory: HD2K to VGA.")
@_placed("--x", "Of the left eye ahead of the rear axle's middle.")
@_placed("--y", "To the left of it.")
@_placed("--z", "Above the floor.")
@_turned("--pitch", "How far it looks down.")
@_turned("--roll", "How far it leans to the right.")
@_turned("--yaw", "How far it looks to the left.")
@click.option(
    "-o",
    "--output",
    type=_PATH,
    default=Path("calibration"),
    show_default=True,
    help="Folder for the dated file; nothing in it is overwritten.",
)
def stereo(
    source: Path | None,
    kind: str,
    square: float | None,
    marker: float | None,
    size: tuple[int, int] | None,
    views: int,
    factory: Path | None,
    mode: str,
    output: Path,
    **mounting: Any,
) -> None:
    """Both eyes of the ZED, and where the left one sits on the car.

    SOURCE is a folder of side-by-side pictures of a board, a video, or a session whose ZED saw one;
    or --factory takes what Stereolabs measured. Exit code 1 when the result is rejected.
    """
    from calibration.stereo.calibrate import factory_stereo
    from capture import write_calibration
    from drivers.camera.zed import ZED_MODES

    if (source is None) == (factory is None):
        raise UsageError("give either a SOURCE with pictures of a board or --factory SN12345.conf")
    if mode not in ZED_MODES:
        raise UsageError(f"--mode {mode}: is none of {', '.join(ZED_MODES)}")
    placed = _mounting(mounting)
    if factory is not None:
        result = factory_stereo(factory, mode, placed)
    else:
        assert source is not None
        result = _from_board(source, (kind, size, square, marker), views, placed)
    file = write_calibration(output, result)
    click.echo(stereo_table(result).render("table"))
    click.echo("accepted" if result.accepted else "rejected")
    for reason in result.reasons:
        click.echo(f"  {reason}")
    if placed.z_m <= 0.0:
        click.echo("note: the eye is told to be on the floor; give --x, --y, --z and --pitch")
    click.echo(f"wrote {file}")
    click.echo(f"next: trackside vo SESSION --calibration {file}")
    click.get_current_context().exit(0 if result.accepted else 1)


def _mounting(given: dict[str, float]) -> Mounting:
    from geometry import Mounting

    turns = {name: math.radians(given[name]) for name in ("roll", "pitch", "yaw")}
    if abs(given["pitch"]) > 90.0:
        raise UsageError(f"--pitch {given['pitch']:g}: expected -90 to 90 degrees")
    return Mounting(
        x_m=given["x"], y_m=given["y"], z_m=given["z"],
        roll_rad=turns["roll"], pitch_rad=turns["pitch"], yaw_rad=turns["yaw"],
    )  # fmt: skip


def _from_board(
    source: Path, words: tuple[str, Any, Any, Any], views: int, mounting: Mounting
) -> StereoCalibration:
    from calibration.boards import board_of
    from calibration.pictures import Skipped
    from calibration.stereo.calibrate import calibrate_stereo
    from calibration.stereo.sightings import PairSightings, stereo_pictures

    skipped = Skipped()
    pictures, stills = stereo_pictures(source, skipped)
    seen = PairSightings(board_of(*words), None if stills else FRESH_SHARE)
    seen.add_all(pictures, 10**9 if stills else views)
    for line in skipped.lines:
        click.echo(line, err=True)
    result = calibrate_stereo(seen, mounting, {"source": str(source)})
    click.echo(f"{len(seen.found)} of {seen.pictures} pictures gave a new view of the board")
    return result


def stereo_table(calibration: StereoCalibration) -> Table:
    """Both lenses, how the eyes stand to each other, the mounting, and what is left over."""
    from geometry import INTRINSICS, intrinsics_of

    rows: list[tuple[Cell, ...]] = [
        (name, left, right)
        for name, left, right in zip(
            INTRINSICS, intrinsics_of(calibration.left).tolist(),
            intrinsics_of(calibration.right).tolist(), strict=True,
        )
    ]  # fmt: skip
    size = f"{calibration.left.width_px}x{calibration.left.height_px}"
    title = f"stereo, two eyes of {size}, {calibration.made_utc}"
    return Table(("parameter", "left", "right"), tuple(rows), title,
                 "\n".join(_notes(calibration)), digits=5)  # fmt: skip


def _notes(calibration: StereoCalibration) -> list[str]:
    pair, mounting = calibration.pair, calibration.mounting
    lines = [f"baseline {1e3 * pair.baseline_m:.3f} mm" + _sigma(calibration.translation_sigma_m)]
    turn = math.degrees(math.acos(min(1.0, (float(pair.rotation.trace()) - 1.0) / 2.0)))
    lines.append(f"the eyes are turned by {turn:.3f} deg to each other")
    if calibration.rms_px is not None and calibration.epipolar_rms_px is not None:
        used = sum(view.used for view in calibration.views)
        lines.append(f"rms {calibration.rms_px:.3f} px in {used} views, out of line by "
                     f"{calibration.epipolar_rms_px:.3f} px")  # fmt: skip
    lines += [f"left out {view.name}: {view.rms_px:.2f} px, {view.why}"
              for view in calibration.views if not view.used]  # fmt: skip
    lines.append(
        f"left eye at x {mounting.x_m:.3f}, y {mounting.y_m:.3f}, z {mounting.z_m:.3f} m on the "
        f"car, looking down {math.degrees(mounting.pitch_rad):.2f} deg"
    )
    return lines


def _sigma(sigma_m: tuple[float, ...] | None) -> str:
    return "" if sigma_m is None else f" (sigma {1e3 * sigma_m[0]:.3f} mm)"
