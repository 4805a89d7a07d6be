"""The verdict on a session from its logs: the same as the recorder's, at any later time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from capture.configuration import configuration_from_mapping
from capture.errors import SessionError
from capture.recording.facts import RecordingFacts, RecordingWatch
from capture.recording.ledger import SELF, STREAMS_KEY
from capture.recording.status import losses_from, remarks_of
from capture.recording.verdict import Verdict, judged
from capture.sensor_messages import diagnostics_of
from capture.session import Session
from capture.topics import DIAGNOSTICS_TOPIC, OVERHEAD_LOG_NAME


@dataclass(frozen=True)
class Asked:
    """What a recording promised of one device: the topic it is judged by, and its rate."""

    topic: str
    asked_hz: float | None = None


@dataclass(frozen=True)
class _Expected:
    streams: Mapping[str, Asked]


def checked(session: Session, *, recovered: bool = False) -> tuple[RecordingFacts, Verdict]:
    """What the logs of a recording tell, and the verdict.

    recovered : its logs were finished after the recording broke off (a log that has no end yet
    counts as that too). Raises `SessionError` for a session that was not recorded by trackside.
    """
    facts = facts_of(session, recovered=recovered)
    return facts, judged(facts)


def facts_of(session: Session, *, recovered: bool = False) -> RecordingFacts:
    """The facts of a recording, from its logs."""
    asked = _asked(session)
    watch, last = RecordingWatch(session.info.clocks[0].utc_ns), b""
    film_clock = session.info.film_clock
    for log in session.logs:
        film = film_clock if log.file.name == OVERHEAD_LOG_NAME else None
        for message in log.messages():
            t_ns = message.log_t_ns if film is None else film.session_ns(message.log_t_ns)
            watch.note(message.topic, t_ns)
            if message.topic == DIAGNOSTICS_TOPIC:
                last = message.data
    diagnosis = diagnostics_of(last) if last else {}
    own = diagnosis.get(SELF, {})
    watch.start_ns = int(own.get("started_ns", watch.start_ns))
    return RecordingFacts(
        tuple(
            watch.facts(name, one.topic, one.asked_hz, losses_from(diagnosis.get(name, {})))
            for name, one in sorted(asked.items())
        ),
        watch.duration_s,
        recovered=recovered or any(log.truncated for log in session.logs),
        utc_step_s=int(own.get("utc_step_ns", 0)) * 1e-9,
        ended_because=own.get("ended_because", ""),
        remarks=(
            *remarks_of({name: diagnosis[name] for name in asked if name in diagnosis}),
            *(
                f"{log.file.name}: {log.damaged_chunks} damaged chunks"
                for log in session.logs
                if log.topics and log.damaged_chunks
            ),
        ),
    )


def _asked(session: Session) -> Mapping[str, Asked]:
    streams = session.info.configuration.get(STREAMS_KEY)
    if not session.info.clocks or not isinstance(streams, Mapping):
        raise SessionError(
            f"{session.folder}: was not recorded by trackside record (session.yaml names no "
            "streams), so nothing was promised that could be checked; see trackside info"
        )
    name = f"{session.folder}/session.yaml"
    return configuration_from_mapping(_Expected, {STREAMS_KEY: streams}, name).streams
