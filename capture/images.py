"""The pictures of a log, one at a time: a film does not fit into memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from capture.errors import LogError
from capture.log_reader import McapLog
from capture.messages import typestore
from capture.topics import IMAGE_TYPE


@dataclass(frozen=True, eq=False)
class LoggedImage:
    """A picture as the camera made it; t_ns : UTC of the middle of the exposure.

    sequence : its number in the log, from 0; format : "jpeg" and the like.
    """

    sequence: int
    t_ns: int
    format: str
    data: bytes


def logged_images(log: McapLog, topic: str) -> Iterator[LoggedImage]:
    """The pictures on a topic, in the order of the log; raises `LogError` for what are none."""
    held = log.topics.get(topic)
    if held is not None and held.type_name != IMAGE_TYPE:
        raise LogError(
            f"{log.file}: {topic} holds {held.type_name}, expected {IMAGE_TYPE}; film it again, or "
            "convert the topic"
        )
    store, sequence = typestore(), 0
    for logged in log.messages():
        if logged.topic != topic:
            continue
        message: Any = store.deserialize_cdr(logged.data, IMAGE_TYPE)
        stamp = message.header.stamp
        t_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        yield LoggedImage(sequence, t_ns, str(message.format), bytes(message.data))
        sequence += 1
