"""The commands `trackside clock serve` and `trackside clock ask`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.network_clock import PORT
from dialogue import Table, UsageError, asked_to_end
from dialogue.options import format_option

if TYPE_CHECKING:
    from capture.session_info import PeerClock


@click.group("clock")
def clock() -> None:
    """The clocks of two machines over the network; no other software is needed."""


@clock.command("serve")
@click.option("--port", type=click.IntRange(1, 65535), default=PORT, show_default=True)
def serve_command(port: int) -> None:
    """Let others ask this machine's clock (UDP), until Ctrl-C. On the laptop with the camera."""
    from contextlib import closing

    from capture.network_clock import opened_server, serve

    known: set[str] = set()

    def heard(address: str) -> None:
        if address not in known:
            known.add(address)
            click.echo(f"asked by {address}")

    with asked_to_end() as ended, closing(opened_server(port)) as server:
        click.echo(f"serving the clock on UDP port {port}; Ctrl-C ends")
        click.echo(f"next: on the car, trackside clock ask THIS-MACHINE:{port}, or clock_server in "
                   "the recording block of its rig.yaml")  # fmt: skip
        answered = serve(server, ended.is_set, heard=heard)
    click.echo(f"{answered} questions answered")


@clock.command("ask")
@click.argument("host", metavar="HOST[:PORT]")
@click.option("--seconds", type=click.FloatRange(0.2, 600.0), default=2.0, show_default=True)
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Keep it for trackside join --clock."
)
@format_option()
def ask_command(host: str, seconds: float, output: Path | None, table_format: str) -> None:
    """How far the clock of HOST, where trackside clock serve runs, is from ours."""
    from capture.network_clock import ask
    from capture.peer_file import write_peer_clock

    if output is not None and output.exists():
        raise UsageError(f"{output} exists already and is never overwritten; give another name")
    try:
        told = ask(host, seconds)
    except ValueError as err:
        raise UsageError(str(err)) from err
    click.echo(_table(told).render(table_format))
    if output is not None:
        write_peer_clock(output, told)
        click.echo(f"wrote {output}", err=True)
        click.echo(f"next: trackside join CAR FILM --clock {output}", err=True)


def _table(told: PeerClock) -> Table:
    columns = ("peer", "answers", "shortest round trip [ms]", "monotonic: peer - ours [s]",
               "UTC: peer - ours [ms]", "uncertainty [ms]")  # fmt: skip
    row = (
        told.peer,
        told.answers,
        told.round_trip_ns * 1e-6,
        told.offset_monotonic_ns * 1e-9,
        told.offset_utc_ns * 1e-6,
        told.uncertainty_ns * 1e-6,
    )
    return Table(columns, (row,), digits=3)
