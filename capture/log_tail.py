"""A log while it is being written: what has come since it was last looked at.

The recorder appends whole chunks, one a second (`capture.log_writer`). What stands in the file up
to its last complete record is final and is read once; a record that is still being written is left
for the next look.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from capture.arrived import Arrived
from capture.errors import LogError
from capture.log_reader import MAGIC, MAX_RECORD_BYTES, RECORD, LogScan, RawMessages, unreadable

if TYPE_CHECKING:
    from mcap.records import McapRecord

_FOOTER_OP, _DATA_END_OP = 2, 15
_MOST_BYTES = 10_000_000
_KNOWN_OPS = range(1, _DATA_END_OP + 1)


class LogTail:
    """A growing MCAP file, read from where the last look ended. Never waits.

    ended : the file has got its end, nothing more will come.
    Raises `LogError`: unreadable, no MCAP file, replaced meanwhile, an encoding other than CDR.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.ended = False
        self._offset = 0
        self._scan = LogScan(file)

    @property
    def damaged_chunks(self) -> int:
        """Chunks that failed their checksum."""
        return self._scan.damaged_chunks

    @property
    def done_bytes(self) -> int:
        """How much of the file was read; a file that does not exist yet is an empty one."""
        return self._offset

    def read(self) -> Arrived:
        """What is new, at most some ten megabytes at once: read on while `done_bytes` grows."""
        found: dict[str, list[tuple[int, bytes]]] = {}
        try:
            with self.file.open("rb") as stream:
                for record in self._new_records(stream):
                    for topic, log_t_ns, _, content, start, stop in self._scan.messages_of(
                        record, None
                    ):
                        found.setdefault(topic, []).append((log_t_ns, content[start:stop]))
        except FileNotFoundError:
            return Arrived({})
        except OSError as err:
            raise unreadable(self.file, err) from err
        return Arrived({topic: _raw(topic, messages) for topic, messages in found.items()})

    def _new_records(self, stream: BinaryIO) -> Iterator[McapRecord]:
        """Complete records beyond the offset, which moves along."""
        size = stream.seek(0, 2)
        if size < self._offset:
            raise LogError(
                f"{self.file}: became shorter while it was followed, so it is another file now; "
                "start again"
            )
        if not self._offset and not self._begins(stream, size):
            return
        stream.seek(self._offset)
        enough = self._offset + _MOST_BYTES
        while not self.ended and size - self._offset >= RECORD.size and self._offset < enough:
            op, length = RECORD.unpack(stream.read(RECORD.size))
            end = self._offset + RECORD.size + length
            # A place without a record: room that the file system gave before its content came.
            if op not in _KNOWN_OPS or length > MAX_RECORD_BYTES or end > size:
                return
            body = stream.read(length)
            self._offset = end
            self.ended = op in (_FOOTER_OP, _DATA_END_OP)
            record = _record(op, body)
            if record is not None:
                yield record

    def _begins(self, stream: BinaryIO, size: int) -> bool:
        """Whether the file has its beginning already."""
        stream.seek(0)
        start = stream.read(len(MAGIC))
        if not MAGIC.startswith(start):
            raise LogError(f"{self.file}: is no MCAP file; expected the log that is being recorded")
        if size < len(MAGIC):
            return False
        self._offset = len(MAGIC)
        return True


def _record(op: int, body: bytes) -> McapRecord | None:
    """What a log's data section is made of; None for what carries no messages."""
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, Message, Schema

    stream = ReadDataStream(BytesIO(body))
    readers: dict[int, Callable[[], McapRecord]] = {
        Opcode.CHUNK: lambda: Chunk.read(stream),
        Opcode.CHANNEL: lambda: Channel.read(stream),
        Opcode.SCHEMA: lambda: Schema.read(stream),
        Opcode.MESSAGE: lambda: Message.read(stream, len(body)),
    }
    return readers[op]() if op in readers else None


def _raw(topic: str, messages: list[tuple[int, bytes]]) -> RawMessages:
    messages.sort(key=itemgetter(0))
    log_t_ns = np.array([t_ns for t_ns, _ in messages], dtype=np.int64)
    return RawMessages(topic, log_t_ns, [data for _, data in messages])
