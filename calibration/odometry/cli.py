"""The command `trackside calibrate odometry`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibration.cli import FOLDER, conclude
from calibration.length import length

if TYPE_CHECKING:
    from capture import MeasuredCalibration, Session
    from drivers.vesc import VescCalibration

_PATH = click.Path(path_type=Path)


@click.command("odometry")
@click.argument("sessions", type=_PATH, nargs=-1, required=True)
@click.option(
    "--wheelbase",
    callback=length,
    metavar="LENGTH",
    help="From axle to axle by a tape, e.g. 260mm; without it the steering gain is unknown.",
)
@click.option(
    "--wheelbase-sigma",
    callback=length,
    metavar="LENGTH",
    default="2mm",
    show_default=True,
    help="How well the tape was read (one sigma).",
)
@click.option("--speed-only", is_flag=True, help="Counts to metres alone; needs no /drive.")
@FOLDER
@click.pass_context
def odometry(
    ctx: click.Context,
    sessions: tuple[Path, ...],
    wheelbase: float | None,
    wheelbase_sigma: float,
    speed_only: bool,
    output: Path,
) -> None:
    """Speed gain, steering gain and offset, wheelbase, servo lag, against the overhead truth.

    On site, in view of the overhead camera:

    1. Measure the wheelbase with a tape, axle to axle.

    2. trackside record --map figures: stand 3 s; then through the motor controller a straight
    line, two slow full circles to the left, two to the right, the same again twice as fast,
    and some with the wheels turned nearly as far as they go.

    3. trackside join, trackside track, then this with all such SESSIONS.

    What the data cannot tell is refused with what to drive. Exit code 1 when it is rejected.
    """
    from calibration.driven import driven_of
    from calibration.odometry.calibrate import calibrate_odometry
    from calibration.odometry.picture import write_odometry_picture
    from calibration.odometry.result import Tape
    from capture import Session

    opened = [Session.open(folder) for folder in sessions]
    old = _believed(opened[0])
    tape = None if wheelbase is None else Tape(wheelbase, wheelbase_sigma)
    drives = [driven_of(session) for session in opened]
    how = {"sessions": [session.name for session in opened], "tape": tape, "speed_only": speed_only}
    result = calibrate_odometry(drives, old, tape, speed_only=speed_only, how=how)
    if result.calibration.accepted:
        click.echo(rig_text(result.calibration))
    conclude(
        ctx,
        output,
        result.calibration,
        lambda file: write_odometry_picture(file, result),
        f"trackside calibrate apply SESSION --calibration {output}; the lines above for rig.yaml",
    )


def _believed(session: Session) -> VescCalibration:
    from calibration.errors import CalibrationError

    old = session.motor_calibration()
    if old is None:
        raise CalibrationError(
            f"{session.folder}: session.yaml names no vesc_calibration; record it with a rig that "
            "has one, however wrong (trackside devices writes f1tenth's)"
        )
    return old


def rig_text(calibration: MeasuredCalibration) -> str:
    """The block of `rig.yaml` for this calibration."""
    names = (
        "speed_to_erpm_gain",
        "steering_angle_to_servo_gain",
        "steering_angle_to_servo_offset",
        "wheelbase_m",
        "direction",
        "low_speed_erpm",
    )
    lines = [f"  {name}: {calibration.value(name):.8g}" for name in names]
    return "\n".join(["vesc_calibration:", *lines])
