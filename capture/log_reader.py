"""Reading our own logs: MCAP with CDR messages, whole or cut off by a power loss.

The file is read from its front, chunk by chunk, so its missing end costs nothing. (Logs of others
come in through `capture.bag_reader`.)
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from capture.errors import LogError
from geometry import Stamps

if TYPE_CHECKING:
    from mcap.records import Channel, Chunk, McapRecord, Schema

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")
# Signed times: what does not fit into int64 comes from damage, and must not stop numpy.
_MESSAGE = struct.Struct("<HIqq")
_MAX_NS = 2**63 - 1
_SCHEMA_OP, _CHANNEL_OP, _MESSAGE_OP = 3, 4, 5
MAX_RECORD_BYTES = 1 << 30


@dataclass(frozen=True)
class Topic:
    """What a log holds of one topic; `schema` is its definition, times are log times."""

    name: str
    type_name: str
    schema: str
    count: int
    first_ns: int
    last_ns: int

    @property
    def rate_hz(self) -> float:
        """Messages per second over the whole time of the topic; 0 for a single message."""
        span_ns = self.last_ns - self.first_ns
        return (self.count - 1) * 1e9 / span_ns if span_ns > 0 else 0.0


@dataclass(frozen=True, eq=False)
class RawMessages:
    """The messages of one topic in order of log time: log_t_ns (n,), and n CDR messages."""

    topic: str
    log_t_ns: Stamps
    messages: list[bytes]


class LoggedMessage(NamedTuple):
    """One message as a log holds it: when it arrived, when it was measured (publish time), CDR."""

    topic: str
    log_t_ns: int
    stamp_ns: int
    data: bytes


class McapLog:
    """An MCAP file of CDR messages.

    truncated : it has no end, because the power or the program went while it was written;
    damaged_chunks : chunks that failed their checksum and were skipped; lost_rest : damage made
    the rest of the file unreadable (both known once `topics` is).
    Raises `LogError`: no MCAP file, unreadable, nothing in it, or an encoding other than CDR.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.truncated = not _has_end(file)
        self.damaged_chunks = 0
        self.lost_rest = False

    @cached_property
    def topics(self) -> dict[str, Topic]:
        """Every topic by name, sorted."""
        scan = LogScan(self.file)
        times: dict[str, list[int]] = {}
        for topic, log_t_ns, *_ in scan.messages(None):
            times.setdefault(topic, []).append(log_t_ns)
        self.damaged_chunks = scan.damaged_chunks
        self.lost_rest = not scan.reached_end and not self.truncated
        if not scan.channels and self.truncated:
            raise LogError(
                f"{self.file}: holds no readable message and has no end; expected an MCAP log; "
                "the recording stopped before its first second was written, it is lost"
            )
        found = {}
        for channel in sorted(scan.channels.values(), key=lambda channel: channel.topic):
            schema = scan.schemas[channel.schema_id]
            seen = times.get(channel.topic, [])
            first, last = (min(seen), max(seen)) if seen else (0, 0)
            found[channel.topic] = Topic(
                channel.topic,
                schema.name,
                schema.data.decode(errors="replace"),
                len(seen),
                first,
                last,
            )
        return found

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know about the state of the file."""
        remarks = []
        if self.truncated:
            remarks.append(
                f"{self.file.name} has no end (power loss or kill): read up to its last whole chunk"
            )
        if self.topics and self.lost_rest:
            remarks.append(f"{self.file.name} is damaged: what follows the damage is lost")
        if self.damaged_chunks:
            remarks.append(
                f"{self.file.name}: {self.damaged_chunks} damaged chunks failed their checksum "
                "and were left out"
            )
        return tuple(remarks)

    def read(self, topic: str) -> RawMessages:
        """All messages of a topic; none if the log does not know it."""
        found = [
            (log_t_ns, content[start:stop])
            for _, log_t_ns, _, content, start, stop in LogScan(self.file).messages({topic})
        ]
        found.sort(key=itemgetter(0))
        log_t_ns = np.array([t_ns for t_ns, _ in found], dtype=np.int64)
        return RawMessages(topic, log_t_ns, [data for _, data in found])

    def messages(self) -> Iterator[LoggedMessage]:
        """Every message of every topic in the order of the file, one at a time."""
        scan = LogScan(self.file)
        for topic, log_t_ns, stamp_ns, content, start, stop in scan.messages(None):
            yield LoggedMessage(topic, log_t_ns, stamp_ns, content[start:stop])


# Topic, log time, stamp, and a message where it lies: `content[start:stop]` is its CDR. A plain
# tuple, as sixty thousand of anything dearer would cost more than their decompression.
Found = tuple[str, int, int, bytes, int, int]


class LogScan:
    """One pass through a file; what it met on the way stays in its attributes.

    Raises `LogError` where a channel is encoded otherwise than as CDR.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.damaged_chunks = 0
        self.reached_end = False

    def messages(self, topics: Collection[str] | None) -> Iterator[Found]:
        """The messages of `topics` (None: all) in the order of the file."""
        before = 0
        for record in self._records():
            before = self.damaged_chunks
            yield from self.messages_of(record, topics)
        # The chunk that was being written when the power went is cut off, not damaged.
        self.damaged_chunks = before

    def messages_of(self, record: McapRecord, topics: Collection[str] | None) -> Iterator[Found]:
        """The messages of `topics` (None: all) in one record; channels and schemas are noted."""
        from mcap.exceptions import McapError
        from mcap.records import Channel, Chunk, Footer, Message, Schema

        if isinstance(record, Chunk):
            try:
                yield from self._chunk_messages(_content(record), topics)
            except (McapError, struct.error, ValueError):
                self.damaged_chunks += 1
        elif isinstance(record, Footer):
            self.reached_end = True
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self._note_channel(record)
        elif isinstance(record, Message):
            topic = self._wanted(topics).get(record.channel_id)
            if topic is not None:
                log_t_ns = min(record.log_time, _MAX_NS)
                stamp_ns = min(record.publish_time, _MAX_NS)
                yield topic, log_t_ns, stamp_ns, record.data, 0, len(record.data)

    def _records(self) -> Iterator[McapRecord]:
        """Top-level records up to the end of the file, or to where it stops making sense."""
        from mcap.exceptions import McapError
        from mcap.stream_reader import StreamReader

        try:
            with self.file.open("rb") as stream:
                reader = StreamReader(stream, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES)
                yield from reader.records
        except (McapError, struct.error, ValueError, OverflowError, MemoryError):
            return  # a length that is none: the end of what can be read
        except OSError as err:
            raise unreadable(self.file, err) from err

    def _chunk_messages(self, content: bytes, topics: Collection[str] | None) -> Iterator[Found]:
        from mcap.data_stream import ReadDataStream
        from mcap.records import Channel, Schema

        at, end = 0, len(content)
        wanted = self._wanted(topics)
        while at < end:
            op, length = RECORD.unpack_from(content, at)
            at += RECORD.size
            if op == _MESSAGE_OP:
                channel, _, log_t_ns, stamp_ns = _MESSAGE.unpack_from(content, at)
                if channel in wanted:
                    start, stop = at + _MESSAGE.size, at + length
                    yield wanted[channel], log_t_ns, stamp_ns, content, start, stop
            elif op in (_SCHEMA_OP, _CHANNEL_OP):
                body = ReadDataStream(BytesIO(content[at : at + length]))
                if op == _SCHEMA_OP:
                    schema = Schema.read(body)
                    self.schemas[schema.id] = schema
                else:
                    self._note_channel(Channel.read(body))
                wanted = self._wanted(topics)
            at += length

    def _wanted(self, topics: Collection[str] | None) -> dict[int, str]:
        return {
            number: channel.topic
            for number, channel in self.channels.items()
            if topics is None or channel.topic in topics
        }

    def _note_channel(self, channel: Channel) -> None:
        self.channels[channel.id] = channel
        schema = self.schemas.get(channel.schema_id)
        encoding = schema.encoding if schema else "no schema"
        if channel.message_encoding != "cdr" or encoding not in ("ros2msg", "ros2idl"):
            raise LogError(
                f"{self.file}: channel {channel.topic} is encoded as {channel.message_encoding} "
                f"with schema {encoding}; expected cdr with ros2msg; convert that channel or "
                "filter it out of the file (mcap filter --exclude-topic-regex)"
            )


