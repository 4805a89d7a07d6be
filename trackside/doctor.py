"""`trackside doctor`: every fault of installation, machine and rig in one list, with remedies."""

from __future__ import annotations

import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import packages_distributions, version
from pathlib import Path

import click

from dialogue import Table
from dialogue.options import format_option
from trackside.finding import Finding

OUR_NAMES = (
    "dialogue", "drivers", "geometry", "capture", "slam", "tracking", "simulation", "calibration",
    "scoring", "trackside",
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
    "serial": "pyserial",
    "cv2": "opencv-contrib-python-headless",
}
"""Import name -> the distribution it comes from."""

MIN_FREE_BYTES = 500_000_000


RIG_NAME = "rig.yaml"


@click.command("doctor")
@click.option(
    "--rig",
    "rig_file",
    type=click.Path(path_type=Path),
    help="Also look at its devices and at this machine.  [default: rig.yaml, if there is one here]",
)
@format_option()
@click.pass_context
def doctor(ctx: click.Context, rig_file: Path | None, table_format: str) -> None:
    """What would spoil a recording here, and what to do; exit code 1 if anything would.

    Without a rig only the installation is looked at.
    """
    here = Path(RIG_NAME)
    findings = examine(Path.cwd(), rig_file or (here if here.exists() else None))
    rows = tuple(
        (f.what, "ok", f.seen, "") if f.well else (f.what, "FAULT", f.seen, f.remedy)
        for f in findings
    )
    faults = sum(not f.well for f in findings)
    note = "all is well" if not faults else f"{faults} to mend"
    click.echo(Table(("what", "state", "seen", "do"), rows, note=note).render(table_format))
    ctx.exit(1 if faults else 0)


def examine(folder: Path, rig_file: Path | None = None) -> list[Finding]:
    """All findings for this environment, with recordings going to `folder`.

    With a rig also its devices and the machine are looked at. Nothing is changed.
    """
    checks: tuple[Callable[[], Finding], ...] = (
        _python,
        _environment,
        _name_clashes,
        *(lambda name=name: _library(name) for name in LIBRARIES),
        _kernels,
        _log_format,
        lambda: _disk(folder),
    )
    findings = [check() for check in checks]
    if rig_file is None:
        return [*findings, Finding("rig", True, "none given: only the installation was looked at")]
    return [*findings, *_recording_findings(folder, rig_file)]


def _recording_findings(folder: Path, rig_file: Path) -> list[Finding]:
    from trackside import machine
    from trackside.rig_checks import rig_findings

    found, rig = rig_findings(rig_file)
    this = machine.Machine()
    cameras = rig is not None and (rig.zed is not None or rig.overhead is not None)
    looks = (
        machine.modem_manager,
        machine.brltty,
        machine.udev_rules,
        machine.kernel_modules,
        machine.usb_power,
        machine.power,
        machine.clock,
    )
    return [*found, *(look(this) for look in looks), machine.disk_speed(this, folder, cameras)]


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
