"""The command `trackside emulate`: a device that other programs can open."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dialogue import UsageError, asked_to_end

if TYPE_CHECKING:
    from drivers.emulation import DeviceModel
    from drivers.port import Chunk

_LINK = click.option(
    "--link",
    type=click.Path(path_type=Path),
    help="Also give the port this name, as a link that goes away with it.",
)
_SECONDS = click.option("--seconds", type=click.FloatRange(min=0.0), help="End after these.")
LINE_S = 0.01
FRAME_S = 0.02


@click.group("emulate")
def emulate() -> None:
    """A device on a pseudo-terminal at real pace, for this program or any other, until Ctrl-C."""


@emulate.command("rplidar")
@click.option(
    "--replay", type=click.Path(path_type=Path), help="A capture: raw bytes, or 0x.. a line."
)
@click.option("--mode", help="The only scan mode it offers, e.g. Boost.")
@_LINK
@_SECONDS
def emulate_rplidar(
    replay: Path | None, mode: str | None, link: Path | None, seconds: float | None
) -> None:
    """An RPLidar A2M8 in a room, or one that sends a capture again and again."""
    from drivers.rplidar import emulated_lidar

    _run(emulated_lidar(replay_file=replay, mode=mode), link, seconds)


@emulate.command("vesc")
@click.option(
    "--replay", type=click.Path(path_type=Path), help="Its replies: raw bytes, 50 a second."
)
@click.option("--firmware", default="5.02", show_default=True, help="From 2.18 on.")
@_LINK
@_SECONDS
def emulate_vesc(
    replay: Path | None, firmware: str, link: Path | None, seconds: float | None
) -> None:
    """A VESC with a motor that obeys, or one that answers with recorded replies."""
    from drivers.vesc import emulated_vesc
    from drivers.vesc.framing import FrameReceiver, encode_frame

    chunks = None
    if replay is not None:
        frames = FrameReceiver().feed(_content(replay))
        chunks = _paced([encode_frame(frame.payload) for frame in frames], FRAME_S, replay)
    try:
        model = emulated_vesc(firmware, chunks)
    except ValueError as err:
        raise UsageError(f"--firmware: {err}") from err
    _run(model, link, seconds)


@emulate.command("razor")
@click.option("--replay", type=click.Path(path_type=Path), help="Its lines, 100 a second.")
@_LINK
@_SECONDS
def emulate_razor(replay: Path | None, link: Path | None, seconds: float | None) -> None:
    """A Razor IMU M0 that lies still, or one that sends recorded lines again and again."""
    from drivers.imu.razor import razor_model

    chunks = None
    if replay is not None:
        chunks = _paced(_content(replay).splitlines(keepends=True), LINE_S, replay)
    _run(razor_model(chunks), link, seconds)


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as err:
        raise UsageError(f"{file}: cannot be read: {err.strerror or err}") from err


def _paced(pieces: list[bytes], period_s: float, file: Path) -> list[Chunk]:
    """Pieces at an even pace."""
    from drivers.port import Chunk

    if not pieces:
        raise UsageError(f"{file}: holds nothing that this device could have sent")
    return [Chunk(round(k * period_s * 1e9), piece) for k, piece in enumerate(pieces)]


def _run(model: DeviceModel, link: Path | None, seconds: float | None) -> None:
    from drivers.emulation import PtyEmulator

    with (
        asked_to_end() as ended,
        PtyEmulator(model) as emulator,
        _linked(emulator.path, link) as path,
    ):
        click.echo(path)
        ended.wait(seconds)
    click.echo(f"sent {emulator.sent_bytes} bytes, {emulator.dropped_bytes} found no reader")


@contextlib.contextmanager
def _linked(path: str, link: Path | None) -> Iterator[str]:
    """The port under its own name, or under a link as long as the block lasts."""
    if link is None:
        yield path
        return
    try:
        link.symlink_to(path)
    except OSError as err:
        raise UsageError(f"--link {link}: {err.strerror or err}; give another name") from err
    try:
        yield str(link)
    finally:
        link.unlink(missing_ok=True)
