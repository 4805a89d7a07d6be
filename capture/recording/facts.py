"""What is known of each stream of a recording: counts, times, gaps, losses.

The same facts are gathered message by message while recording and from the log later, so that the
verdict on both is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from capture.topics import DIAGNOSTICS_TOPIC

SETTLING_S = 1.0
"""A device may take so long to its first message."""


@dataclass(frozen=True)
class Losses:
    """What a device or we ourselves did not get, as counted until now.

    bad_frames : pieces that failed a check; lost_samples : taken by the device and never come;
    timeouts : questions without an answer; refused : readings that our inbox had no room for;
    disconnects : how often the device was gone; last_error : the newest error of the device.
    """

    bad_frames: int = 0
    lost_samples: int = 0
    timeouts: int = 0
    refused: int = 0
    disconnects: int = 0
    last_error: str = ""


@dataclass(frozen=True)
class StreamFacts:
    """One stream over the whole recording; times are log times in nanoseconds.

    asked_hz : None where no rate was asked; longest_gap_s : also from the last message to the end
    of the recording, and from its start to the first message where that took more than a second.
    """

    device: str
    topic: str
    asked_hz: float | None
    messages: int
    rate_hz: float
    longest_gap_s: float
    longest_gap_at_s: float
    losses: Losses = Losses()


@dataclass
class StreamWatch:
    """Counts the messages of one topic; times come in the order of the log."""

    messages: int = 0
    first_ns: int = 0
    last_ns: int = 0
    gap_ns: int = 0
    gap_from_ns: int = 0

    def note(self, log_t_ns: int) -> None:
        """One more message."""
        if not self.messages:
            self.first_ns = log_t_ns
        elif log_t_ns - self.last_ns > self.gap_ns:
            self.gap_ns, self.gap_from_ns = log_t_ns - self.last_ns, self.last_ns
        self.messages += 1
        self.last_ns = log_t_ns


@dataclass
class RecordingWatch:
    """Counts every topic of a recording that began at `start_ns` (log time)."""

    start_ns: int
    streams: dict[str, StreamWatch] = field(default_factory=dict)

    def note(self, topic: str, log_t_ns: int) -> None:
        """One more message of a topic."""
        self.streams.setdefault(topic, StreamWatch()).note(log_t_ns)

    @property
    def end_ns(self) -> int:
        """When the recording ended: by its last diagnosis, which is taken when a stop is asked."""
        own = self.streams.get(DIAGNOSTICS_TOPIC)
        known = [own] if own is not None else list(self.streams.values())
        return max([self.start_ns, *(watch.last_ns for watch in known)])

    @property
    def duration_s(self) -> float:
        """From start to end."""
        return (self.end_ns - self.start_ns) * 1e-9

    def facts(self, device: str, topic: str, asked_hz: float | None, losses: Losses) -> StreamFacts:
        """What is known of one topic now."""
        watch = self.streams.get(topic, StreamWatch())
        gap_ns, from_ns = max(self._gaps(watch))
        span_s = (watch.last_ns - watch.first_ns) * 1e-9
        return StreamFacts(
            device,
            topic,
            asked_hz,
            watch.messages,
            (watch.messages - 1) / span_s if span_s > 0 else 0.0,
            gap_ns * 1e-9,
            (from_ns - self.start_ns) * 1e-9,
            losses,
        )

    def _gaps(self, watch: StreamWatch) -> list[tuple[int, int]]:
        """Candidates for the longest gap, each with where it began."""
        if not watch.messages:
            return [(self.end_ns - self.start_ns, self.start_ns)]
        gaps = [(watch.gap_ns, watch.gap_from_ns), (self.end_ns - watch.last_ns, watch.last_ns)]
        settling_ns = watch.first_ns - self.start_ns
        if settling_ns > SETTLING_S * 1e9:
            gaps.append((settling_ns, self.start_ns))
        return gaps


@dataclass(frozen=True)
class RecordingFacts:
    """A whole recording: its streams, and what else a judge should know.

    recovered : the log had no end of its own; utc_step_s : the largest jump of the UTC clock;
    ended_because : why the recording ended, where it was not a person's wish; remarks : others.
    """

    streams: tuple[StreamFacts, ...]
    duration_s: float
    recovered: bool = False
    utc_step_s: float = 0.0
    ended_because: str = ""
    remarks: tuple[str, ...] = ()
