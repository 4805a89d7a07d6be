"""Logs of others: ROS 1 bags, ROS 2 folders, `.db3` and `.mcap` files, all as CDR messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from capture.errors import LogError
from capture.log_reader import McapLog, RawMessages
from capture.messages import typestore
from geometry import Stamps

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys.store import Typestore


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag, as the bag itself lists it."""

    name: str
    type_name: str
    count: int


class Bag(Protocol):
    """What an import needs of a log."""

    @property
    def bag_topics(self) -> tuple[BagTopic, ...]:
        """All topics, sorted by name."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is wrong with the file, although it can be read."""

    def read(self, topic: str) -> RawMessages:
        """All messages of a topic as CDR."""

    def decoded(self, topic: str, type_name: str) -> tuple[Stamps, list[object]]:
        """Log times and messages of a topic, by the definition that the bag carries."""


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """The bag at `path`; raises `LogError` when it cannot be read."""
    if path.suffix == ".mcap":
        yield _McapBag(path)
        return
    reader = _opened(path)
    try:
        yield _RosBag(path, reader)
    finally:
        reader.close()


class _McapBag:
    """An `.mcap` file; it may have lost its end."""

    def __init__(self, path: Path) -> None:
        self._log = McapLog(path)
        self.bag_topics = tuple(
            BagTopic(topic.name, topic.type_name, topic.count)
            for topic in self._log.topics.values()
        )
        self.remarks = self._log.remarks

    def read(self, topic: str) -> RawMessages:
        return self._log.read(topic)

    def decoded(self, topic: str, type_name: str) -> tuple[Stamps, list[object]]:
        store = _store_of(type_name, self._log.topics[topic].schema)
        raw = self.read(topic)
        return raw.log_t_ns, [store.deserialize_cdr(data, type_name) for data in raw.messages]


class _RosBag:
    """Whatever rosbags' AnyReader opens."""

    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path, reader: AnyReader) -> None:
        self._path, self._reader = path, reader
        self.bag_topics = tuple(
            BagTopic(name, info.msgtype or "several types", info.msgcount)
            for name, info in sorted(reader.topics.items())
        )

    def read(self, topic: str) -> RawMessages:
        raw = self._raw(topic)
        messages = raw.messages
        if not self._reader.is2:
            # The ROS 2 definitions know how to skip what only ROS 1 has (`header.seq`).
            (type_name,) = {t.type_name for t in self.bag_topics if t.name == topic}
            messages = [bytes(typestore().ros1_to_cdr(data, type_name)) for data in messages]
        return RawMessages(topic, raw.log_t_ns, messages)

    def decoded(self, topic: str, type_name: str) -> tuple[Stamps, list[object]]:
        raw = self._raw(topic)
        return raw.log_t_ns, [self._reader.deserialize(d, type_name) for d in raw.messages]

    def _raw(self, topic: str) -> RawMessages:
        """The bytes as the bag holds them, ROS 1 or CDR."""
        connections = [c for c in self._reader.connections if c.topic == topic]
        try:
            found = [(t_ns, bytes(data)) for _, t_ns, data in self._reader.messages(connections)]
        except Exception as err:  # rosbags, zstd, lz4 and sqlite each raise their own
            raise _unreadable(self._path, err) from err
        log_t_ns = np.array([t_ns for t_ns, _ in found], dtype=np.int64)
        return RawMessages(topic, log_t_ns, [data for _, data in found])


def _opened(path: Path) -> AnyReader:
    from rosbags.highlevel import AnyReader

    if not path.exists():
        raise LogError(f"{path}: there is no such file or folder; check the path")
    logs = sorted(path.glob("*.mcap")) if path.is_dir() else []
    if logs and not (path / "metadata.yaml").exists():
        raise LogError(
            f"{path}: has no metadata.yaml, the recording was probably cut off; "
            f"give the log itself: {logs[0]}"
        )
    for log in logs:
        # A channel of another encoding makes rosbags fail with a bare KeyError; this names it.
        _ = McapLog(log).topics
    try:
        reader = AnyReader([path], default_typestore=typestore())
        reader.open()
    except Exception as err:  # rosbags, yaml, sqlite and the file system each raise their own
        raise _unreadable(path, err) from err
    return reader


def _store_of(type_name: str, definition: str) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, type_name))
    return store


def _unreadable(path: Path, err: Exception) -> LogError:
    return LogError(
        f"{path}: cannot be read as a bag: {err or type(err).__name__}; expected a ROS 1 .bag, "
        "a ROS 2 folder, .db3 or .mcap; an unfinished ROS 1 bag needs rosbag reindex first"
    )
