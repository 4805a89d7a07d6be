"""Recording devices that live in simulated time: the same messages, as fast as they can be made.

Each device has a clock of its own that passes while it is waited for (`drivers.ModelPort` and its
kin), so devices are read one after the other and merged by arrival. Everything from the driver to
the log is what `Recorder` uses; there are no threads, so one seed gives one recording to the byte.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from capture.clock import UtcLine
from capture.recording.folder import held
from capture.recording.ledger import SELF, Ledger
from capture.recording.recorder import DIAGNOSIS_S
from capture.recording.stream import Stream
from capture.session_info import ClockPair, SessionInfo
from drivers import Device, Reading

READ_S = 0.05
NOTHING_REFUSED: Counter[str] = Counter()


def record_in_simulated_time(
    folder: Path,
    info: SessionInfo,
    streams: Mapping[str, Stream],
    utc: UtcLine,
    *,
    starts_ns: int,
    ends_ns: int,
    still_s: float = 0.0,
    advance: Callable[[float], None] = lambda _: None,
) -> SessionInfo:
    """Record every device into `folder`, which exists and is empty; what `session.yaml` says then.

    starts_ns : since when the recording counts, when every device has given something; ends_ns :
    when a person would end it; both on the devices' clock. advance : told the seconds done.
    Raises `DriverError`, `LogError`, `RecordingError`.
    """
    ledger = Ledger(folder, info, streams, utc, sync_period_s=None)
    with ExitStack() as stack:
        stack.enter_context(held(folder))
        for stream in streams.values():
            stack.enter_context(closing(stream.device))
            stream.device.connect()
        ledger.begin()
        ledger.start(starts_ns)
        for stream in streams.values():
            if stream.still is not None:
                stream.still.begin(starts_ns, still_s)
        _write(ledger, starts_ns, ends_ns, advance)
    statuses = ledger.statuses(ends_ns, NOTHING_REFUSED, ready=True)
    ended = ClockPair(monotonic_ns=ends_ns, utc_ns=utc.utc(ends_ns))
    ledger.finish(ledger.diagnosis(ends_ns, statuses), ended)
    return ledger.info


def _write(ledger: Ledger, starts_ns: int, ends_ns: int, advance: Callable[[float], None]) -> None:
    diagnosis_ns = round(DIAGNOSIS_S * 1e9)
    due_ns = starts_ns + diagnosis_ns
    arrived = [_readings(name, s.device, ends_ns) for name, s in ledger.streams.items()]
    for t_ns, name, reading in heapq.merge(*arrived, key=lambda item: item[:2]):
        while due_ns <= min(t_ns, ends_ns):
            statuses = ledger.statuses(due_ns, NOTHING_REFUSED, ready=True)
            ledger.scribe.take(SELF, ledger.diagnosis(due_ns, statuses))
            advance(diagnosis_ns * 1e-9)
            due_ns += diagnosis_ns
        ledger.scribe.take(name, reading)


def _readings(
    name: str, device: Device[Any], ends_ns: int
) -> Iterator[tuple[int, str, Reading[Any]]]:
    """What a device gives until then, each with its arrival; a silent device ends it too."""
    silent = 0
    while silent * READ_S < 10.0:
        reading = device.read(READ_S)
        if reading is None:
            silent += 1
            continue
        silent = 0
        t_ns = arrival_ns(reading)
        if t_ns > ends_ns:
            return
        yield t_ns, name, reading


def arrival_ns(reading: Reading[Any]) -> int:
    """When the last of a reading was here, on our clock."""
    if reading.raw:
        return reading.raw[-1].t_ns
    newest = reading.samples[-1]
    return int(getattr(newest, "arrival_ns", getattr(newest, "t_ns", 0)))
