"""`trackside demo`: the whole road without hardware, each step a command that is shown."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path

import click

MAP, POWER, SEED = "turn", "high", "7"
ALGORITHMS = ("ekf", "fastslam")
BEFORE = """\
A car slides through a turn between 14 cones. Its lidar, motor controller, IMU and stereo camera
are emulated to the byte and recorded by the real drivers; a camera above films it. Each step below
is a command of its own. The first run compiles kernels, which takes some seconds more."""
AFTER = """\
Total is the sum of six errors of path and map: 0 is perfect, a cone missed or invented costs 0.3.
The truth is the film's alone; the simulator's own is in truth/."""


@click.command("demo")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Folder to make.  [default: a new trackside-demo here]",
)
@click.pass_context
def demo(ctx: click.Context, output: Path | None) -> None:
    """A virtual car drives through a turn; everything else is as on a real track.

    Recorded through the drivers, filmed from above, put on one clock, tracked, estimated by
    EKF-SLAM and FastSLAM, scored. Takes about a minute.
    """
    target = output or _free_name(Path("trackside-demo"))
    run = target / "run"
    click.echo(BEFORE)
    steps = [
        ("simulate", "--map", MAP, "--power", POWER, "--seed", SEED, "-o", str(target)),
        (
            *("join", str(target / "car"), str(target / "film"), "-o", str(run)),
            *("--scene", str(target / "scene.yaml"), "--no-clip"),
        ),
        ("vo", str(run)),
        *(("slam", str(run), "--algorithm", name) for name in ALGORITHMS),
        ("score", str(run)),
    ]
    simulated, *rest = steps
    _run(ctx, simulated)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as beside:
        # On the first run compiling takes longer than all the rest, and a second core is free.
        compiled = beside.submit(compile_kernels, target / "car")
        for words in rest:
            if words[0] == "slam":
                wait((compiled,))
            _run(ctx, words)
    click.echo(f"\n{AFTER}\nLook at {run / 'report.html'}, then at docs/quickstart.md.")


def compile_kernels(session: Path) -> None:
    """Run both algorithms for the sake of their kernels, which stay compiled; nothing is kept."""
    from capture import Session
    from slam.algorithms import Request, estimate_session
    from slam.session_defaults import for_session

    recorded = Session.open(session)
    for name in ALGORITHMS:
        estimate_session(recorded, for_session(Request(algorithm=name), recorded), quiet=True)


def _run(ctx: click.Context, words: Sequence[str]) -> None:
    """Show a command and run it, as a person would."""
    from trackside.cli import trackside

    click.echo(f"\n$ trackside {' '.join(words)}")
    code = trackside.main(args=list(words), standalone_mode=False)
    if isinstance(code, int) and code:
        ctx.exit(code)


def _free_name(wanted: Path) -> Path:
    """`wanted`, or the first of wanted-2, wanted-3, ... that does not exist yet."""
    candidate, number = wanted, 1
    while candidate.exists():
        number += 1
        candidate = wanted.with_name(f"{wanted.name}-{number}")
    return candidate
