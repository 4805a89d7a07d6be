"""What a recording keeps of itself, however its devices are read: who, how much, how good."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from capture.clock import UtcLine
from capture.errors import CaptureError
from capture.recording.facts import RecordingFacts
from capture.recording.scribe import Diagnosis, Scribe
from capture.recording.status import Health, StreamStatus, remarks_of
from capture.recording.stream import Stream
from capture.recording.verdict import judged
from capture.sensor_messages import OK
from capture.session_info import ClockPair, PeerClock, SessionInfo, write_session_info
from capture.session_writer import write_rosbag_metadata

STREAMS_KEY = "streams"
"""Where `session.yaml` keeps what was asked of each device, within `configuration`."""
SELF = "recorder"
"""The recorder's own name in the inbox and in the diagnostics."""


class RecordingError(CaptureError):
    """A recording that cannot begin, or had to end."""


@dataclass
class OwnFacts:
    """What the recorder knows of itself; times are monotonic."""

    started_ns: int = 0
    ended_because: str = ""
    utc_step_ns: int = 0
    disk_free_bytes: int = 0
    most_waiting: int = 0


class Ledger:
    """The book of one recording: `begin`, then `scribe.take` and `diagnosis`, then `finish`.

    folder : of the session, which exists and is empty; translators of all `streams` were made with
    `utc`. sync_period_s : how often the logs are put on the disk, None: at their end.
    """

    def __init__(
        self,
        folder: Path,
        info: SessionInfo,
        streams: Mapping[str, Stream],
        utc: UtcLine,
        *,
        sync_period_s: float | None = 1.0,
    ) -> None:
        self.folder, self.info, self.utc = folder, info, utc
        self.streams = dict(streams)
        translators = {name: stream.translator for name, stream in streams.items()}
        self.scribe = Scribe(folder, translators, utc, sync_period_s=sync_period_s)
        self.own = OwnFacts()
        self._health = Health(self.streams)

    def begin(self) -> None:
        """Note who the connected devices are and what is asked of them."""
        identities: dict[str, Mapping[str, Any]] = {
            name: dict(s.device.identify()) for name, s in self.streams.items()
        }
        for name, identity in identities.items():
            rate_hz = identity.get("rate_hz")
            if self.streams[name].asked_hz is None and isinstance(rate_hz, (int, float)):
                self.streams[name] = replace(self.streams[name], asked_hz=float(rate_hz))
        asked = {
            name: {"topic": s.translator.topic, "asked_hz": s.asked_hz}
            for name, s in self.streams.items()
        }
        configuration = {**self.info.configuration, STREAMS_KEY: asked}
        self.info = replace(self.info, devices=identities, configuration=configuration)
        write_session_info(self.folder, self.info)

    def start(self, now_ns: int) -> None:
        """Let the recording count from now."""
        self.own.started_ns = now_ns
        self.scribe.watch.start_ns = self.utc.utc(now_ns)

    def statuses(
        self, now_ns: int, refused: Counter[str], *, ready: bool
    ) -> tuple[StreamStatus, ...]:
        """How every stream does."""
        return self._health.now(now_ns, self.scribe, refused, self.utc, ready=ready)

    def diagnosis(self, now_ns: int, statuses: tuple[StreamStatus, ...]) -> Diagnosis:
        """What stands in the diagnostics at this moment."""
        own = {
            "started_ns": self.utc.utc(self.own.started_ns),
            "ended_because": self.own.ended_because,
            "utc_step_ns": self.own.utc_step_ns,
            "disk_free_bytes": self.own.disk_free_bytes,
            "most_waiting": self.own.most_waiting,
        }
        return Diagnosis(
            now_ns, [*(status.diagnosis() for status in statuses), (SELF, OK, "", own)]
        )

    def facts(self) -> RecordingFacts:
        """What is known of the recording until now."""
        watch = self.scribe.watch
        streams = tuple(
            watch.facts(
                name, s.translator.topic, s.asked_hz, self._health.losses(name, self.scribe)
            )
            for name, s in sorted(self.streams.items())
        )
        return RecordingFacts(
            streams,
            watch.duration_s,
            utc_step_s=self.own.utc_step_ns * 1e-9,
            ended_because=self.own.ended_because,
            remarks=remarks_of({n: s.translator.state() for n, s in self.streams.items()}),
        )

    def finish(self, last: Diagnosis, ended: ClockPair) -> None:
        """The last diagnosis, the ends of the logs, the verdict; raises `RecordingError`."""
        try:
            self.scribe.take(SELF, last)
            write_rosbag_metadata(self.folder, self.scribe.finish())
        except Exception as err:
            self.abandon(err)
        verdict = judged(self.facts())
        self.info = replace(
            self.info,
            clocks=(*self.info.clocks, ended),
            verdict=verdict.verdict,
            verdict_reason=verdict.text,
        )
        write_session_info(self.folder, self.info)

    def note_clocks(self, peer_clocks: tuple[PeerClock, ...], chrony: tuple[str, ...]) -> None:
        """What was heard of other clocks, which comes when all else is written."""
        if peer_clocks or chrony:
            self.info = replace(self.info, peer_clocks=peer_clocks, chrony=chrony)
            write_session_info(self.folder, self.info)

    def abandon(self, error: Exception) -> None:
        """Leave the logs as they are and say how to finish them: raises `RecordingError`."""
        self.scribe.abandon(error)
        raise RecordingError(
            f"{error}\nwhat was written until then is kept: trackside recover {self.folder}"
        ) from error
