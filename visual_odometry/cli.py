"""The command `trackside vo`: stereo pictures of a session -> `/viso/odom`."""

from __future__ import annotations

from dataclasses import replace as replaced
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import Cell, Progress, Table, UsageError
from dialogue.options import format_option

if TYPE_CHECKING:
    from capture import Session, StereoCalibration
    from visual_odometry.config import VoConfig
    from visual_odometry.run import VoRun

_PATH = click.Path(path_type=Path)
_MOUNTING = "mounting."


@click.command("vo")
@click.argument("session", type=_PATH)
@click.option(
    "--calibration",
    "place",
    type=_PATH,
    help="Stereo calibration, or a folder whose newest is taken.  [default: the session's own, "
    "else calibration]",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change one parameter, e.g. key_frame_m=0.05, or where the left eye sits on the car, "
    "mounting.z_m=0.22, mounting.pitch_rad=0.21 (down); may be repeated.",
)
@click.option("--replace", is_flag=True, help="Make visual odometry that is there anew.")
@format_option()
def vo(
    session: Path,
    place: Path | None,
    settings: tuple[str, ...],
    replace: bool,
    table_format: str,
) -> None:
    """Visual odometry of SESSION from its stereo pictures, kept in its viso.mcap.

    trackside slam --odometry viso then uses it, or imu+viso.
    """
    from capture import Session, calibration_file, read_stereo_calibration, usual_calibrations
    from visual_odometry.run import SOURCE, run_session

    recording = Session.open(session)
    if (session / f"{SOURCE}.mcap").exists() and not replace:
        raise UsageError(f"{session} has visual odometry already; give --replace to make it anew")
    recording.stereo_images()  # asked before the calibration: without pictures none is needed
    file = calibration_file(place or usual_calibrations(session, "stereo"), "stereo")
    calibration, config = _configured(read_stereo_calibration(file), settings)
    click.echo(f"calibration: {file}", err=True)
    if not calibration.accepted:
        click.echo(f"note: it was rejected: {'; '.join(calibration.reasons)}", err=True)
    with Progress("visual odometry", recording.stereo_count) as progress:
        run = run_session(recording, calibration, config, progress.advance)
    written = recording.add_odometry(run.told, replace=replace)
    recording.adopt_calibrations([file])
    click.echo(summary_table(recording, run).render(table_format))
    click.echo(f"wrote {written}", err=True)
    click.echo(f"next: trackside slam {session} --odometry {SOURCE}", err=True)


def _configured(
    calibration: StereoCalibration, settings: tuple[str, ...]
) -> tuple[StereoCalibration, VoConfig]:
    from capture import with_overrides
    from visual_odometry.config import VoConfig

    own = [word.removeprefix(_MOUNTING) for word in settings if word.startswith(_MOUNTING)]
    others = [word for word in settings if not word.startswith(_MOUNTING)]
    placed = replaced(calibration, mounting=with_overrides(calibration.mounting, own))
    return placed, with_overrides(VoConfig(), others)


def summary_table(recording: Session, run: VoRun) -> Table:
    """What came out, and with a ground truth how far it ran away from it."""
    import math

    import numpy as np

    from visual_odometry.drift import drift_of

    odometry, seen = run.told.odometry, [one for one in run.frames if one.inliers]
    heading = np.unwrap(odometry.pose_odom_base[:, 2])
    total = len(run.frames) + run.damaged
    rows: list[tuple[Cell, ...]] = [
        ("pictures", total),
        ("tracked [%]", 100.0 * run.tracked / total),
        ("damaged", run.damaged),
        ("points in agreement, mean", sum(one.inliers for one in seen) / max(len(seen), 1)),
        ("their error [px]", sum(one.sigma_px for one in seen) / max(len(seen), 1)),
        ("distance [m]", run.distance_m),
        ("turned [deg]", math.degrees(float(heading[-1] - heading[0]))),
        ("lost stretches", len(run.lost_s)),
        ("lost [s]", float(run.lost_s[:, 1].sum())),
    ]
    truth = recording.ground_truth().path if recording.has_ground_truth else None
    drift = drift_of(odometry, truth) if truth is not None else None
    if drift is not None:
        rows += [
            ("against the truth over [m]", drift.distance_m),
            ("end is off [mm]", 1e3 * drift.end_m),
            ("drift [%]", 100.0 * drift.end_m / drift.distance_m),
            ("drift of a metre [%]", None if drift.per_metre is None else 100.0 * drift.per_metre),
            ("heading is off [deg]", math.degrees(drift.heading_rad)),
            ("scale", drift.scale),
        ]
    lost = [f"lost at {at:.1f} s for {length:.1f} s" for at, length in run.lost_s.tolist()]
    return Table(("visual odometry", "value"), tuple(rows), recording.name, "\n".join(lost))
