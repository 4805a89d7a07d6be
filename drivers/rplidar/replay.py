"""Recorded bytes as an emulated lidar sends them again, and the lidar that a command emulates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from dialogue import UsageError
from dialogue.errors import nearest_names
from drivers.port import Chunk
from drivers.rplidar.emulator import (
    BOOST,
    DENSE,
    EXPRESS,
    FIVE_MODES,
    STANDARD,
    LidarSpec,
    RPLidarModel,
    a2m8,
)
from drivers.rplidar.protocol import (
    ANSWER_BYTES,
    DESCRIPTOR_BYTES,
    SCAN_ANSWERS,
    Answer,
    ScanMode,
    find_descriptor,
)
from drivers.rplidar.scene import Source, Stream

USB_FRAME_NS = 1_000_000
MODES = {mode.name: mode for mode in (*FIVE_MODES, DENSE)}
_MODE_OF_ANSWER = {
    Answer.STANDARD: STANDARD,
    Answer.LEGACY: EXPRESS,
    Answer.ULTRA: BOOST,
    Answer.DENSE: DENSE,
}


class Recorded:
    """Chunks at their own distances in time, from `begin_ns` on, again and again if `loop`.

    length_ns : from the first chunk to the first of the next round.
    """

    def __init__(
        self, chunks: Sequence[Chunk], begin_ns: int, *, length_ns: int = 0, loop: bool = False
    ) -> None:
        self._chunks, self._loop, self._next = chunks, loop and length_ns > 0, 0
        self._begin_ns, self._length_ns = begin_ns, length_ns

    def ready_ns(self) -> int | None:
        """When the next chunk is due; None after the last."""
        turn, place = divmod(self._next, max(len(self._chunks), 1))
        if not self._chunks or (turn and not self._loop):
            return None
        offset_ns = self._chunks[place].t_ns - self._chunks[0].t_ns
        return self._begin_ns + turn * self._length_ns + offset_ns

    def take(self, *, restart: bool) -> bytes:  # noqa: ARG002  what is recorded is not changed
        """That chunk."""
        chunk = self._chunks[self._next % len(self._chunks)]
        self._next += 1
        return chunk.data


def replay(chunks: Sequence[Chunk], *, loop: bool = False) -> Callable[[int], Stream]:
    """What `RPLidarModel` wants in order to send these chunks, in the pace of their stamps."""
    span_ns = chunks[-1].t_ns - chunks[0].t_ns if chunks else 0
    length_ns = span_ns + span_ns // max(len(chunks) - 1, 1)
    return lambda begin_ns: Recorded(chunks, begin_ns, length_ns=length_ns, loop=loop)


def paced(data: bytes, packet_bytes: int, baud: int) -> list[Chunk]:
    """Bytes without times as chunks of one packet, as fast as the line takes them."""
    byte_ns = 10_000_000_000 / baud
    return [
        Chunk(round(at * byte_ns), data[at : at + packet_bytes])
        for at in range(0, len(data), packet_bytes)
    ]


def read_capture(path: Path) -> tuple[Answer | None, bytes]:
    """The scan bytes of a capture file, and their type if the scan's descriptor is in the file.

    The file holds the bytes themselves, or as text one `0x..` a line. What comes before the
    descriptor (an older scan, other answers) is left out.
    """
    data = path.read_bytes()
    if data[:2].lower() == b"0x":
        data = bytes(int(word, 16) for word in data.split())
    found = find_descriptor(data, SCAN_ANSWERS)
    if found is None:
        return None, data
    return Answer(found[1].kind), data[found[0] + DESCRIPTOR_BYTES :]


def emulated_lidar(
    *,
    replay_file: Path | None = None,
    mode: str | None = None,
    loop: bool = True,
    source: Source | None = None,
) -> RPLidarModel:
    """The A2M8 that `trackside emulate rplidar` runs, behind a USB adapter.

    replay_file : a capture to send instead of what a source gives (a room, unless told otherwise);
    mode : the only scan mode that it offers; for a capture what its bytes are, unless a descriptor
    in it tells (default: standard nodes). Raises `UsageError` for a mode or file that cannot be.
    """
    if mode is not None and mode not in MODES:
        raise UsageError(f"scan mode {mode!r}: {nearest_names(mode, MODES)}")
    if replay_file is None:
        spec = a2m8() if mode is None else _offering(MODES[mode])
        return RPLidarModel(spec, source, usb_frame_ns=USB_FRAME_NS)
    try:
        answer, data = read_capture(replay_file)
    except (OSError, ValueError) as err:
        raise UsageError(f"{replay_file}: no capture of a lidar can be read there: {err}") from err
    only = MODES[mode or STANDARD.name] if answer is None else _MODE_OF_ANSWER[answer]
    if mode is not None and MODES[mode].answer == only.answer:
        only = MODES[mode]
    spec = _offering(only)
    chunks = paced(data, ANSWER_BYTES[Answer(only.answer)], spec.baud)
    return RPLidarModel(spec, replay=replay(chunks, loop=loop), usb_frame_ns=USB_FRAME_NS)


def _offering(mode: ScanMode) -> LidarSpec:
    """A lidar with this mode only, which every host then takes; dense scans need a faster line."""
    spec = a2m8()
    return replace(spec, modes=(mode,), baud=256000 if mode is DENSE else spec.baud)
