"""The command `trackside campaign`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import Progress, TracksideError, UsageError, nearest_names
from dialogue.options import format_option

if TYPE_CHECKING:
    from trackside.campaign.results import Found
    from trackside.campaign.work import Done, SessionJob
    from trackside.workers import Failure, Runner

_PATH = click.Path(path_type=Path)
SHOWN = 20
"""Failures listed; all of them would hide the first."""


@click.command("campaign", short_help="A whole experiment, to one report.")
@click.argument("file", type=_PATH, metavar="FILE.yaml|NAME")
@click.option("-o", "--output", type=_PATH, help="Folder for everything.  [default: as FILE says]")
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Processes, each with one thread; 1 does all in this one.  [default: one per core]",
)
@click.option(
    "--scheduler", metavar="tcp://HOST:PORT", help="Run on the workers of this dask scheduler."
)
@format_option("How the table of means is printed.")
def campaign(
    file: Path, output: Path | None, workers: int | None, scheduler: str | None, table_format: str
) -> None:
    """Do everything that FILE says: sessions, estimates, scores and one report.

    NAME is a campaign that comes with trackside: thesis. What was done before by the same inputs is
    not done again, so that a campaign that was interrupted or changed goes on from there.

    \b
    trackside campaign thesis
    trackside campaign mine.yaml -o results --workers 4
    """  # noqa: D301  click wants the control character itself
    from scoring.comparison.overview import overview
    from trackside.campaign.plan import drives_of, read_campaign
    from trackside.campaign.results import Found, comparisons
    from trackside.campaign.work import session_job, shared_job

    place = _campaign_file(file)
    plan = read_campaign(place)
    folder = (output or plan.output or Path(place.stem)).absolute()
    drives = drives_of(plan)
    runner = _runner(workers, scheduler)
    jobs = tuple(session_job(folder, drive, plan) for drive in drives)
    _do_shared(shared_job(folder, drives, plan), runner)
    outcomes = _done(jobs, runner)
    found = Found(plan, jobs, {job.name: outcomes[job.name] for job in jobs})
    compared = comparisons(found)
    if compared:
        click.echo(overview(compared).render(table_format))
        told = _report(found, place, folder / plan.report)
        click.echo(f"{_counted(found)}; {told} {(output or plan.output or folder) / plan.report}")
    _raise_failures(found, folder)


def _campaign_file(asked: Path) -> Path:
    """The file, or the shipped campaign of that name."""
    from trackside.shipped import example_campaigns

    if asked.exists() or len(asked.parts) > 1 or asked.suffix:
        return asked
    known = example_campaigns()
    if str(asked) not in known:
        hint = nearest_names(str(asked), known)
        raise UsageError(f"{asked}: neither a file nor a campaign of trackside; {hint}")
    return known[str(asked)]


def _runner(workers: int | None, scheduler: str | None) -> Runner[SessionJob, Done]:
    from trackside.campaign.apart import attempt_apart
    from trackside.campaign.work import attempt
    from trackside.workers import chosen_runner

    return chosen_runner(attempt_apart if scheduler else attempt, workers, scheduler, "--workers")


def _do_shared(job: SessionJob | None, runner: Runner[SessionJob, Done]) -> None:
    """What all sessions need; raises `TracksideError` where it fails, as then nothing can be."""
    if job is None:
        return
    from trackside.workers import Failure

    outcome = _done((job,), runner)[job.name]
    whys = [outcome.why] if isinstance(outcome, Failure) else list(outcome.failed.values())
    if whys:
        raise TracksideError(f"{job.name}: {whys[0]}; its log is {job.log}")


def _done(
    jobs: Sequence[SessionJob], runner: Runner[SessionJob, Done]
) -> dict[str, Done | Failure]:
    """What became of every session; those of which everything is there are not even begun."""
    from trackside.campaign.work import done_before

    outcomes: dict[str, Done | Failure] = {}
    for job in jobs:
        before = done_before(job)
        if before is not None:
            outcomes[job.name] = before
    waiting = [job for job in jobs if job.name not in outcomes]
    if waiting:
        with Progress("sessions", len(waiting)) as progress:
            for job, outcome in runner(waiting):
                outcomes[job.name] = outcome
                progress.advance()
    return outcomes


def _report(found: Found, place: Path, file: Path) -> str:
    """Write the report unless it is there already; which of the two."""
    from scoring.report import write_campaign_report
    from trackside.campaign.results import comparisons, report_key, report_of
    from trackside.campaign.state import State

    definition = place.read_text(encoding="utf-8")
    state, key = State.of(file.parent / "state" / "report.json"), report_key(found, definition)
    if file.exists() and state.keys.get(file.name) == key:
        return "there was no change to"
    report = report_of(found, comparisons(found), place.name, definition)
    write_campaign_report(file, report)
    state.made(file.name, key)
    return "wrote"


def _counted(found: Found) -> str:
    from trackside.campaign.work import Done

    done = [outcome for outcome in found.outcomes.values() if isinstance(outcome, Done)]
    made, kept = sum(len(one.made) for one in done), sum(len(one.kept) for one in done)
    return f"{made} steps done, {kept} known before"


def _raise_failures(found: Found, folder: Path) -> None:
    if not found.failures:
        return
    names = dict.fromkeys(name for name, _ in found.failures)
    lines = [
        f"{name}: {why.splitlines()[0]}; its log is {folder / 'logs' / f'{name}.log'}"
        for name, why in found.failures[:SHOWN]
    ]
    more = len(found.failures) - SHOWN
    raise TracksideError(
        "\n".join(
            [
                f"{len(names)} of {len(found.jobs)} sessions are not whole; the same command goes "
                "on from here:",
                *lines,
                *([f"and {more} more"] if more > 0 else []),
            ]
        )
    )
