"""Finishing what a power cut, a kill or a full disk broke off."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

from capture.errors import LogError
from capture.log_reader import McapLog
from capture.log_writer import LogWriter
from capture.recording.check import checked
from capture.recording.folder import held
from capture.recording.verdict import Verdict
from capture.session import Session
from capture.session_info import write_session_info
from capture.session_writer import write_rosbag_metadata, written_topics
from capture.topics import IMAGE_LOGS
from capture.transaction import writing_error

UNFINISHED = ".unfinished"
"""What the broken log is called once its finished copy has taken its name."""


@dataclass(frozen=True)
class RecoveredLog:
    """A log that was finished: how many messages it holds, chunks that were damaged."""

    name: str
    messages: int
    damaged_chunks: int
    kept_as: str


def recover(folder: Path) -> tuple[tuple[RecoveredLog, ...], Verdict]:
    """Give every log of a session its end, and the session its verdict.

    A broken log is copied message by message; the copy takes its name and the original stays
    beside it as NAME.unfinished. Raises `SessionError`, `LogError`.
    """
    session = Session.open(folder)
    with held(folder):
        broken = [log for log in session.logs if log.truncated]
        readable = [log for log in broken if _has_messages(log)]
        done = tuple(_finished(log) for log in readable)
        for log in broken:
            if log not in readable:  # the power went within the first second
                log.file.rename(log.file.with_name(log.file.name + UNFINISHED))
        whole = Session.open(folder)
        recovered = bool(broken) or any(folder.glob(f"*{UNFINISHED}"))
        _, verdict = checked(whole, recovered=recovered)
        written = {log.file.name: written_topics(log) for log in whole.logs}
        if any(written.values()):
            write_rosbag_metadata(folder, written)
        if broken or whole.info.verdict is None:
            info = replace(whole.info, verdict=verdict.verdict, verdict_reason=verdict.text)
            write_session_info(folder, info)
    return done, verdict


def _has_messages(log: McapLog) -> bool:
    try:
        return any(topic.count for topic in log.topics.values())
    except LogError:
        return False


def _finished(log: McapLog) -> RecoveredLog:
    """A whole log in the place of a broken one."""
    partial = log.file.with_name(f".{log.file.name}.partial")
    kept = log.file.with_name(log.file.name + UNFINISHED)
    types = {name: topic.type_name for name, topic in log.topics.items()}
    count = 0
    try:
        with LogWriter(
            partial, sync_period_s=None, compressed=log.file.name not in IMAGE_LOGS
        ) as writer:
            for count, message in enumerate(log.messages(), 1):  # noqa: B007  the last one counts
                writer.write(
                    message.topic,
                    types[message.topic],
                    message.data,
                    log_t_ns=message.log_t_ns,
                    stamp_ns=message.stamp_ns,
                )
        _also_named(log.file, kept)
        partial.replace(log.file)
    except OSError as err:
        raise writing_error(log.file, err) from err
    finally:
        partial.unlink(missing_ok=True)
    return RecoveredLog(log.file.name, count, log.damaged_chunks, kept.name)


def _also_named(file: Path, name: Path) -> None:
    """Give a file a second name, so that there is no moment without it; else move it."""
    try:
        os.link(file, name)
    except OSError:  # a card formatted as FAT has no links
        file.rename(name)
