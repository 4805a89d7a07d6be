"""Some messages of a log as the streams they belong to: what `capture.log_tail` hands over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from capture.log_columns import (
    drive_columns,
    imu_columns,
    observation_columns,
    scan_columns,
    told_odometry,
    vesc_state_columns,
)
from capture.log_reader import RawMessages
from capture.point_cloud import point_cloud_columns
from capture.streams import Drive, Imu, Observations, Odometry, Scans, VescState
from capture.topics import (
    DRIVE_TOPIC,
    IMU_TOPIC,
    ODOMETRY_SUFFIX,
    POINTS_TOPIC,
    RANGE_BEARING_TOPIC,
    SCAN_TOPIC,
    VESC_STATE_TOPIC,
    odometry_source,
    odometry_topic,
)

_Stream = TypeVar("_Stream")


@dataclass(frozen=True, eq=False)
class Arrived:
    """The messages that a log got between two looks at it, decoded when they are asked for.

    Streams are None, or empty, where nothing of them came. Raises `LogError` for messages that are
    not what their topic holds.
    """

    raw: Mapping[str, RawMessages]

    def __bool__(self) -> bool:
        return bool(self.raw)

    @property
    def log_t_ns(self) -> int:
        """The latest log time; 0 where nothing came."""
        return max((int(raw.log_t_ns[-1]) for raw in self.raw.values()), default=0)

    @property
    def first_log_t_ns(self) -> int:
        """The earliest log time; 0 where nothing came."""
        return min((int(raw.log_t_ns[0]) for raw in self.raw.values()), default=0)

    @property
    def topics(self) -> tuple[str, ...]:
        """Whose messages these are."""
        return tuple(self.raw)

    @property
    def odometry_sources(self) -> tuple[str, ...]:
        """Names of the odometry streams."""
        return tuple(odometry_source(t) for t in self.raw if t.endswith(ODOMETRY_SUFFIX))

    def odometry(self, source: str) -> Odometry | None:
        """The samples of a source as it told them; `GrowingOdometry` completes them."""
        return self._stream(odometry_topic(source), lambda raw: told_odometry(raw, source))

    def imu(self) -> Imu | None:
        """Angular velocity and acceleration."""
        return self._stream(IMU_TOPIC, imu_columns)

    def vesc_state(self) -> VescState | None:
        """Telemetry of the motor controller."""
        return self._stream(VESC_STATE_TOPIC, vesc_state_columns)

    def drive(self) -> Drive | None:
        """What the car was told to do."""
        return self._stream(DRIVE_TOPIC, drive_columns)

    def points(self) -> list[tuple[int, Scans]]:
        """Lidar revolutions of `/lidar/points`, one by one with their log times."""
        return self._one_by_one(POINTS_TOPIC, point_cloud_columns)

    def scans(self) -> list[tuple[int, Scans]]:
        """Lidar revolutions of `/scan`, one by one with their log times."""
        return self._one_by_one(SCAN_TOPIC, scan_columns)

    def observations(self) -> list[tuple[int, Observations]]:
        """Observations of landmarks that the data set brought along, scan by scan."""
        return self._one_by_one(RANGE_BEARING_TOPIC, observation_columns)

    def _stream(self, topic: str, decode: Callable[[RawMessages], _Stream]) -> _Stream | None:
        return decode(self.raw[topic]) if topic in self.raw else None

    def _one_by_one(
        self, topic: str, decode: Callable[[RawMessages], _Stream]
    ) -> list[tuple[int, _Stream]]:
        raw = self.raw.get(topic)
        if raw is None:
            return []
        return [
            (int(t_ns), decode(RawMessages(topic, raw.log_t_ns[row : row + 1], [message])))
            for row, (t_ns, message) in enumerate(zip(raw.log_t_ns, raw.messages, strict=True))
        ]
