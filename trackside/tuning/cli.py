"""The command `trackside slam tune`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import Progress, TracksideError
from dialogue.options import format_option
from scoring.flags import GroupedCommand, options_from_flags, score_flags
from scoring.options import PRESETS as SCORE_PRESETS

if TYPE_CHECKING:
    from dialogue import Table
    from scoring import ScoreOptions
    from trackside.tuning.jobs import Outcome
    from trackside.tuning.plan import Plan
    from trackside.tuning.ranking import Run, Standing
    from trackside.workers import Failure

_PATH = click.Path(path_type=Path)
BEST, TABLE = "best.yaml", "table.csv"
SHOWN = 20
"""Failures listed; all of them would hide the first."""


@click.command(cls=GroupedCommand, short_help="Search the parameters of SLAM that score best.")
@click.argument("sessions", type=_PATH, nargs=-1, required=True)
@click.option(
    "--parameters",
    "words",
    multiple=True,
    required=True,
    metavar="FILE.yaml|KEY=LIST",
    help="What to search, as accept_gate=6,9,12 or 'accept_gate={min: 4, max: 16}'; names as --set "
    "of trackside slam takes them; may be repeated.",
)
@click.option("--algorithms", default="ekf", show_default=True, metavar="NAME,...")
@click.option(
    "--runs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Draw N sets at random.  [default: every combination]",
)
@click.option(
    "--seeds",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Runs of each set and session with seeds 0 to N - 1, where the algorithm draws numbers.",
)
@click.option("--search-seed", default=0, show_default=True, help="Of the sets drawn.")
@click.option("--preset", default="robust", show_default=True, metavar="NAME")
@click.option("--association", metavar="RULE", help="As for trackside slam.")
@click.option("--odometry", metavar="SOURCE", help="As for trackside slam.")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="The same in all sets.")
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Processes, each with one thread; 1 runs all in this one.  [default: one per core]",
)
@click.option(
    "--scheduler", metavar="tcp://HOST:PORT", help="Run on the workers of this dask scheduler."
)
@click.option(
    "-o",
    "--output",
    type=_PATH,
    default=Path("tuning"),
    show_default=True,
    help="Folder for results; a search that was interrupted goes on from there.",
)
@format_option()
@click.option(
    "--score-preset",
    type=click.Choice(tuple(SCORE_PRESETS)),
    default="thesis",
    show_default=True,
    help="Choices of the score to begin with.",
)
@score_flags
def tune(
    sessions: tuple[Path, ...],
    words: tuple[str, ...],
    algorithms: str,
    runs: int | None,
    seeds: int,
    search_seed: int,
    jobs: int | None,
    scheduler: str | None,
    output: Path,
    table_format: str,
    score_preset: str,
    **choices: object,
) -> None:
    """Run SLAM on SESSIONS with many parameter sets, score each run, rank the sets by mean Total.

    SESSIONS are such, or folders of such, with ground truth. The output folder gets table.csv and
    best.yaml, which trackside slam --preset takes.

    \b
    trackside slam tune runs/ --parameters accept_gate=6,9,12 --algorithms ekf,fastslam --seeds 5
    trackside slam tune runs/ --parameters space.yaml --runs 200
    """  # noqa: D301  click wants the control character itself
    from trackside.tuning.jobs import ResultStore, attempt
    from trackside.tuning.plan import planned
    from trackside.tuning.ranking import standings, table
    from trackside.tuning.search import listed_runs, requests_of, searched, sessions_with_truth
    from trackside.tuning.space import parsed_space
    from trackside.workers import chosen_runner

    base = {name: choices.pop(name) for name in ("preset", "association", "odometry", "settings")}
    options = options_from_flags(score_preset, choices)
    plan = planned(parsed_space(words), requests_of(algorithms, base), runs, search_seed)
    opened = sessions_with_truth(sessions)
    todo = listed_runs(opened, plan, seeds, options)
    with Progress("tuning", len({run.job.key for run in todo})) as progress:
        runner = chosen_runner(attempt, jobs, scheduler, "--jobs")
        found = searched(todo, ResultStore(output), runner, progress.advance)
    ranked = standings(todo, found.results)
    ranking = table(ranked, len(opened), plan.impossible)
    failures = _failures(todo, found.results)
    if ranked[0].total is not None:
        _keep(output, ranking, ranked, _evidence(todo, plan, options, search_seed))
        click.echo(ranking.render(table_format))
        told = f"{len(found.results)} runs, {found.known_before} of them known before"
        click.echo(f"{told}; wrote {output / BEST} and {output / TABLE}", err=True)
        click.echo(f"next: trackside slam SESSION --preset {output / BEST}", err=True)
    if failures:
        raise TracksideError("\n".join(failures))


def _keep(
    output: Path, ranking: Table, ranked: Sequence[Standing], evidence: Mapping[str, object]
) -> None:
    from capture import write_text, write_yaml
    from trackside.tuning.ranking import best_preset

    write_text(output / TABLE, ranking.render("csv") + "\n")
    write_yaml(output / BEST, asdict(best_preset(ranked, evidence)))


def _evidence(
    todo: Sequence[Run], plan: Plan, options: ScoreOptions, search_seed: int
) -> dict[str, object]:
    """What else a reader of best.yaml must know to trust it, or not."""
    digests = {Path(run.session).name: run.job.digest for run in todo}
    return {
        "sessions": digests,
        "algorithms": sorted({run.trial.request.algorithm for run in todo}),
        "seeds": sorted({run.job.request.seed for run in todo}),
        "search_seed": search_seed,
        "sets_impossible": plan.impossible,
        "software": todo[0].job.software,
        "scoring": options.choices(),
        "caution": "chosen on these sessions, so its Total here flatters it; judge it on others",
    }


def _failures(todo: Sequence[Run], results: Mapping[str, Outcome | Failure]) -> list[str]:
    """A line for each run that gave no score, after one that counts them; at most twenty."""
    from trackside.workers import Failure

    lines = {}
    for run in todo:
        result = results[run.job.key]
        if isinstance(result, Failure):
            request = run.job.request
            lines[run.job.key] = (
                f"{Path(run.session).name} {request.algorithm} set {run.trial.number} "
                f"seed {request.seed}: {result.why}"
            )
    if not lines:
        return []
    shown = list(lines.values())[:SHOWN]
    more = [f"and {len(lines) - SHOWN} more"] if len(lines) > SHOWN else []
    return [f"{len(lines)} of {len(results)} runs gave no score:", *shown, *more]
