"""Sessions -> bags that ROS 1 and ROS 2 play: every message, at its log time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from capture.errors import MissingStreamError, SessionError
from capture.log_reader import McapLog, Topic
from capture.messages import typestore
from capture.session import Session
from capture.transaction import new_folder, writing_error

if TYPE_CHECKING:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import Writer as Writer2


def export_rosbag2(session: Session, target: Path) -> dict[str, int]:
    """Write the ROS 2 bag folder `target` (sqlite3, as Humble records); gives counts by topic.

    The session folder itself is a ROS 2 bag already (MCAP); this is for tools that want `.db3`.
    Raises `MissingStreamError` when the session has no log.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    log = _log(session)
    with new_folder(target) as partial:
        bag = partial / target.name
        with Writer(bag, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
            counts = {topic.name: _copy2(log, topic, writer) for topic in log.topics.values()}
        for file in bag.iterdir():
            file.rename(partial / file.name)
        bag.rmdir()
    return counts


def export_rosbag1(session: Session, target: Path) -> dict[str, int]:
    """Write the ROS 1 bag file `target`; gives counts by topic.

    Types that ROS 1 does not ship carry their definition in the bag.
    Raises `MissingStreamError` when the session has no log.
    """
    from rosbags.rosbag1 import Writer

    log = _log(session)
    with _new_file(target) as partial, Writer(partial) as writer:
        return {topic.name: _copy1(log, topic, writer) for topic in log.topics.values()}


def _copy2(log: McapLog, topic: Topic, writer: Writer2) -> int:
    connection = writer.add_connection(topic.name, topic.type_name, typestore=typestore())
    raw = log.read(topic.name)
    for log_t_ns, message in zip(raw.log_t_ns.tolist(), raw.messages, strict=True):
        writer.write(connection, log_t_ns, message)
    return len(raw.messages)


def _copy1(log: McapLog, topic: Topic, writer: Writer1) -> int:
    connection = writer.add_connection(topic.name, topic.type_name, typestore=typestore(ros=1))
    raw = log.read(topic.name)
    for log_t_ns, message in zip(raw.log_t_ns.tolist(), raw.messages, strict=True):
        # The ROS 2 definitions know where ROS 1 wants its `header.seq`.
        writer.write(connection, log_t_ns, typestore().cdr_to_ros1(message, topic.type_name))
    return len(raw.messages)


def _log(session: Session) -> McapLog:
    if session.log is None:
        raise MissingStreamError(
            f"{session.folder}: has no log, so there are no messages for a bag; "
            "export its paths with trackside export tum"
        )
    return session.log


@contextmanager
def _new_file(target: Path) -> Iterator[Path]:
    """A hidden path beside `target` that takes its name when the block ends well."""
    if target.exists():
        raise SessionError(
            f"{target} exists already and is not overwritten; give another name or move it away"
        )
    partial = target.with_name(f".{target.name}.partial-{os.getpid()}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        partial.rename(target)
    except BaseException as err:
        partial.unlink(missing_ok=True)
        if isinstance(err, OSError):
            raise writing_error(target, err) from err
        raise
