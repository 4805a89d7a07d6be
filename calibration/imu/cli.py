"""The command `trackside calibrate imu`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibration.cli import FOLDER, conclude
from dialogue import UsageError

if TYPE_CHECKING:
    from calibration.imu.scale import Scale
    from calibration.imu.still import StillPart
    from capture import Imu
    from geometry import Floats

_PATH = click.Path(path_type=Path)


@click.command("imu")
@click.argument("place", metavar="SESSION|CSV", type=_PATH)
@click.option(
    "--truth",
    "truths",
    type=_PATH,
    multiple=True,
    metavar="SESSION",
    help="Sessions with ground truth, for the gyro's scale; repeatable.  [default: SESSION itself]",
)
@click.option(
    "--turns", type=float, help="It was turned by hand so many times about z, mark to mark."
)
@FOLDER
@click.pass_context
def imu(
    ctx: click.Context, place: Path, truths: tuple[Path, ...], turns: float | None, output: Path
) -> None:
    """Bias, noise and scale of the gyro, gravity and mounting, hard and soft iron of a compass.

    On site, one of these or both:

    1. trackside record --map bench: leave the car alone, motor off, for two minutes or more (an
    hour shows the bias instability); nobody walks beside it.

    2. For the scale: a tracked session with circles (--truth), or by hand: 5 s at rest on a mark,
    five full turns on the floor, 5 s at rest on the mark (--turns 5). For the compass go on:
    nose up and round, on its side and round.

    A CSV is an imu.csv of trackside export csv. Exit code 1 when it is rejected.
    """
    from calibration.imu.calibrate import calibrate_imu
    from calibration.imu.picture import write_imu_picture
    from calibration.imu.still import still_part

    samples, field_t, own = _read(place)
    still = still_part(samples)
    scale = _scale(samples, still, [*truths, *([] if truths else own)], bool(truths), turns)
    how = {"sessions": [place.name], "truth": [str(one) for one in truths], "turns": turns}
    result = calibrate_imu(samples, scale, field_t, how, still=still)
    conclude(
        ctx,
        output,
        result.calibration,
        lambda file: write_imu_picture(file, result),
        f"trackside calibrate apply SESSION --calibration {output}",
    )


def _read(place: Path) -> tuple[Imu, Floats | None, list[Path]]:
    """The samples, the readings of a compass, and the session itself if it has ground truth."""
    from capture import MissingStreamError, Session, read_imu_csv

    if place.suffix == ".csv":
        return read_imu_csv(place), None, []
    session = Session.open(place)
    try:
        field_t = session.magnetic_field().field_t
    except MissingStreamError:
        field_t = None
    return session.imu(), field_t, [place] if session.has_ground_truth else []


def _scale(
    samples: Imu, still: StillPart, truths: list[Path], asked: bool, turns: float | None
) -> Scale | None:
    """The scale by what there is; raises `UsageError` where it was asked for and cannot be."""
    from calibration.imu.scale import scale_of_fits, scale_of_turns
    from calibration.turning import fit_gyro
    from capture import Session

    if turns is not None:
        if asked:
            raise UsageError("give --truth or --turns for the scale, not both")
        if turns == 0:
            raise UsageError("--turns 0 tells no scale; expected for example 5")
        return scale_of_turns(samples, still, turns)
    sessions = [Session.open(folder) for folder in truths]
    fits = [fit_gyro(session.ground_truth().path, session.imu()) for session in sessions]
    found = [fit for fit in fits if fit is not None]
    if asked and not found:
        raise UsageError(
            "--truth: the car turned by less than half a turn while it was filmed; drive circles"
        )
    return scale_of_fits(found) if found else None
