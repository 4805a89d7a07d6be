"""The commands `record`, `film`, `check`, `recover`, `replay`."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dialogue import Cell, Table, asked_to_end
from dialogue.options import format_option

if TYPE_CHECKING:
    from capture.recording.facts import RecordingFacts
    from capture.recording.recorder import Recorder
    from capture.recording.verdict import Verdict

POLL_S = 0.2

_SESSION = click.argument("session", type=click.Path(path_type=Path))
_OPTIONS = (
    click.option(
        "--rig",
        "rig_file",
        type=click.Path(path_type=Path),
        default=Path("rig.yaml"),
        show_default=True,
        help="What is plugged in; trackside devices writes it.",
    ),
    click.option("--map", "map_name", required=True, help="What is driven, e.g. turn."),
    click.option("--power", default="", help="How fast it is driven, e.g. low."),
    click.option("--trial", type=click.IntRange(min=1), help="[default: counted on]"),
    click.option("--seconds", type=click.FloatRange(min=0.1), help="End by itself after these."),
    click.option("--notes", default="", help="Anything worth knowing later."),
    click.option(
        "-o", "--output", type=click.Path(path_type=Path), help="[default: the folder of the rig]"
    ),
    click.option("--without", multiple=True, metavar="DEVICE", help="Leave one out; repeatable."),
)


def _with_options(function: Callable[..., None]) -> Callable[..., None]:
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


@click.command("record")
@_with_options
def record(**words: Any) -> None:
    """Record every device of the car into a new session, until Ctrl-C."""
    from capture.recording.rig_streams import ON_CAR

    _record(ON_CAR, "", **words)


@click.command("film")
@_with_options
def film(**words: Any) -> None:
    """Record the overhead camera into a new session, until Ctrl-C."""
    from capture.recording.rig_streams import AT_TRACK

    _record(AT_TRACK, "film", **words)


def _record(
    among: tuple[str, ...],
    suffix: str,
    *,
    rig_file: Path,
    map_name: str,
    power: str,
    trial: int | None,
    seconds: float | None,
    notes: str,
    output: Path | None,
    without: tuple[str, ...],
) -> None:
    from capture.calibrations import accepted_files
    from capture.recording.begin import Take, devices_of, recorder_for
    from capture.recording.rig import read_rig
    from capture.session import Session

    rig = read_rig(rig_file)
    # A file that cannot be read is told before anything begins.
    calibrations = accepted_files(Path(rig.recording.calibration_folder))
    names = devices_of(rig, among, without)
    click.echo(f"connecting {', '.join(names)}", err=True)
    take = Take(map_name, power, trial, notes)
    recorder = recorder_for(rig, names, take, base=output, suffix=suffix, seconds=seconds)
    still_s = rig.recording.still_s if not suffix else 0.0
    try:
        with asked_to_end() as ended, recorder:
            _say_identities(recorder)
            for file in Session.open(recorder.folder).adopt_calibrations(calibrations):
                click.echo(f"calibration in force: {file}", err=True)
            _watch(recorder, ended, still_s)
    except BaseException:
        _remove_if_empty(recorder.folder)
        raise
    _summarise(recorder)


_TOLD = ("model", "firmware", "serial", "scan_mode", "card")
"""What is worth saying of a device; `session.yaml` has all of it."""


def _say_identities(recorder: Recorder) -> None:
    for name, identity in recorder.info.devices.items():
        assert isinstance(identity, dict)
        told = [f"{key} {identity[key]}" for key in _TOLD if identity.get(key)]
        click.echo(f"{name}: {', '.join(told)}", err=True)


def _watch(recorder: Recorder, ended: threading.Event, still_s: float) -> None:
    from capture.recording.live_view import LiveView

    click.echo(f"recording into {recorder.folder}; waiting for every device", err=True)
    calls = [(0.0, f"keep the car still for {still_s:g} s")] if still_s else []
    calls.append((still_s, "drive; Ctrl-C ends the recording"))
    with LiveView() as view:
        while not ended.wait(POLL_S) and not recorder.is_over():
            statuses = recorder.poll()
            while calls and recorder.is_ready and recorder.elapsed_s >= calls[0][0]:
                view.say(calls.pop(0)[1])
            view.show(statuses, recorder.headline())


def _summarise(recorder: Recorder) -> None:
    verdict = recorder.verdict()
    click.echo(_facts_table(recorder.facts(), recorder.folder.name).render("table"))
    _say_verdict(verdict)
    for fault in recorder.witness.faults if recorder.witness is not None else ():
        click.echo(f"  clock: {fault}")
    click.echo(f"wrote {recorder.folder}")
    if "overhead" in recorder.info.devices:
        click.echo(f"next: trackside join CAR {recorder.folder}")
    else:
        click.echo(f"next: trackside join {recorder.folder} FILM; without a film trackside slam")


@click.command("check")
@_SESSION
@format_option()
@click.pass_context
def check(ctx: click.Context, session: Path, table_format: str) -> None:
    """Is a recording any good? The same verdict as when it ended; exit code 1 if it is bad."""
    from capture.recording.check import checked
    from capture.session import Session

    opened = Session.open(session)
    facts, verdict = checked(opened)
    click.echo(_facts_table(facts, opened.name).render(table_format))
    _say_verdict(verdict)
    if facts.recovered:
        click.echo(f"next: trackside recover {session}")
    ctx.exit(0 if verdict.verdict == "good" else 1)


@click.command("recover")
@_SESSION
def recover(session: Path) -> None:
    """Finish what a power cut, a kill or a full disk broke off; nothing is thrown away."""
    from capture.recording.recover import recover as finish

    done, verdict = finish(session)
    for log in done:
        damaged = f", {log.damaged_chunks} damaged chunks left out" if log.damaged_chunks else ""
        click.echo(f"{log.name}: {log.messages} messages{damaged}; the original is {log.kept_as}")
    if not done:
        click.echo("every log that can be read has its end already")
    _say_verdict(verdict)


@click.command("replay")
@_SESSION
@click.option("--speed", type=click.FloatRange(min=0.01, max=100.0), default=1.0, show_default=True)
@click.option("-o", "--rig", "rig_file", type=click.Path(path_type=Path), help="Write a rig of it.")
def replay(session: Path, speed: float, rig_file: Path | None) -> None:
    """Play a session through emulated devices, which any program can open, until Ctrl-C."""
    from capture.recording.replay import replayed
    from capture.session import Session
    from capture.transaction import write_text

    with asked_to_end() as ended, replayed(Session.open(session), speed) as devices:
        for device in devices:
            click.echo(f"{device.device}: {device.path} ({device.seconds:.1f} s)")
        if rig_file is not None:
            blocks = [f"{device.device}:\n  port: {device.path}\n" for device in devices]
            write_text(rig_file, "format: 1\n" + "".join(blocks))
            click.echo(f"wrote {rig_file}; in another window: trackside record --rig {rig_file}")
        ended.wait()


def _facts_table(facts: RecordingFacts, title: str) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            stream.device,
            stream.messages,
            stream.asked_hz,
            stream.rate_hz,
            stream.longest_gap_s,
            stream.losses.bad_frames,
            stream.losses.lost_samples + stream.losses.refused,
            stream.losses.disconnects,
        )
        for stream in facts.streams
    ]
    columns = (
        "device",
        "messages",
        "asked [Hz]",
        "got [Hz]",
        "longest gap [s]",
        "bad frames",
        "lost",
        "gone",
    )
    return Table(columns, tuple(rows), f"{title}, {facts.duration_s:.1f} s", digits=2)


def _say_verdict(verdict: Verdict) -> None:
    click.echo(f"verdict: {verdict.verdict}")
    for text in (*verdict.reasons, *verdict.remarks):
        click.echo(f"  {text}")


def _remove_if_empty(folder: Path) -> None:
    """A recording that never began leaves no folder behind."""
    with contextlib.suppress(OSError):
        folder.rmdir()
