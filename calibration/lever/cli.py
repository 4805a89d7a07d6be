"""The command `trackside calibrate markers`."""

from __future__ import annotations

from pathlib import Path

import click

from calibration.cli import FOLDER, conclude

_PATH = click.Path(path_type=Path)


@click.command("markers")
@click.argument("sessions", type=_PATH, nargs=-1, required=True)
@FOLDER
@click.pass_context
def markers(ctx: click.Context, sessions: tuple[Path, ...], output: Path) -> None:
    """Where the two rings sit on the car: ahead of the rear axle, to its side, their line's yaw.

    On site, in view of the overhead camera:

    1. Glue both rings on the car for good; measure them roughly into scene.yaml.

    2. Drive two full circles to the left and two to the right as slowly as it goes, the same at
    about twice that speed (which tells the slip of the tyres), and a few metres straight on.

    3. trackside join, trackside track, then this with all such SESSIONS (one scene.yaml for all).

    The truth's own lever arm is read from it, so the result is absolute. The side needs the
    tachometer. Exit code 1 when it is rejected.
    """
    from calibration.driven import driven_of
    from calibration.errors import CalibrationError
    from calibration.lever.assumed import assumed_rings
    from calibration.lever.calibrate import calibrate_lever, scene_text
    from calibration.lever.picture import write_lever_picture
    from capture import Session

    opened = [Session.open(folder) for folder in sessions]
    assumed = [assumed_rings(session) for session in opened]
    if any(rings != assumed[0] for rings in assumed):
        raise CalibrationError(
            "the truths of these sessions were made with different lever arms; make them anew "
            "with one scene.yaml: trackside track SESSION --replace"
        )
    drives = [driven_of(session) for session in opened]
    how = {"sessions": [session.name for session in opened]}
    result = calibrate_lever(drives, assumed[0], how)
    if result.calibration.accepted:
        click.echo("for scene.yaml:\n" + scene_text(result.rings))
    conclude(
        ctx,
        output,
        result.calibration,
        lambda file: write_lever_picture(file, result),
        "put the lines above into scene.yaml, then trackside track SESSION --replace",
    )
