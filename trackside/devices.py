"""`trackside devices`: what is plugged in, who answered on which port, and a rig of it."""

from __future__ import annotations

from pathlib import Path

import click

from dialogue import Cell, Table, UsageError
from dialogue.options import format_option


@click.command("devices")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Write a rig file for what answered; an existing one is not replaced.",
)
@click.option(
    "--port", "extra", multiple=True, metavar="PATH", help="Ask this port as well; repeatable."
)
@click.option("--udev-rules", is_flag=True, help="Print the udev rules of a car, and end.")
@format_option()
@click.pass_context
def devices(
    ctx: click.Context,
    output: Path | None,
    extra: tuple[str, ...],
    udev_rules: bool,
    table_format: str,
) -> None:
    """What is plugged in, by the names that ports keep; each is asked who is there.

    Only questions are sent: no motor starts, nothing is set. Exit code 1 if nothing answered.
    """
    from drivers.camera import list_cameras
    from drivers.discovery import PortFound, ask_all, list_ports, stable_path
    from drivers.udev import RULES

    if udev_rules:
        click.echo(RULES, nl=False)
        return
    if output is not None and output.exists():
        raise UsageError(f"{output} exists already; give another name, or move it away first")
    wished = [PortFound(stable_path(path), path) for path in extra]
    ports, cameras = ask_all([*list_ports(), *wished]), list_cameras()
    buses = [str(path) for path in sorted(Path("/dev").glob("i2c-*"))]
    rows: list[tuple[Cell, ...]] = [
        (p.path, p.maker or p.usb_id, p.kind or "-", _told(dict(p.identity), p.problem))
        for p in ports
    ]
    for camera in cameras:
        sizes = sorted({f"{m.width_px}x{m.height_px}" for m in camera.modes})
        told = camera.problem or ", ".join(sizes)
        rows.append((camera.path, camera.card or "", "camera", told))
    rows += [(bus, "I2C bus", "-", "an IMU on it: add mpu9250 to the rig") for bus in buses]
    columns = ("port", "maker", "who answered", "what it said")
    note = "" if rows else "nothing is plugged in that could be one of ours; check cables and power"
    click.echo(Table(columns, tuple(rows), note=note).render(table_format))
    if output is not None:
        from capture import write_text
        from capture.recording.rig_file import rig_text

        write_text(output, rig_text(ports, cameras))
        click.echo(f"wrote {output}: read it once, then trackside doctor --rig {output}")
    answered = any(p.kind for p in ports) or any(c.problem is None for c in cameras)
    ctx.exit(0 if answered else 1)


def _told(identity: dict[str, object], problem: str | None) -> str:
    if problem is not None:
        return problem
    return ", ".join(f"{key} {value}" for key, value in identity.items())
