"""Bags of others -> sessions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from capture.bag_reader import Bag, BagTopic, open_bag
from capture.bag_roles import TRUTH, Role, assigned_roles
from capture.cdr import HEADER, Fields, blocks
from capture.errors import LogError
from capture.estimate import GroundTruth
from capture.log_reader import RawMessages
from capture.messages import vesc_state_message
from capture.session import Session
from capture.session_info import SessionInfo
from capture.stamps import NS_PER_S
from capture.topics import ODOMETRY_TYPE, VESC_STATE_TYPE
from capture.tum import leaves_plane
from geometry import SpacePath, Stamps, TrajectoryError

_POSE: Fields = (*HEADER, ("position", "3f8"), ("orientation", "4f8"))
_POSE_IN_ODOMETRY: Fields = (
    *HEADER,
    ("child_frame_id", "string"),
    ("position", "3f8"),
    ("orientation", "4f8"),
)


@dataclass(frozen=True)
class ImportedTopic:
    """A topic that was taken, with its rate by log time."""

    role: str
    topic: str
    target: str
    count: int
    rate_hz: float


@dataclass(frozen=True)
class BagImport:
    """What an import took, and what it left out."""

    taken: tuple[ImportedTopic, ...]
    left_out: tuple[BagTopic, ...]
    remarks: tuple[str, ...]


def import_bag(path: Path, target: Path, topics: Mapping[str, str]) -> BagImport:
    """Make the session `target` of a bag; `topics` gives the topic of a role where it is not clear.

    Raises `UsageError` when a role is ambiguous, `LogError` when the bag cannot be read or holds
    nothing that we know, `SessionError` when the target exists.
    """
    with open_bag(path) as bag:
        roles = assigned_roles(bag.bag_topics, topics)
        if not roles:
            has = ", ".join(f"{t.name} ({t.type_name})" for t in bag.bag_topics) or "nothing"
            raise LogError(
                f"{path}: holds no stream that trackside knows; expected a LaserScan, Odometry, "
                f"Imu, VescStateStamped or AckermannDriveStamped; it has: {has}"
            )
        streams = [(role, _read(bag, role)) for role in roles]
        names = {role.topic.name for role in roles}
        left_out = tuple(topic for topic in bag.bag_topics if topic.name not in names)
        report = BagImport(tuple(_report(*stream) for stream in streams), left_out, bag.remarks)
    info = _info(path, min(int(raw.log_t_ns.min()) for _, raw in streams), report)
    with Session.create(target, info) as session:
        for role, raw in streams:
            if role.name == TRUTH:
                session.add_ground_truth(_truth(role, raw, path))
            else:
                stamps = _stamps(raw)
                session.add_messages(
                    role.target, role.topic.type_name, raw.messages, raw.log_t_ns, stamps
                )
    return report


def _read(bag: Bag, role: Role) -> RawMessages:
    """The messages of a role as the types of our logs define them."""
    name = role.topic.name
    if role.topic.type_name != VESC_STATE_TYPE:
        return bag.read(name)
    log_t_ns, messages = bag.decoded(name, VESC_STATE_TYPE)
    return RawMessages(name, log_t_ns, [vesc_state_message(message) for message in messages])


def _stamps(raw: RawMessages) -> Stamps:
    """Header stamps (n,) of messages; the log time where a sender left them empty."""
    parts = list(blocks(raw.messages, HEADER[:2]))
    seconds, nanoseconds = (
        np.concatenate([block[name] for block in parts]).astype(np.int64)
        for name in ("sec", "nanosec")
    )
    stamps = seconds * NS_PER_S + nanoseconds
    return np.where(stamps == 0, raw.log_t_ns, stamps)


def _truth(role: Role, raw: RawMessages, path: Path) -> GroundTruth:
    """Poses as truth, in order of their stamps, the first of equal ones, only finite ones."""
    fields = _POSE_IN_ODOMETRY if role.topic.type_name == ODOMETRY_TYPE else _POSE
    parts = list(blocks(raw.messages, fields))
    position, orientation = (
        np.concatenate([block[name] for block in parts]) for name in ("position", "orientation")
    )
    finite = np.flatnonzero(np.isfinite(np.hstack([position, orientation])).all(axis=1))
    t_ns, first = np.unique(_stamps(raw)[finite], return_index=True)
    kept = finite[first]
    try:
        space = SpacePath(t_ns, position[kept], orientation[kept])
        fault = leaves_plane(space)
    except TrajectoryError as err:
        fault = str(err)
    if fault:
        raise LogError(
            f"{path}: {role.topic.name}: {fault}; leave it out with --topic {TRUTH}=none"
        )
    origin = {"kind": "bag", "file": path.name, "topic": role.topic.name}
    dropped = {"not_finite": raw.log_t_ns.size - finite.size, "repeated": finite.size - kept.size}
    return GroundTruth(space.planar(), None, {**origin, "dropped": dropped})


def _report(role: Role, raw: RawMessages) -> ImportedTopic:
    span_ns = int(np.ptp(raw.log_t_ns))
    rate_hz = (raw.log_t_ns.size - 1) * 1e9 / span_ns if span_ns else 0.0
    target = role.target or "ground_truth/car.tum"
    return ImportedTopic(role.name, role.topic.name, target, raw.log_t_ns.size, rate_hz)


def _info(path: Path, start_ns: int, report: BagImport) -> SessionInfo:
    return SessionInfo(
        start_utc=datetime.fromtimestamp(start_ns // NS_PER_S, timezone.utc).isoformat(),
        origin={
            "kind": "bag",
            "file": path.resolve().name,
            "topics": {topic.target: topic.topic for topic in report.taken},
            "left_out": {topic.name: topic.count for topic in report.left_out},
            "remarks": report.remarks,
        },
    )
