"""The command `trackside calibrate lidar`."""

from __future__ import annotations

from pathlib import Path

import click

from calibration.cli import FOLDER, conclude
from calibration.length import length

_PATH = click.Path(path_type=Path)


@click.command("lidar")
@click.argument("sessions", type=_PATH, nargs=-1, required=True)
@click.option(
    "--cone-radius",
    callback=length,
    metavar="LENGTH",
    default="50mm",
    show_default=True,
    help="Of the cones at the height of the lidar's plane.",
)
@FOLDER
@click.pass_context
def lidar(ctx: click.Context, sessions: tuple[Path, ...], cone_radius: float, output: Path) -> None:
    """Where the lidar sits on the car (x, y, yaw), from cones of known place.

    On site, in view of the overhead camera:

    1. Set up six or more cones as for a run, also left and right of the path; film their rings.

    2. Drive for half a minute among them, slowly, turning both ways, passing them within 2 m.

    3. trackside join, trackside track, then this with all such SESSIONS.

    Best after calibrate markers: what the rings' lever arm is wrong by, this is, too. It also tells
    a bias of the ranges and how late the lidar's stamps are. Exit code 1 when it is rejected.
    """
    import numpy as np

    from calibration.lidar.calibrate import calibrate_lidar
    from calibration.lidar.picture import write_lidar_picture
    from capture import Session

    opened = [Session.open(folder) for folder in sessions]
    known = opened[0].measured("lidar")
    before = np.array([known.get(name, 0.0) for name in ("x_m", "y_m", "yaw_rad")])
    how = {"sessions": [session.name for session in opened], "cone_radius_m": cone_radius}
    result = calibrate_lidar(opened, before, cone_radius, how)
    conclude(
        ctx,
        output,
        result.calibration,
        lambda file: write_lidar_picture(file, result),
        f"trackside calibrate apply SESSION --calibration {output}, then trackside slam SESSION",
    )
