"""`trackside doctor`: every fault of this installation in one list, each with its remedy."""

from __future__ import annotations

import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import packages_distributions, version
from pathlib import Path

import click

from dialogue import TABLE_FORMATS, Table

OUR_NAMES = (
    "dialogue", "drivers", "geometry", "capture", "slam", "tracking", "simulation", "scoring",
    "trackside",
)  # fmt: skip
"""The rooms, which are import names shared with the whole environment."""

LIBRARIES = {
    "numpy": "numpy",
    "scipy": "scipy",
    "numba": "numba",
    "mcap": "mcap",
    "rosbags": "rosbags",
    "yaml": "PyYAML",
    "click": "click",
    "rich": "rich",
    "matplotlib": "matplotlib",
    "jinja2": "Jinja2",
}
"""Import name -> the distribution it comes from."""

MIN_FREE_BYTES = 500_000_000


@dataclass(frozen=True)
class Finding:
    """One thing looked at: what it is, whether it is well, what was seen, what to do if not."""

    what: str
    well: bool
    seen: str
    remedy: str = ""


@click.command("doctor")
@click.option(
    "--format", "table_format", type=click.Choice(TABLE_FORMATS), default="table", show_default=True
)
@click.pass_context
def doctor(ctx: click.Context, table_format: str) -> None:
    """What is wrong with this installation, and what to do; exit code 1 if anything is."""
    findings = examine(Path.cwd())
    rows = tuple((f.what, "ok" if f.well else "FAULT", f.seen, f.remedy) for f in findings)
    faults = sum(not f.well for f in findings)
    note = "all is well" if not faults else f"{faults} to mend"
    click.echo(Table(("what", "state", "seen", "do"), rows, note=note).render(table_format))
    ctx.exit(1 if faults else 0)


def examine(folder: Path) -> list[Finding]:
    """All findings for this environment, with recordings going to `folder`; nothing is changed."""
    checks: tuple[Callable[[], Finding], ...] = (
        _python,
        _environment,
        _name_clashes,
        *(lambda name=name: _library(name) for name in LIBRARIES),
        _kernels,
        _log_format,
        lambda: _disk(folder),
    )
    return [check() for check in checks]


def _python() -> Finding:
    seen = f"{sys.version.split()[0]} at {sys.prefix}"
    return Finding("python", sys.version_info >= (3, 10), seen, "install Python 3.10 or newer")


def _environment() -> Finding:
    """A ROS shell puts its own packages in front of ours through PYTHONPATH."""
    extra = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    foreign = [p for p in extra if any((Path(p) / name).exists() for name in OUR_NAMES)]
    ours = Path(__file__).parent.parent.resolve()
    shadowing = [p for p in foreign if Path(p).resolve() != ours]
    return Finding(
        "search path",
        not shadowing,
        f"PYTHONPATH shadows us: {', '.join(shadowing)}" if shadowing else f"code in {ours}",
        "run in a shell without it: unset PYTHONPATH" if shadowing else "",
    )


def _name_clashes() -> Finding:
    """Our rooms are top-level import names; another distribution may own one of them."""
    owners = packages_distributions()
    clashes = {n: sorted(set(owners.get(n, [])) - {"trackside"}) for n in OUR_NAMES}
    taken = [f"{name} by {', '.join(who)}" for name, who in clashes.items() if who]
    return Finding(
        "import names",
        not taken,
        f"taken: {'; '.join(taken)}" if taken else "ours alone",
        "install trackside in an environment of its own" if taken else "",
    )


def _library(name: str) -> Finding:
    try:
        importlib.import_module(name)
        return Finding(name, True, version(LIBRARIES[name]))
    except Exception as error:
        seen = f"{type(error).__name__}: {error}".splitlines()[0]
        return Finding(name, False, seen, "uv sync, or pip install --force-reinstall trackside")


def _kernels() -> Finding:
    """Compile, run and compare: one landmark, one observation, known answer."""
    try:
        import numpy as np

        from slam.config import PRESETS
        from slam.ekf import EkfSlam
        from slam.kernels import cache_folder

        slam = EkfSlam(PRESETS["thesis"], "known")
        slam.predict(np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
        slam.update(0, np.array([1]), np.array([2.0]), np.array([0.0]))
        distance = float(slam.estimated_map().landmarks.positions[0, 0])
    except Exception as error:
        seen = f"{type(error).__name__}: {error}".splitlines()[0]
        remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
        return Finding("slam kernels", False, seen, remedy)
    well = abs(distance - 3.0) < 1e-9
    return Finding("slam kernels", well, f"compiled into {cache_folder()}", "reinstall numba")


def _log_format() -> Finding:
    """Write a message as the recorder does and read it back as slam does."""
    import numpy as np

    from capture import Observations, Session, SessionInfo

    sent = Observations(np.array([5]), np.array([7]), np.array([1.25]), np.array([-0.5]))
    try:
        with tempfile.TemporaryDirectory() as folder:
            probe = Path(folder) / "probe"
            with Session.create(probe, SessionInfo()) as writer:
                writer.add_observations(sent)
            back = Session.open(probe).observations()
    except Exception as error:
        seen = f"{type(error).__name__}: {error}".splitlines()[0]
        return Finding("log format", False, seen, "reinstall mcap and rosbags")
    well = float(back.range_m[0]) == 1.25 and int(back.t_ns[0]) == 5
    return Finding("log format", well, "written and read back", "reinstall mcap and rosbags")


def _disk(folder: Path) -> Finding:
    free = shutil.disk_usage(folder).free
    remedy = f"free {MIN_FREE_BYTES // 10**6} MB, or record elsewhere"
    return Finding("disk", free >= MIN_FREE_BYTES, f"{free / 1e9:.1f} GB free at {folder}", remedy)
