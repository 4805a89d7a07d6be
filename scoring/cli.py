"""`trackside score`: estimates against the truth, as a table, JSON, CSV or a report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click

from capture import (
    Estimate,
    GroundTruth,
    MissingStreamError,
    Session,
    SessionInfo,
    read_estimated_map,
    read_landmarks,
    read_planar_tum,
    read_tum,
    write_text,
)
from dialogue import UsageError
from dialogue.options import format_option
from scoring.flags import GroupedCommand, options_from_flags, score_flags
from scoring.options import PRESETS, ScoreOptions
from scoring.result import Score, to_json
from scoring.score import score as score_plane
from scoring.score import score_space
from scoring.score_table import (
    error_table,
    flat_table,
    metric_table,
    overview_table,
    series_table,
)
from scoring.thresholds import Threshold, breaches

EXIT_BREACH = 3

_FILE = click.Path(path_type=Path)


@dataclass(frozen=True)
class _Inputs:
    """A session and the names of its estimates, or files from elsewhere."""

    session: Path | None
    names: tuple[str, ...]
    truth: Path | None
    cones: Path | None
    paths: tuple[Path, ...]
    maps: tuple[Path, ...]

    def __post_init__(self) -> None:
        elsewhere = bool(self.truth or self.cones or self.paths or self.maps)
        if (self.session is None) != elsewhere:
            raise UsageError(
                "expected either a SESSION, or --truth T.tum [--cones C.csv] with "
                "--path P.tum [--map M.csv]"
            )
        if elsewhere and (self.truth is None or not self.paths):
            raise UsageError("files from elsewhere need both --truth T.tum and --path P.tum")
        if elsewhere and self.names:
            raise UsageError("--estimate names an estimate of a SESSION; with --truth use --path")
        if self.maps and len(self.maps) != len(self.paths):
            raise UsageError(
                f"{len(self.maps)} --map for {len(self.paths)} --path: expected one per path, in "
                "the same order, or none"
            )


@click.command(cls=GroupedCommand, short_help="Score estimates against the truth.")
@click.argument("session", type=_FILE, required=False)
@click.option("--estimate", "names", multiple=True, metavar="NAME", help="Only these of SESSION.")
@click.option("--truth", type=_FILE, metavar="FILE", help="True path (TUM) of another source.")
@click.option("--cones", type=_FILE, metavar="FILE", help="True landmarks (CSV: id, x, y).")
@click.option("--path", "paths", type=_FILE, multiple=True, metavar="FILE", help="Estimated path.")
@click.option(
    "--map", "maps", type=_FILE, multiple=True, metavar="FILE", help="Map of each --path, in order."
)
@format_option("What is printed.")
@click.option("-o", "--output", type=_FILE, metavar="FILE", help="Write the scores as JSON too.")
@click.option("--report", type=_FILE, metavar="FILE", help="Write the report (HTML) there.")
@click.option("--no-report", is_flag=True, help="Write no report into the session.")
@click.option("--errors", type=_FILE, metavar="FILE", help="Write the error at each pose as CSV.")
@click.option(
    "--fail-above",
    multiple=True,
    metavar="NAME=VALUE",
    help="Exit with 3 when an error or metric is larger or undefined; repeatable.",
)
@click.option(
    "--preset",
    type=click.Choice(tuple(PRESETS)),
    default="thesis",
    show_default=True,
    help="Choices to begin with; thesis-print takes the Totals as the thesis printed them.",
)
@score_flags
def score(
    session: Path | None,
    names: tuple[str, ...],
    truth: Path | None,
    cones: Path | None,
    paths: tuple[Path, ...],
    maps: tuple[Path, ...],
    table_format: str,
    output: Path | None,
    report: Path | None,
    no_report: bool,
    errors: Path | None,
    fail_above: tuple[str, ...],
    preset: str,
    **choices: object,
) -> None:
    """Score the estimates of SESSION, or of files from elsewhere, against the truth.

    A SESSION keeps the result: scores/NAME.json per estimate and report.html. Files from elsewhere
    come in the order truth, path; nothing is written unless asked for.

    \b
    trackside score 2026-05-14_turn_low_1
    trackside score --truth car.tum --cones cones.csv --path est.tum --map map.csv
    """  # noqa: D301  click wants the control character itself
    options = options_from_flags(preset, choices)
    thresholds = [Threshold.from_text(text) for text in fail_above]
    inputs = _Inputs(session, names, truth, cones, paths, maps)
    if session is None:
        title, subtitle = inputs.paths[0].stem, ""
        scores = _scores_of_files(inputs, options)
    else:
        opened = Session.open(session)
        title, subtitle = opened.name, _driven(opened.info)
        scores = _scores_of_session(opened, names, options)
        _keep_scores(opened, scores)
        report = report or (None if no_report else session / "report.html")
    click.echo(_rendered(scores, options, table_format))
    if output is not None:
        write_text(output, _json(scores) + "\n")
    if errors is not None:
        write_text(errors, series_table(scores).render("csv") + "\n")
    if report is not None:
        _write_report(report, scores, title, subtitle)
    _exit_on(breaches(scores, thresholds))


def _exit_on(broken: Sequence[str]) -> None:
    for line in broken:
        click.echo(f"failed: {line}", err=True)
    if broken:
        click.get_current_context().exit(EXIT_BREACH)


def _scores_of_session(
    session: Session, names: tuple[str, ...], options: ScoreOptions
) -> list[Score]:
    if options.space == "3d":
        raise UsageError("--space 3d: a session is planar; use --truth and --path")
    names = tuple(dict.fromkeys(names)) or session.estimates
    if not names:
        raise MissingStreamError(
            f"{session.folder} has no estimate to score; make one with "
            f"trackside slam {session.folder}"
        )
    truth = session.ground_truth()
    return [score_plane(truth, session.estimate(name), options) for name in names]


def _keep_scores(session: Session, scores: Sequence[Score]) -> None:
    for result in scores:
        file = session.score_file(result.name)
        file.parent.mkdir(exist_ok=True)
        write_text(file, _json([result]) + "\n")


def _scores_of_files(inputs: _Inputs, options: ScoreOptions) -> list[Score]:
    assert inputs.truth is not None
    names = _names(inputs.paths)
    if options.space == "3d":
        if inputs.cones or inputs.maps:
            raise UsageError("--space 3d scores paths only: leave --cones and --map out")
        return _space_scores(inputs.truth, dict(zip(names, inputs.paths, strict=True)), options)
    path, lost = read_planar_tum(inputs.truth)
    truth = GroundTruth(path, read_landmarks(inputs.cones) if inputs.cones else None)
    maps = inputs.maps or (None,) * len(inputs.paths)
    scores = []
    for name, path_file, map_file in zip(names, inputs.paths, maps, strict=True):
        own_path, own_lost = read_planar_tum(path_file)
        own_map = read_estimated_map(map_file) if map_file else None
        result = score_plane(truth, Estimate(name, own_path, own_map), options)
        scores.append(_with_losses(result, {inputs.truth: lost, path_file: own_lost}))
    return scores


def _space_scores(truth_file: Path, files: dict[str, Path], options: ScoreOptions) -> list[Score]:
    truth = read_tum(truth_file)
    scores = []
    for name, file in files.items():
        own = read_tum(file)
        result = score_space(truth.path, own.path, name, options)
        scores.append(_with_losses(result, {truth_file: truth.dropped, file: own.dropped}))
    return scores


def _names(paths: Sequence[Path]) -> list[str]:
    """The file stems, or as much of the whole paths as tells them apart."""
    for depth in range(1, max(len(path.parts) for path in paths) + 1):
        names = ["/".join(path.with_suffix("").parts[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    raise UsageError("the same file is given as --path twice: expected each estimate once")


def _with_losses(result: Score, losses: dict[Path, int]) -> Score:
    remarks = [
        f"{count} poses of {file.name} were not finite" for file, count in losses.items() if count
    ]
    return replace(result, remarks=(*remarks, *result.remarks))


def _rendered(scores: Sequence[Score], options: ScoreOptions, table_format: str) -> str:
    if table_format == "json":
        return _json(scores)
    if table_format == "csv":
        return flat_table(scores).render("csv")
    tables = [overview_table(scores)] if len(scores) > 1 else []
    tables += [error_table(result, options.weights) for result in scores]
    tables.append(metric_table(scores))
    return "\n\n".join(table.render(table_format) for table in tables)


def _json(scores: Sequence[Score]) -> str:
    return json.dumps(to_json(scores), indent=2, allow_nan=False)


def _write_report(file: Path, scores: Sequence[Score], title: str, subtitle: str) -> None:
    from scoring.report import write_report

    write_report(file, scores, title, subtitle)
    click.echo(f"report: {file}", err=True)


def _driven(info: SessionInfo) -> str:
    """Map, power and trial of a session, as far as they are known."""
    trial = "" if info.trial is None else f"trial {info.trial}"
    return ", ".join(part for part in (info.map, info.power, trial) if part)
