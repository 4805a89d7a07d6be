"""`trackside`: one command, loaded piece by piece, and the only place where errors are caught."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
from pathlib import Path

import click

from dialogue import TracksideError, UsageError
from dialogue.lazy_group import LazyGroup

COMMANDS = {
    "demo": ("trackside.demo:demo", "The whole road without hardware, in a minute."),
    "simulate": ("trackside.virtual.cli:simulate", "A run on the virtual track, from one seed."),
    "doctor": ("trackside.doctor:doctor", "What would spoil a recording here, and what to do."),
    "devices": ("trackside.devices:devices", "What is plugged in, who answered; writes a rig."),
    "calibrate": ("calibration.cli:calibrate", "Camera, floor, rings, odometry, IMU, lidar."),
    "markers": ("calibration.cli:markers", "Rings and boards to print, true to size."),
    "record": ("capture.recording.cli:record", "Record the car into a new session."),
    "film": ("capture.recording.cli:film", "Record the overhead camera into a new session."),
    "clock": ("capture.network_clock.cli:clock", "The clocks of two machines, over the network."),
    "join": ("calibration.clocks.cli:join", "One session on one clock, of the car and its film."),
    "check": ("capture.recording.cli:check", "Is a recording any good?"),
    "recover": ("capture.recording.cli:recover", "Finish what a power cut broke off."),
    "import": ("capture.cli:import_group", "Make a session of a data set, a bag or TUM files."),
    "info": ("capture.cli:info", "What a session holds."),
    "track": ("tracking.cli:track", "Frames of the overhead camera to ground truth."),
    "vo": ("visual_odometry.cli:vo", "Stereo pictures of the car to odometry."),
    "slam": ("slam.cli:slam", "Estimate path and landmark map of a session."),
    "slam tune": ("trackside.tuning.cli:tune", "Search the parameters of SLAM that score best."),
    "score": ("scoring.cli:score", "Score path and map against the truth."),
    "compare": ("scoring.comparison.cli:compare", "Many scores: tables, intervals, tests."),
    "campaign": ("trackside.campaign.cli:campaign", "A whole experiment, to one report."),
    "replay": ("capture.recording.cli:replay", "Play a session through emulated devices."),
    "emulate": ("drivers.cli:emulate", "A device that other programs can open."),
    "export": ("capture.cli:export_group", "Session to TUM, CSV, ROS 1 or ROS 2 bags."),
}
"""Command -> where it is defined, and its line of help (`dialogue.lazy_group`)."""


@click.group(
    cls=LazyGroup,
    table=COMMANDS,
    noun="command",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="trackside", prog_name="trackside")
def trackside() -> None:
    """Landmark SLAM of a small race car: record or import, estimate, score path and map."""


def main(arguments: list[str] | None = None) -> None:
    """Run one command and end the process.

    Exit code 0: done; 1: a known error; 2: usage; 3: a threshold was passed; 70: a fault of ours.
    """
    try:
        # click hands a command's `ctx.exit(code)` back as the value.
        code = trackside.main(args=arguments, standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        _say("stopped; nothing half-written was left behind")
        sys.exit(130)
    except BrokenPipeError:
        # The reader of our output has gone (`| head`): that is its right.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except UsageError as error:
        _say(str(error))
        sys.exit(2)
    except TracksideError as error:
        _say(str(error))
        sys.exit(1)
    except Exception as error:
        _say(f"a fault of trackside: {type(error).__name__}: {error}\nthe trace is in {_log()}")
        sys.exit(70)


def _say(text: str) -> None:
    click.echo(f"trackside: {text}", err=True)


def _log() -> Path:
    """Keep the trace of the error at hand in a new file; where that file is."""
    from importlib.metadata import version

    handle, name = tempfile.mkstemp(prefix="trackside-", suffix=".log")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(f"trackside {version('trackside')}, Python {sys.version}\n")
        file.write(f"arguments: {sys.argv[1:]}\n\n{traceback.format_exc()}")
    return Path(name)
