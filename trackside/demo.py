"""`trackside demo`: the whole road on a small recording, without hardware."""

from __future__ import annotations

import shutil
from pathlib import Path

import click

from trackside.shipped import example

PRESETS = ("thesis", "robust")


@click.command("demo")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Folder for the session.  [default: a new trackside-demo here]",
)
def demo(output: Path | None) -> None:
    """Run EKF-SLAM on a small recording of a loop, score path and map, write the report."""
    from capture import new_folder

    target = output or _free_name(Path("trackside-demo"))
    with new_folder(target) as folder:
        shutil.copytree(example("loop"), folder, dirs_exist_ok=True)
    click.echo(f"A car drove two and a half rounds between 14 cones; the recording is {target}.")
    click.echo("The first run compiles its kernels, which takes some seconds.")
    for preset in PRESETS:
        _run("slam", str(target), "--association", "nearest", "--preset", preset, "--name", preset)
    _run("score", str(target))
    click.echo(f"\nLook at {target / 'report.html'}, then try: trackside info {target}")


def _run(*words: str) -> None:
    """Show a command and run it, as a person would."""
    from trackside.cli import trackside

    click.echo(f"\n$ trackside {' '.join(words)}")
    trackside.main(args=list(words), standalone_mode=False)


def _free_name(wanted: Path) -> Path:
    """`wanted`, or the first of wanted-2, wanted-3, ... that does not exist yet."""
    candidate, number = wanted, 1
    while candidate.exists():
        number += 1
        candidate = wanted.with_name(f"{wanted.name}-{number}")
    return candidate
