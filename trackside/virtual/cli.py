"""The command `trackside simulate`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from dialogue import Progress

_PATH = click.Path(path_type=Path)


@click.command("simulate")
@click.option(
    "--map", "map_name", default="turn", show_default=True,
    help="turn, s-curve, loop; or figures, a drive for calibrating the car.",
)  # fmt: skip
@click.option("--power", default="low", show_default=True, help="low, medium or high: high drifts.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True,
              help="One seed, one world: cones, driver, noise.")  # fmt: skip
@click.option("--trial", type=click.IntRange(min=1), help="Number that the sessions carry.")
@click.option(
    "--site",
    type=_PATH,
    metavar="DIR",
    help="Calibrations made before (--site-only).  [default: the camera is calibrated anew]",
)
@click.option("--site-only", is_flag=True, help="Only calibrate the camera, into the folder -o.")
@click.option("--no-film", is_flag=True, help="No film; the car's session gets the exact truth.")
@click.option("--no-stereo", is_flag=True, help="A car without its stereo camera.")
@click.option(
    "--realtime",
    is_flag=True,
    help="The car's devices at real pace behind pseudo-terminals, recorded as on the car.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1, 2),
    help="Processes: with 2 the film is made beside the rest.  [default: as there are cores]",
)
@click.option("-o", "--output", type=_PATH, required=True, help="The folder to make.")
def simulate(
    map_name: str,
    power: str,
    seed: int,
    trial: int | None,
    site: Path | None,
    site_only: bool,
    no_film: bool,
    no_stereo: bool,
    realtime: bool,
    jobs: int | None,
    output: Path,
) -> None:
    """A run on the virtual track, recorded through the real drivers and recorder.

    Makes car/ and film/ as two machines record them, each on its own clock, scene.yaml, the
    calibrations, and truth/ with what nobody on a real track knows. One seed gives the same bytes
    of the car (not at real pace: there the machine's timing is in them).
    """
    from trackside.virtual.day import RunPlan, simulate_run, simulate_site
    from trackside.workers import cores

    if site_only:
        simulate_site(output, _shown)
        click.echo(f"wrote {output}; next: trackside simulate --site {output} -o DIR")
        return
    plan = RunPlan(
        map=map_name,
        power=power,
        seed=seed,
        trial=trial,
        site=site,
        filmed=not no_film,
        realtime=realtime,
        stereo=not no_stereo,
        jobs=jobs or min(cores(), 2),
    )
    simulate_run(output, plan, _shown)
    click.echo(f"wrote {output}")
    if no_film:
        click.echo(f"next: trackside slam {output / 'car'}")
    else:
        click.echo(
            f"next: trackside join {output / 'car'} {output / 'film'} "
            f"--scene {output / 'scene.yaml'} -o {output / 'run'}"
        )


@contextmanager
def _shown(label: str, total: int) -> Iterator[Callable[[int], None]]:
    with Progress(label, total) as progress:
        yield progress.advance
