"""From what a driver reads to what stands in the log: one translator for each kind of device."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeVar

from capture.clock import UtcLine
from capture.sensor_messages import raw_message
from capture.topics import RAW_TYPE
from drivers import Reading

Sample = TypeVar("Sample", contravariant=True)


@dataclass(frozen=True)
class LogMessage:
    """A message on its way into a log.

    arrival_ns : monotonic, when its last byte was here; stamp_ns : UTC, when it was measured.
    """

    topic: str
    type_name: str
    data: bytes
    arrival_ns: int
    stamp_ns: int


class Translator(Protocol[Sample]):
    """Turns the readings of one device into messages; keeps what that needs, such as its clock.

    log_name : the file they go to; topic : the one by which the device is judged.
    """

    log_name: str
    topic: str

    def messages(self, reading: Reading[Sample]) -> Iterator[LogMessage]:
        """The messages of one reading, the raw bytes first."""

    def state(self) -> Mapping[str, object]:
        """What a person may want to know of the stream now, such as the skew of its clock."""


def raw_messages(reading: Reading[object], topic: str, utc: UtcLine) -> Iterator[LogMessage]:
    """The bytes as they came, each chunk a message stamped with its arrival."""
    for chunk in reading.raw:
        data = raw_message(chunk.data)
        yield LogMessage(topic, RAW_TYPE, data, chunk.t_ns, utc.utc(chunk.t_ns))
