"""Making a session: everything goes into a hidden folder that takes its name at the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.errors import SessionError
from capture.estimate import Estimate, GroundTruth
from capture.log_reader import McapLog
from capture.log_writer import LogWriter, WrittenTopic
from capture.messages import observation_messages, odometry_messages
from capture.number_rows import read_text
from capture.result_files import write_estimate, write_ground_truth
from capture.session_info import SessionInfo, write_session_info
from capture.streams import Observations, Odometry
from capture.topics import (
    LOG_NAME,
    ODOMETRY_TYPE,
    RANGE_BEARING_TOPIC,
    RANGE_BEARING_TYPE,
    odometry_topic,
)
from capture.transaction import new_folder, write_text
from capture.yaml_file import write_yaml
from geometry import Stamps

ROSBAG2_VERSION = 8


@contextmanager
def new_session(folder: Path, info: SessionInfo) -> Iterator[SessionWriter]:
    """A writer for the session `folder`, which appears when the block ends well, and only then.

    Raises `SessionError` when the folder exists, `LogError` when the disk does not take it.
    """
    with new_folder(folder) as partial:
        writer = SessionWriter(partial)
        yield writer
        writer.write_log()
        write_session_info(partial, info)


@dataclass(frozen=True, eq=False)
class _Batch:
    """Messages of one topic, waiting to be merged with the others by log time."""

    topic: str
    type_name: str
    log_t_ns: Stamps
    stamps_ns: Stamps
    messages: Sequence[bytes]


class SessionWriter:
    """Takes what shall be in a session; `new_session` gives one."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._batches: list[_Batch] = []

    def add_messages(
        self,
        topic: str,
        type_name: str,
        messages: Sequence[bytes],
        log_t_ns: Stamps,
        stamps_ns: Stamps | None = None,
    ) -> None:
        """CDR messages with log times (n,) and, if they differ, stamps (n,) of measurement."""
        stamps = log_t_ns if stamps_ns is None else stamps_ns
        self._batches.append(_Batch(topic, type_name, log_t_ns, stamps, messages))

    def add_odometry(self, odometry: Odometry) -> None:
        """Put a source's odometry on its topic; log times are its stamps."""
        topic = odometry_topic(odometry.source)
        self.add_messages(topic, ODOMETRY_TYPE, odometry_messages(odometry), odometry.t_ns)

    def add_observations(self, observations: Observations) -> None:
        """Put range-bearing observations on their topic, one message per stamp."""
        t_ns, messages = observation_messages(observations)
        self.add_messages(RANGE_BEARING_TOPIC, RANGE_BEARING_TYPE, messages, t_ns)

    def add_ground_truth(self, truth: GroundTruth) -> None:
        """Write the truth."""
        write_ground_truth(self._folder / "ground_truth", truth)

    def add_estimate(self, estimate: Estimate) -> None:
        """Write an estimate under its name."""
        write_estimate(self._folder / "estimates" / estimate.name, estimate)

    def copy_calibration(self, file: Path) -> None:
        """Keep a copy of a calibration in force."""
        copy_calibration(self._folder, file)

    def write_log(self) -> None:
        """Write all messages in order of log time, and what ROS tools want to know of them."""
        batches = [batch for batch in self._batches if len(batch.messages)]
        if not batches:
            return
        which = np.concatenate([np.full(b.log_t_ns.size, k) for k, b in enumerate(batches)])
        row = np.concatenate([np.arange(b.log_t_ns.size) for b in batches])
        order = np.argsort(np.concatenate([b.log_t_ns for b in batches]), kind="stable")
        times = [(b.log_t_ns.tolist(), b.stamps_ns.tolist()) for b in batches]
        with LogWriter(self._folder / LOG_NAME, sync_period_s=None) as log:
            for k, at in zip(which[order].tolist(), row[order].tolist(), strict=True):
                batch, (log_t_ns, stamps_ns) = batches[k], times[k]
                log.write(
                    batch.topic,
                    batch.type_name,
                    batch.messages[at],
                    log_t_ns=log_t_ns[at],
                    stamp_ns=stamps_ns[at],
                )
        write_rosbag_metadata(self._folder, {LOG_NAME: list(log.topics.values())})


def copy_calibration(session: Path, file: Path) -> None:
    """Copy a calibration into a session; raises `SessionError` if one of that name is there."""
    target = session / "calibration" / file.name
    if target.exists():
        raise SessionError(
            f"{target} exists already and nothing in a session is ever overwritten; "
            "give the calibration file another name"
        )
    text = read_text(file)
    target.parent.mkdir(exist_ok=True)
    write_text(target, text)


def write_rosbag_metadata(folder: Path, logs: Mapping[str, Sequence[WrittenTopic]]) -> None:
    """`metadata.yaml` (rosbag2 version 8), by which ROS tools and rosbags open the folder.

    logs : what each file of the folder holds; empty ones are left out.
    """
    logs = {name: topics for name, topics in logs.items() if topics}
    listed = [
        {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.type_name,
                "serialization_format": "cdr",
                "offered_qos_profiles": "",
                "type_description_hash": "",
            },
            "message_count": topic.count,
        }
        for topics in logs.values()
        for topic in topics
    ]
    bag = {
        "version": ROSBAG2_VERSION,
        "storage_identifier": "mcap",
        "relative_file_paths": list(logs),
        **_extent([topic for topics in logs.values() for topic in topics]),
        "topics_with_message_count": listed,
        "compression_format": "",
        "compression_mode": "",
        "files": [{"path": name, **_extent(topics)} for name, topics in logs.items()],
        "custom_data": None,
        "ros_distro": "humble",
    }
    write_yaml(folder / "metadata.yaml", {"rosbag2_bagfile_information": bag})


def written_topics(log: McapLog) -> list[WrittenTopic]:
    """What a log holds, as `write_rosbag_metadata` takes it."""
    return [
        WrittenTopic(topic.name, topic.type_name, 0, topic.count, topic.first_ns, topic.last_ns)
        for topic in log.topics.values()
        if topic.count
    ]


def _extent(topics: Sequence[WrittenTopic]) -> dict[str, object]:
    first = min(topic.first_ns for topic in topics)
    return {
        "starting_time": {"nanoseconds_since_epoch": first},
        "duration": {"nanoseconds": max(topic.last_ns for topic in topics) - first},
        "message_count": sum(topic.count for topic in topics),
    }
