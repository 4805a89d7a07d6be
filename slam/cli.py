"""The command `trackside slam`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import UsageError
from slam.config import PRESETS

if TYPE_CHECKING:
    from capture import Estimate
    from slam.run import RunReport


@click.command("slam")
@click.argument("session", type=click.Path(path_type=Path))
@click.option("--algorithm", default="ekf", show_default=True, help="ekf")
@click.option(
    "--association",
    type=click.Choice(["known", "nearest"]),
    default="known",
    show_default=True,
    help="known: the sensor names its landmarks; nearest: by individual compatibility.",
)
@click.option(
    "--preset",
    type=click.Choice(sorted(PRESETS)),
    default="robust",
    show_default=True,
    help="Parameter set to start from.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change one parameter, e.g. observation.range_sigma_m=0.1; may be repeated.",
)
@click.option("--odometry", help="Odometry source (vesc, wheel, zed, viso, ...).")
@click.option("--name", help="Name of the estimate.  [default: the algorithm's]")
@click.option("--replace", is_flag=True, help="Replace an estimate of that name.")
def slam(
    session: Path,
    algorithm: str,
    association: str,
    preset: str,
    settings: tuple[str, ...],
    odometry: str | None,
    name: str | None,
    replace: bool,
) -> None:
    """Estimate path and landmark map of SESSION and keep them in its estimates/NAME."""
    from capture import Session
    from slam.algorithms import estimate_session

    recording = Session.open(session)
    name = name or algorithm
    if name in recording.estimates and not replace:
        raise UsageError(f"{session} has an estimate {name!r} already; give --name or --replace")
    estimate, report = estimate_session(
        recording,
        algorithm=algorithm,
        association=association,
        preset=preset,
        overrides=settings,
        odometry=odometry,
        name=name,
    )
    recording.write_estimate(estimate, replace=replace)
    click.echo(_summary(estimate, report))
    click.echo(f"wrote {session / 'estimates' / name}\nnext: trackside score {session}")


def _summary(estimate: Estimate, report: RunReport) -> str:
    path, seen = estimate.path, report.updates
    factor = report.duration_s / max(report.cpu_s, 1e-9)
    lines = [
        f"{estimate.name}: {len(path)} poses over {path.duration_s:.1f} s and "
        f"{path.length_m:.1f} m, {len(estimate.map or ())} landmarks",
        f"{report.scans} scans: {seen.matched} observations matched, {seen.added} new, "
        f"{seen.ignored} ignored, {seen.rejected} rejected",
        f"{report.cpu_s:.2f} s of computing, {factor:.0f} times as fast as it was driven",
    ]
    if report.outside_odometry:
        lines.append(
            f"{report.outside_odometry} scans outside the time of the odometry were left out"
        )
    return "\n".join(lines)
