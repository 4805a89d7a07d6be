"""The command `trackside slam`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dialogue import UsageError
from slam.catalogue import ALGORITHMS

if TYPE_CHECKING:
    from capture import Estimate
    from slam.algorithms import Request
    from slam.run import RunReport


class _AlgorithmOption(click.Option):
    """An option whose help names the algorithms there are, once it is asked for."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        self.help = f"{', '.join(ALGORITHMS)}.  [default: ekf]"
        return super().get_help_record(ctx)


@click.command("slam")
@click.argument("session", type=click.Path(path_type=Path), required=False)
@click.option("--algorithm", cls=_AlgorithmOption, metavar="NAME")
@click.option(
    "--association",
    metavar="RULE",
    help="Whose a sighting is. known: the sensor names its landmarks; nearest, for ekf also jcbb "
    "(joint compatibility); for fastslam likelihood.  [default: known where they have ids, else "
    "nearest or likelihood]",
)
@click.option(
    "--preset",
    default="robust",
    show_default=True,
    metavar="NAME|FILE.yaml",
    help="Parameters to start from: thesis, robust, or a file that trackside slam tune wrote.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change one parameter, e.g. observation.range_sigma_m=0.1, or of the cone finder, "
    "cones.max_range_m=2.5, or of the odometry, odometry.wheelbase_m=0.33; may be repeated.",
)
@click.option(
    "--odometry",
    metavar="SOURCE",
    help="vesc, wheel, zed, viso, ..., or tachometer (counted distance, commanded steering); "
    "imu+SOURCE takes its turning from the gyro.",
)
@click.option(
    "--seed", default=0, show_default=True, help="Of the random numbers of fastslam, fastslam2."
)
@click.option("--smooth", is_flag=True, help="Refine path and map with all data at once.")
@click.option("--name", help="Name of the estimate.  [default: the algorithm's]")
@click.option("--replace", is_flag=True, help="Replace an estimate of that name.")
@click.option("--follow", is_flag=True, help="SESSION is being recorded: keep up with it.")
@click.option(
    "--patience",
    "patience_s",
    type=click.FloatRange(min=0.0),
    default=10.0,
    show_default=True,
    metavar="S",
    help="For --follow: end when nothing came for so long.",
)
@click.option(
    "--explain-range", is_flag=True, help="Print at which distances cones are found, and end."
)
@click.option(
    "--beam-spacing",
    "spacing_deg",
    default=1.0,
    show_default=True,
    metavar="DEG",
    help="For --explain-range: angle between two beams.",
)
def slam(
    session: Path | None,
    preset: str,
    settings: tuple[str, ...],
    name: str | None,
    replace: bool,
    follow: bool,
    patience_s: float,
    explain_range: bool,
    spacing_deg: float,
    **choices: Any,
) -> None:
    """Estimate path and landmark map of SESSION and keep them in its estimates/NAME.

    trackside slam tune searches the parameters that score best.
    """
    if explain_range:
        click.echo(_range_table(preset, settings, spacing_deg))
        return
    if session is None:
        raise UsageError("expected a SESSION: trackside slam SESSION")
    from capture import Session
    from slam.algorithms import estimate_session
    from slam.session_defaults import for_session

    recording = Session.open(session)
    request = for_session(_request(preset, settings, choices), recording)
    name = name or request.algorithm
    if name in recording.estimates and not replace:
        raise UsageError(f"{session} has an estimate {name!r} already; give --name or --replace")
    if follow:
        from slam.follow import follow_session
        from slam.follow_display import Display

        with Display(click.echo) as display:
            done = follow_session(
                recording, request, name, patience_s=patience_s, show=display.show
            )
        click.echo(f"{done.why}; following ends")
        estimate, report, notes = done.estimate, done.report, done.notes
    else:
        estimate, report, notes = estimate_session(recording, request, name)
    recording.write_estimate(estimate, replace=replace)
    click.echo("\n".join([*_summary(estimate, report), *notes]))
    click.echo(f"wrote {session / 'estimates' / name}\nnext: trackside score {session}")


def _request(preset: str, settings: tuple[str, ...], choices: dict[str, Any]) -> Request:
    """What shall be run; the words of the command go before those of a preset's file."""
    from slam.algorithms import Request
    from slam.preset_file import is_preset_file, read_preset_file

    given = {key: value for key, value in choices.items() if value is not None}
    if not is_preset_file(preset):
        return Request(preset=preset, settings=settings, **given)
    file = read_preset_file(Path(preset))
    if given.get("algorithm", file.algorithm) != file.algorithm:
        raise UsageError(
            f"--algorithm {given['algorithm']}: {preset} is a preset of {file.algorithm}; leave "
            "one of them out"
        )
    found = {"odometry": file.odometry, "association": file.association}
    return Request(
        **{**found, "algorithm": file.algorithm, **given},
        preset=file.preset,
        settings=(*file.words, *settings),
    )


def _range_table(preset: str, settings: tuple[str, ...], spacing_deg: float) -> str:
    from slam.cones.config import cone_config
    from slam.cones.geometry import explain_range

    own = [text.removeprefix("cones.") for text in settings]
    return explain_range(cone_config(preset, own), math.radians(spacing_deg)).render("table")


def _summary(estimate: Estimate, report: RunReport) -> list[str]:
    path, seen = estimate.path, report.updates
    factor = report.duration_s / max(report.cpu_s, 1e-9)
    lines = [
        f"{estimate.name}: {len(path)} poses over {path.duration_s:.1f} s and "
        f"{path.length_m:.1f} m, {len(estimate.map or ())} landmarks",
        f"{report.scans} scans: {seen.matched} observations matched, {seen.added} new, "
        f"{seen.ignored} ignored, {seen.rejected} rejected",
        f"{report.cpu_s:.2f} s of computing, {factor:.0f} times as fast as it was driven",
    ]
    faults = (
        (report.outside_odometry, "scans outside the time of the odometry were left out"),
        (seen.invalid, "observations without a finite range and bearing were left out"),
        (seen.over_limit, "observations were beyond the limit of a scan or of the map"),
        (seen.removed, "landmarks were given up again"),
        (seen.cut_short, "scans reached the limit of the joint search"),
    )
    return lines + [f"{count} {what}" for count, what in faults if count]
