"""The device's side of a protocol: a model that answers bytes, with or without a real port.

A `DeviceModel` is a state machine without threads, ports or a clock of its own. `ModelPort` puts a
driver in front of it in simulated time, so a test of ten minutes takes a moment; `PtyEmulator` lets
it live behind a pseudo-terminal at real pace, where any program can open it.
"""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
import tty
from collections.abc import Callable
from types import TracebackType
from typing import Protocol

from drivers.errors import DeviceLostError
from drivers.port import Chunk

IDLE_S = 0.05


class DeviceModel(Protocol):
    """A device as its serial line shows it; times are monotonic nanoseconds of the caller."""

    def receive(self, data: bytes, now_ns: int) -> None:
        """Take bytes that the host sent; they may be cut anywhere."""

    def transmit(self, now_ns: int) -> bytes:
        """Every byte whose time has come, in order; those of this call are given once."""

    def next_ns(self) -> int | None:
        """When there will next be something to transmit; None: not before the host says more."""


class Line:
    """Bytes on their way out, each at its own time; the send queue of a model.

    baud : None for a line that costs no time (USB), else ten bits a byte.
    """

    def __init__(self, baud: int | None = None) -> None:
        self._baud = baud
        self._waiting: list[tuple[int, bytes]] = []
        self._free_ns = 0

    def send(self, data: bytes, at_ns: int) -> int:
        """Queue bytes that leave from `at_ns` on, or once the line is free; when they are out."""
        wire_ns = 0 if self._baud is None else len(data) * 10_000_000_000 // self._baud
        self._free_ns = max(at_ns, self._free_ns) + wire_ns
        self._waiting.append((self._free_ns, data))
        return self._free_ns

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._waiting.clear()

    def due(self, now_ns: int) -> bytes:
        """What has left by now."""
        count = 0
        while count < len(self._waiting) and self._waiting[count][0] <= now_ns:
            count += 1
        gone, self._waiting = self._waiting[:count], self._waiting[count:]
        return b"".join(data for _, data in gone)

    def next_ns(self) -> int | None:
        """When the next piece will have left."""
        return self._waiting[0][0] if self._waiting else None


class ModelPort:
    """A `drivers.port.Port` straight into a model, in simulated time.

    `unplug()` makes it fail as a pulled cable does; `plug()` mends it. `written` keeps what the
    driver sent. `on_write` sees each write before the model does.
    """

    def __init__(self, model: DeviceModel, *, name: str = "model", start_ns: int = 0) -> None:
        self.model = model
        self.written = bytearray()
        self.bauds: list[int] = []
        self.dtr: bool | None = None
        self.closed = False
        self._name, self._now_ns, self._gone = name, start_ns, False
        self._waiting = bytearray()

    @property
    def name(self) -> str:
        """As given."""
        return self._name

    def now_ns(self) -> int:
        """Simulated time; it passes in `pause` and `read` only."""
        return self._now_ns

    def pause(self, seconds: float) -> None:
        """Let simulated time pass."""
        self._run_until(self._now_ns + round(seconds * 1e9))

    def read(self, timeout_s: float) -> Chunk | None:
        """What the model sends next, or None after the time-out."""
        self._check()
        end_ns = self._now_ns + round(timeout_s * 1e9)
        while not self._waiting and self._now_ns < end_ns:
            next_ns = self.model.next_ns()
            # Always some progress, even where a model is due and then has nothing to say.
            due_ns = end_ns if next_ns is None else max(next_ns, self._now_ns + 1000)
            self._run_until(min(due_ns, end_ns))
        data, self._waiting = bytes(self._waiting), bytearray()
        return Chunk(self._now_ns, data) if data else None

    def write(self, data: bytes) -> None:
        """Give bytes to the model at once."""
        self._check()
        self.written += data
        self.model.receive(data, self._now_ns)

    def set_baud(self, baud: int) -> None:
        """Note the speed; a model that cares for it looks at `bauds`."""
        self._check()
        self.bauds.append(baud)
        self._waiting.clear()

    def set_dtr(self, level: bool) -> None:
        """Note the state of that line."""
        self._check()
        self.dtr = level

    def close(self) -> None:
        """Note that the driver is done."""
        self.closed = True

    def unplug(self) -> None:
        """From now on every read and write fails."""
        self._gone = True

    def plug(self) -> None:
        """The cable is back."""
        self._gone, self.closed = False, False

    def _run_until(self, end_ns: int) -> None:
        self._now_ns = max(self._now_ns, end_ns)
        self._waiting += self.model.transmit(self._now_ns)

    def _check(self) -> None:
        if self._gone or self.closed:
            raise DeviceLostError(f"{self._name}: the device is gone; plug it in again")


class PtyEmulator:
    """A model behind a pseudo-terminal at real pace, in a thread of its own; a context manager.

    path : what other programs open. `sent_bytes` counts what the model sent, `dropped_bytes` what
    found no room because nobody read. `unplug()` hangs up. speed : how much faster than real time
    the model lives.
    """

    def __init__(
        self,
        model: DeviceModel,
        *,
        speed: float = 1.0,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.model = model
        self.sent_bytes = 0
        self.dropped_bytes = 0
        self._speed = speed
        self._clock_ns = clock_ns if speed == 1.0 else _faster(clock_ns, speed)
        self._ours, self._theirs = os.openpty()
        for end in (self._ours, self._theirs):
            tty.setraw(end)
        # Their end stays open here too: else reads fail (EIO) after the first client closes.
        self.path = os.ttyname(self._theirs)
        os.set_blocking(self._ours, False)
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._run, name=f"emulator {self.path}", daemon=True)

    def __enter__(self) -> PtyEmulator:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Hang up and end; programs that hold the port get an error, as with a pulled cable."""
        if self._thread.is_alive():
            os.write(self._wake_write, b"x")
            self._thread.join()
        for end in (self._ours, self._theirs, self._wake_read, self._wake_write):
            with contextlib.suppress(OSError):
                os.close(end)
        self._ours = self._theirs = self._wake_read = self._wake_write = -1

    def _run(self) -> None:
        while True:
            next_ns = self.model.next_ns()
            wait_s = IDLE_S
            if next_ns is not None:
                wait_s = (next_ns - self._clock_ns()) * 1e-9 / self._speed
            ready, _, _ = select.select(
                [self._ours, self._wake_read], [], [], min(max(wait_s, 0.0), IDLE_S)
            )
            if self._wake_read in ready:
                return
            if self._ours in ready:
                with contextlib.suppress(OSError):
                    self.model.receive(os.read(self._ours, 4096), self._clock_ns())
            self._send(self.model.transmit(self._clock_ns()))

    def _send(self, data: bytes) -> None:
        """Write what the kernel takes; like a real line, what nobody reads is lost and counted."""
        sent = 0
        with contextlib.suppress(BlockingIOError, OSError):
            sent = os.write(self._ours, data) if data else 0
        self.sent_bytes += sent
        self.dropped_bytes += len(data) - sent


def _faster(clock_ns: Callable[[], int], speed: float) -> Callable[[], int]:
    start_ns = clock_ns()
    return lambda: start_ns + round((clock_ns() - start_ns) * speed)
