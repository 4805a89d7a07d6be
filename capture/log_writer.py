"""Writing a log: MCAP, profile ros2, CDR with ros2msg schemas, zstd chunks with checksums.

A log that is being written survives the loss of power up to the last `sync_period_s`: every flush
ends a chunk, and a file without its end is read by scanning (`capture.log_reader`).
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, BinaryIO

from capture.messages import definition
from capture.transaction import writing_error

if TYPE_CHECKING:
    from mcap.writer import Writer


@dataclass
class WrittenTopic:
    """What a log holds of one topic; times are log times in nanoseconds."""

    name: str
    type_name: str
    channel: int
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0


class LogWriter:
    """A new MCAP file; a context manager.

    `sync_period_s` : how often what was written is forced onto the disk (None: only at the end);
    `compressed` : False for images, which are compressed already.
    When the block ends with an error the file is left without its end, so that nobody takes it for
    a whole recording. Raises `LogError` naming file and free space when the disk takes no more.
    """

    def __init__(
        self,
        file: Path,
        *,
        sync_period_s: float | None = 1.0,
        compressed: bool = True,
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.file = file
        self.topics: dict[str, WrittenTopic] = {}
        self._schemas: dict[str, int] = {}
        self._sync_period_s, self._clock_s = sync_period_s, clock_s
        self._compressed = compressed
        self._synced_s = clock_s()
        self._stream: BinaryIO
        self._writer: Writer

    def __enter__(self) -> LogWriter:
        from mcap.writer import CompressionType, Writer

        try:
            # Not unbuffered: the mcap writer would wrap such a stream and never flush its wrapper.
            self._stream = self.file.open("wb")
            compression = CompressionType.ZSTD if self._compressed else CompressionType.NONE
            self._writer = Writer(self._stream, compression=compression)
            self._writer.start(profile="ros2", library=f"trackside {version('trackside')}")
        except OSError as err:
            raise writing_error(self.file, err) from err
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self._writer.finish()  # type: ignore[no-untyped-call]  # mcap types it not
                self._stream.flush()
                os.fsync(self._stream.fileno())
                self._stream.close()
        except OSError as err:
            raise writing_error(self.file, err) from err
        finally:
            with contextlib.suppress(OSError):
                self._stream.close()

    def write(
        self, topic: str, type_name: str, message: bytes, *, log_t_ns: int, stamp_ns: int
    ) -> None:
        """Append a CDR message that arrived at `log_t_ns` and tells of `stamp_ns`."""
        try:
            written = self.topics.get(topic) or self._add_topic(topic, type_name, log_t_ns)
            self._writer.add_message(
                written.channel, log_t_ns, message, publish_time=stamp_ns, sequence=written.count
            )
            written.count += 1
            written.first_ns = min(written.first_ns, log_t_ns)
            written.last_ns = max(written.last_ns, log_t_ns)
            self._sync_when_due()
        except OSError as err:
            raise writing_error(self.file, err) from err

    def sync(self) -> None:
        """Force what was written onto the disk, if that is due; for times when nothing comes."""
        try:
            self._sync_when_due()
        except OSError as err:
            raise writing_error(self.file, err) from err

    def _add_topic(self, topic: str, type_name: str, log_t_ns: int) -> WrittenTopic:
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.register_schema(
                type_name, "ros2msg", definition(type_name).encode()
            )
        channel = self._writer.register_channel(topic, "cdr", self._schemas[type_name])
        written = WrittenTopic(topic, type_name, channel, 0, log_t_ns, log_t_ns)
        self.topics[topic] = written
        return written

    def _sync_when_due(self) -> None:
        now_s = self._clock_s()
        if self._sync_period_s is not None and now_s - self._synced_s >= self._sync_period_s:
            self._synced_s = now_s
            self._writer.flush()  # type: ignore[no-untyped-call]  # mcap types it not
            os.fdatasync(self._stream.fileno())
