"""Which topic of a bag becomes which stream of a session."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from capture.bag_reader import BagTopic
from capture.topics import (
    DRIVE_TOPIC,
    DRIVE_TYPE,
    IMU_TOPIC,
    IMU_TYPE,
    ODOMETRY_TYPE,
    POINTS_TOPIC,
    POINTS_TYPE,
    POSE_TYPE,
    RANGE_BEARING_TOPIC,
    RANGE_BEARING_TYPE,
    SCAN_TOPIC,
    SCAN_TYPE,
    VESC_STATE_TOPIC,
    VESC_STATE_TYPE,
    odometry_source,
    odometry_topic,
)
from dialogue import UsageError, nearest_names

TRUTH = "truth"
NONE = "none"

# Role: the type of its topic, and where it goes.
_SINGLE = {
    "scan": (SCAN_TYPE, SCAN_TOPIC),
    "points": (POINTS_TYPE, POINTS_TOPIC),
    "imu": (IMU_TYPE, IMU_TOPIC),
    "vesc_state": (VESC_STATE_TYPE, VESC_STATE_TOPIC),
    "drive": (DRIVE_TYPE, DRIVE_TOPIC),
    "observations": (RANGE_BEARING_TYPE, RANGE_BEARING_TOPIC),
}
_TRUTH_TYPES = (POSE_TYPE, ODOMETRY_TYPE)
_TRUTH_NAME = re.compile(r"ground_?truth|vicon|mocap|optitrack", re.IGNORECASE)
_SOURCE_NAMES = {"vesc": "vesc", "zed": "zed", "viso": "viso", "stereo_odometer": "viso"}


@dataclass(frozen=True)
class Role:
    """What a topic is taken for; `target` is its name in the session, empty for truth."""

    name: str
    topic: BagTopic
    target: str


def assigned_roles(topics: Sequence[BagTopic], wishes: Mapping[str, str]) -> tuple[Role, ...]:
    """Roles by message type and name; `wishes` (role: topic, or "none") go before.

    Raises `UsageError` when a role has several candidates or a wish cannot be met.
    """
    known = {topic.name: topic for topic in topics}
    for role, name in wishes.items():
        if name != NONE and name not in known:
            raise UsageError(f"--topic {role}={name}: no such topic; {nearest_names(name, known)}")
    wished = [_wished(role, known[name]) for role, name in wishes.items() if name != NONE]
    taken = {role.topic.name for role in wished}
    roles = list(wished)
    for topic in topics:
        guess = None if topic.name in taken or not topic.count else _guessed(topic)
        if guess is not None and guess.name not in wishes:
            roles.append(guess)
    _refuse_ambiguity(roles)
    return tuple(roles)


def _wished(role: str, topic: BagTopic) -> Role:
    """The role that a person gave a topic; every name that is no other role is an odometry's."""
    types: tuple[str, ...]
    if role == TRUTH:
        types, target = _TRUTH_TYPES, ""
    elif role in _SINGLE:
        types, target = (_SINGLE[role][0],), _SINGLE[role][1]
    else:
        types, target = (ODOMETRY_TYPE,), odometry_topic(role)
    if topic.type_name not in types:
        roles = ", ".join([*_SINGLE, TRUTH])
        raise UsageError(
            f"--topic {role}={topic.name}: the topic is {topic.type_name}, expected "
            f"{' or '.join(types)}; roles: {roles}, or the name of an odometry source"
        )
    return Role(role, topic, target)


def _guessed(topic: BagTopic) -> Role | None:
    if topic.type_name in _TRUTH_TYPES and _TRUTH_NAME.search(topic.name):
        return Role(TRUTH, topic, "")
    for role, (type_name, target) in _SINGLE.items():
        # Clouds there are of every kind and layout; ours stands on its own topic.
        if topic.type_name == type_name and (role != "points" or topic.name == target):
            return Role(role, topic, target)
    if topic.type_name == ODOMETRY_TYPE:
        source = _source(topic.name)
        return Role(source, topic, odometry_topic(source))
    return None


def _source(topic: str) -> str:
    """The name of an odometry source, from the name of its topic."""
    for part, source in _SOURCE_NAMES.items():
        if part in topic.lower():
            return source
    plain = odometry_source(topic) or topic.strip("/")
    return re.sub(r"[^A-Za-z0-9_]+", "_", plain)


def _refuse_ambiguity(roles: Sequence[Role]) -> None:
    by_name: dict[str, list[str]] = {}
    for role in roles:
        by_name.setdefault(role.name, []).append(role.topic.name)
    faults = [
        f"{len(names)} topics could be {name}: {', '.join(names)}; choose one with "
        f"--topic {name}={names[0]} (or {name}={NONE})"
        for name, names in by_name.items()
        if len(names) > 1
    ]
    if faults:
        raise UsageError("\n".join(faults))
