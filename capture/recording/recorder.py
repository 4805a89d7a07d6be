"""All devices at once into one session: threads, the still period, the end, the verdict."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from capture.clock import UtcLine, read_clock_pair
from capture.recording.clock_witness import ClockWitness
from capture.recording.facts import RecordingFacts
from capture.recording.folder import held
from capture.recording.inbox import Inbox
from capture.recording.ledger import SELF, Ledger, RecordingError
from capture.recording.scribe import Item
from capture.recording.status import StreamStatus
from capture.recording.stream import Stream
from capture.recording.verdict import Verdict, judged
from capture.session_info import SessionInfo
from drivers import Device, DeviceReader, DriverError

DIAGNOSIS_S = 1.0
READY_S = 10.0
"""So long a device may take to its first message: a lidar must spin up."""


@dataclass(frozen=True)
class Limits:
    """When a recording ends by itself (`seconds` None: not), and how long the car first stands."""

    seconds: float | None = None
    still_s: float = 0.0
    disk_reserve_bytes: int = 500_000_000


@dataclass(frozen=True)
class Clocks:
    """The clocks and the disk gauge of the machine, to be replaced in tests."""

    monotonic_ns: Callable[[], int] = time.monotonic_ns
    utc_ns: Callable[[], int] = time.time_ns
    free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free


class Recorder:
    """A recording from the first byte to the verdict; a context manager.

    folder : of the session, which exists and is empty; translators of all `streams` were made with
    `utc`; witness : asks other clocks meanwhile. Entering connects every device and reads it;
    `is_ready` is set, and the recording counts, once each has given something. Leaving stops
    devices first, then ends the logs, then writes what is known. Raises `RecordingError` naming
    every device that cannot be had, and leaves none of the others running.
    """

    def __init__(
        self,
        folder: Path,
        info: SessionInfo,
        streams: Mapping[str, Stream],
        utc: UtcLine,
        limits: Limits = Limits(),
        clocks: Clocks = Clocks(),
        witness: ClockWitness | None = None,
    ) -> None:
        self.folder = folder
        self.witness = witness
        self._limits, self._clocks = limits, clocks
        self._ledger = Ledger(folder, info, streams, utc)
        bounds = {name: stream.waiting for name, stream in streams.items()}
        self._inbox: Inbox[Item] = Inbox({**bounds, SELF: 60})
        self._readers = {name: self._reader(name, s.device) for name, s in streams.items()}
        self._writer = threading.Thread(target=self._write_on, name="scribe", daemon=True)
        self._held = ExitStack()
        self._fault: Exception | None = None
        self._diagnosed_ns = self._connected_ns = 0
        self.is_ready = False

    @property
    def info(self) -> SessionInfo:
        """What `session.yaml` says by now."""
        return self._ledger.info

    @property
    def ended_because(self) -> str:
        """Why the recording must end, or ended; empty where a person wished it."""
        return self._ledger.own.ended_because

    def __enter__(self) -> Recorder:
        with ExitStack() as undo:
            undo.enter_context(held(self.folder))
            undo.callback(self._stop_devices)
            self._connect()
            self._begin()
            self._held = undo.pop_all()
        return self

    def _begin(self) -> None:
        self._ledger.begin()
        self._connected_ns = self._diagnosed_ns = self._clocks.monotonic_ns()
        self._ledger.start(self._connected_ns)
        self._writer.start()
        if self.witness is not None:
            self.witness.begin()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        stopped_ns = self._clocks.monotonic_ns()
        if self.witness is not None:
            self.witness.begin_last()
        if isinstance(error, Exception) and not self.ended_because:
            self._ledger.own.ended_because = f"of an error ({type(error).__name__})"
        with self._held:  # which stops the devices, once more, and lets go of the folder
            self._stop_devices()
            self._inbox.close()
            self._writer.join()
            self._end_logs(stopped_ns)

    @property
    def started_ns(self) -> int:
        """Since when the recording counts (monotonic)."""
        return self._ledger.own.started_ns

    @property
    def elapsed_s(self) -> float:
        """Time since the start: since every device has given something, or has had its time."""
        return (self._clocks.monotonic_ns() - self.started_ns) * 1e-9

    def is_over(self) -> bool:
        """Whether its time is over, or it must end (`ended_because` then says why)."""
        limit_s = self._limits.seconds
        if self.ended_because or any(s.is_finished() for s in self._ledger.streams.values()):
            return True
        return limit_s is not None and self.elapsed_s >= limit_s

    @property
    def most_waiting(self) -> int:
        """How many readings ever waited for the disk at once."""
        return self._inbox.high_water

    def poll(self) -> tuple[StreamStatus, ...]:
        """How every stream does; to be called a few times a second.

        Once a second it writes the diagnostics and looks after clock and disk. When the recording
        must end, `ended_because` says why.
        """
        now_ns = self._clocks.monotonic_ns()
        statuses = self._statuses(now_ns)
        if not self.is_ready:
            late = now_ns - self._connected_ns >= READY_S * 1e9
            self.is_ready = late or all(status.messages for status in statuses)
            self._ledger.start(now_ns)
            for stream in self._ledger.streams.values():
                if self.is_ready and stream.still is not None:
                    stream.still.begin(now_ns, self._limits.still_s)
        if now_ns - self._diagnosed_ns >= DIAGNOSIS_S * 1e9:
            self._diagnosed_ns = now_ns
            self._look_around()
            self._inbox.put(SELF, self._ledger.diagnosis(now_ns, statuses))
        if self._fault is not None:
            self._ledger.own.ended_because = f"writing failed: {self._fault}"
        return statuses

    def headline(self) -> str:
        """One line on the whole recording: time, room on the disk, what waits to be written."""
        free_gb = self._clocks.free_bytes(self.folder) * 1e-9
        waiting = len(self._inbox)
        return f"{self.elapsed_s:.0f} s, {free_gb:.1f} GB free, {waiting} waiting"

    def facts(self) -> RecordingFacts:
        """What is known of the recording until now."""
        return self._ledger.facts()

    def verdict(self) -> Verdict:
        """Whether what was recorded until now is any good."""
        return judged(self.facts())

    def _reader(self, name: str, device: Device[Any]) -> DeviceReader[Any]:
        def take(item: Any) -> None:
            self._inbox.put(name, item)

        return DeviceReader(device, take, clock_ns=self._clocks.monotonic_ns)

    def _connect(self) -> None:
        """All devices at the same time, so that their waits do not add up; all faults at once.

        Each is read as soon as it runs: buffers of devices and of the kernel hold a third of a
        second, others may take longer to start.
        """

        def tried(name: str) -> DriverError | None:
            try:
                self._ledger.streams[name].device.connect()
            except DriverError as err:
                return err
            self._readers[name].start()
            return None

        with ThreadPoolExecutor(max(len(self._readers), 1)) as pool:
            errors = list(pool.map(tried, self._readers))
        faults = [f"{name}: {err}" for name, err in zip(self._readers, errors, strict=True) if err]
        if faults:
            raise RecordingError("\n".join(["cannot record:", *faults]))

    def _write_on(self) -> None:
        try:
            while (got := self._inbox.get()) is not None:
                self._ledger.scribe.take(*got)
        except Exception as err:
            self._fault = err

    def _statuses(self, now_ns: int) -> tuple[StreamStatus, ...]:
        return self._ledger.statuses(now_ns, self._inbox.refused, ready=self.is_ready)

    def _look_around(self) -> None:
        """Note whether the clock was set, and whether the disk has room left."""
        own = self._ledger.own
        pair = read_clock_pair(self._clocks.monotonic_ns, self._clocks.utc_ns)
        own.utc_step_ns = max(own.utc_step_ns, self._ledger.utc.step_ns(pair), key=abs)
        own.disk_free_bytes = self._clocks.free_bytes(self.folder)
        own.most_waiting = self.most_waiting
        if own.disk_free_bytes < self._limits.disk_reserve_bytes and not own.ended_because:
            own.ended_because = f"the disk is full: {own.disk_free_bytes / 1e6:.0f} MB left"

    def _stop_devices(self) -> None:
        for reader in self._readers.values():
            reader.end()
        with ThreadPoolExecutor(max(len(self._readers), 1)) as pool:
            list(pool.map(lambda reader: reader.stop(), self._readers.values()))

    def _end_logs(self, stopped_ns: int) -> None:
        """The last diagnosis, the ends of the logs, and what is known of the recording."""
        if self._fault is not None:
            self._ledger.abandon(self._fault)
        self._ledger.own.most_waiting = self.most_waiting
        last = self._ledger.diagnosis(stopped_ns, self._statuses(stopped_ns))
        ended = read_clock_pair(self._clocks.monotonic_ns, self._clocks.utc_ns)
        self._ledger.finish(last, ended)
        if self.witness is not None:  # everything is safe by now
            self._ledger.note_clocks(*self.witness.told())
