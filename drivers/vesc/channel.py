"""A VESC's port, narrowed to what its holder may do.

A `ReadChannel` takes questions and nothing else: a logger cannot send a byte that moves, stores or
reboots. A `DriveChannel` takes commands as well.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

from drivers.port import Chunk, Port, drain
from drivers.vesc.commands import Command
from drivers.vesc.framing import Frame, FrameReceiver
from drivers.vesc.requests import ReadRequest


@dataclass(frozen=True)
class Received:
    """Bytes as they came, and the frames that they completed."""

    chunk: Chunk
    frames: list[Frame]


class ReadChannel:
    """Asks a VESC and hears its answers; has no way to send anything else."""

    def __init__(self, port: Port) -> None:
        self.receiver = FrameReceiver()
        self._port = port
        self._writing = threading.Lock()

    def now_ns(self) -> int:
        """The monotonic time of the port."""
        return self._port.now_ns()

    def ask(self, request: ReadRequest) -> int:
        """Send a question; when it was sent."""
        return self._send(request.frame)

    def read(self, timeout_s: float) -> Received | None:
        """What came next; None if nothing came in time."""
        chunk = self._port.read(timeout_s)
        return None if chunk is None else Received(chunk, self.receiver.feed(chunk.data))

    def drain(self, *, quiet_s: float, limit_s: float) -> int:
        """Throw away what waits, until it is quiet; how many bytes."""
        return drain(self._port, quiet_s=quiet_s, limit_s=limit_s)

    def close(self) -> None:
        """Give the port back; may be called twice and from any thread."""
        self._port.close()

    def _send(self, frame: bytes) -> int:
        # Two threads may write, one asks and one commands: whole frames, never mixed.
        with self._writing:
            t_ns = self._port.now_ns()
            self._port.write(frame)
        return t_ns


class DriveChannel(ReadChannel):
    """Also sends commands."""

    def command(self, command: Command, *, times: int = 1) -> int:
        """Send a command, on request more than once as nothing acknowledges it; when."""
        return self._send(command.frame * times)
