"""How each stream does at this moment: for the live table, the alarms and the diagnostics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

from capture.clock import UtcLine
from capture.recording.facts import Losses, StreamWatch
from capture.recording.translation import Translator
from capture.recording.verdict import MIN_RATE, SILENT_S
from capture.sensor_messages import ERROR, OK, STALE, WARN, Status
from drivers import Device

if TYPE_CHECKING:
    from capture.recording.scribe import Scribe

State = Literal["ok", "starting", "slow", "silent", "lost"]
_LEVELS: Mapping[State, int] = {
    "ok": OK,
    "starting": OK,
    "slow": WARN,
    "silent": STALE,
    "lost": ERROR,
}

RATE_OVER_S = 2.0


@dataclass(frozen=True)
class StreamStatus:
    """One stream now.

    state : ok; starting (nothing yet, and it still has time); slow (below nine tenths of the rate
    asked); silent (nothing for two seconds: an
    alarm); lost (the device is gone and being tried). age_s : since its last message, or since
    the start.
    """

    device: str
    state: State
    asked_hz: float | None
    rate_hz: float
    age_s: float
    messages: int
    longest_gap_s: float
    losses: Losses
    details: Mapping[str, object]

    def diagnosis(self) -> Status:
        """The stream as a `diagnostic_msgs/DiagnosticStatus`."""
        values = {
            "asked_hz": self.asked_hz if self.asked_hz is not None else "",
            "rate_hz": f"{self.rate_hz:.2f}",
            "messages": self.messages,
            "longest_gap_s": f"{self.longest_gap_s:.4f}",
            **{name: getattr(self.losses, name) for name in _COUNTS},
            **self.details,
        }
        text = self.losses.last_error if self.state == "lost" else self.state
        return self.device, _LEVELS[self.state], text, values


_COUNTS = ("bad_frames", "lost_samples", "timeouts", "refused", "disconnects", "last_error")


def losses_from(values: Mapping[str, str]) -> Losses:
    """The losses that a diagnostic status holds, the inverse of `StreamStatus.diagnosis`."""
    counts = {name: int(values.get(name, "0") or 0) for name in _COUNTS[:-1]}
    return Losses(**counts, last_error=values.get("last_error", ""))


def remarks_of(states: Mapping[str, Mapping[str, object]]) -> tuple[str, ...]:
    """What the translators of the devices have to say at the end, by the names of the devices."""
    return tuple(f"{name}: {s['remark']}" for name, s in sorted(states.items()) if "remark" in s)


class Watched(Protocol):
    """What is needed of a stream to watch it (`capture.recording.stream.Stream`)."""

    @property
    def device(self) -> Device[Any]:
        """Whose counters are read."""

    @property
    def translator(self) -> Translator[Any]:
        """Whose topic is counted."""

    @property
    def asked_hz(self) -> float | None:
        """How many messages a second are asked for."""


class Health:
    """Watches the counts of all streams from one look to the next."""

    def __init__(self, streams: Mapping[str, Watched]) -> None:
        self._streams = streams
        self._marks: dict[str, list[tuple[int, int]]] = {name: [] for name in streams}
        self._refused: Counter[str] = Counter()
        self._began_ns: int | None = None

    def now(
        self, now_ns: int, scribe: Scribe, refused: Counter[str], utc: UtcLine, *, ready: bool
    ) -> tuple[StreamStatus, ...]:
        """Every stream at `now_ns` (monotonic); ready : none may still be starting."""
        self._refused = refused
        self._began_ns = now_ns if self._began_ns is None else self._began_ns
        return tuple(self._status(name, now_ns, scribe, utc, ready) for name in self._streams)

    def losses(self, name: str, scribe: Scribe) -> Losses:
        """What a device and we lost until now, from the driver's counters and our own."""
        counters = self._streams[name].device.counters
        return replace(
            scribe.losses[name],
            bad_frames=counters.bad_frames,
            lost_samples=counters.lost_samples,
            timeouts=counters.timeouts,
            refused=self._refused[name],
        )

    def _status(
        self, name: str, now_ns: int, scribe: Scribe, utc: UtcLine, ready: bool
    ) -> StreamStatus:
        stream = self._streams[name]
        watch = scribe.watch.streams.get(stream.translator.topic, StreamWatch())
        assert self._began_ns is not None
        last_ns = watch.last_ns if watch.messages else utc.utc(self._began_ns)
        age_s = (utc.utc(now_ns) - last_ns) * 1e-9
        rate_hz = self._rate(name, now_ns, watch.messages)
        if scribe.gone[name]:
            state: State = "lost"
        elif not watch.messages and not ready:
            state = "starting"
        else:
            state = "silent" if age_s >= SILENT_S else self._pace(name, now_ns, rate_hz)
        return StreamStatus(
            name,
            state,
            stream.asked_hz,
            rate_hz,
            age_s,
            watch.messages,
            max(watch.gap_ns * 1e-9, age_s if age_s > SILENT_S else 0.0),
            self.losses(name, scribe),
            stream.translator.state(),
        )

    def _rate(self, name: str, now_ns: int, messages: int) -> float:
        """Messages per second over the last two seconds, from the first message on."""
        marks = self._marks[name]
        if not messages:
            return 0.0
        marks.append((now_ns, messages))
        while len(marks) > 2 and now_ns - marks[1][0] >= RATE_OVER_S * 1e9:
            marks.pop(0)
        before, span_ns = marks[0][1], now_ns - marks[0][0]
        return (messages - before) * 1e9 / span_ns if span_ns > 0 else 0.0

    def _pace(self, name: str, now_ns: int, rate_hz: float) -> State:
        asked_hz, marks = self._streams[name].asked_hz, self._marks[name]
        watched_s = (now_ns - marks[0][0]) * 1e-9 if marks else 0.0
        slow = asked_hz is not None and rate_hz < MIN_RATE * asked_hz
        return "slow" if slow and watched_s >= RATE_OVER_S / 2 else "ok"