class _DamagedChunkError(ValueError):
    """A chunk that is cut off or fails its checksum."""


def _content(chunk: Chunk) -> bytes:
    """What a chunk holds; raises `_DamagedChunkError`."""
    from mcap.stream_reader import get_chunk_data_stream

    try:
        stream, _ = get_chunk_data_stream(chunk)
        content = stream.read(chunk.uncompressed_size)
    except Exception as err:  # zstandard, lz4 and mcap raise unrelated types here
        raise _DamagedChunkError from err
    right = not chunk.uncompressed_crc or zlib.crc32(content) == chunk.uncompressed_crc
    if not right or len(content) != chunk.uncompressed_size:
        raise _DamagedChunkError
    return content


def _has_end(file: Path) -> bool:
    """Whether the file ends as an MCAP file should; raises `LogError` when it does not begin so."""
    try:
        with file.open("rb") as stream:
            start = stream.read(len(MAGIC))
            size = stream.seek(0, 2)
            stream.seek(max(0, size - len(MAGIC)))
            end = stream.read()
    except OSError as err:
        raise unreadable(file, err) from err
    if start != MAGIC:
        what = "is empty" if not size else "is no MCAP file"
        raise LogError(f"{file}: {what}; expected an MCAP log; restore it from the car or a copy")
    return end == MAGIC and size > len(MAGIC)


def unreadable(file: Path, err: OSError) -> LogError:
    """The error that says which log cannot be read, and why."""
    return LogError(f"{file}: cannot be read: {err.strerror or err}; check owner, mode and disk")
