"""A session: one run of the car as a folder, read stream by stream when it is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from capture.errors import MissingStreamError
from capture.estimate import Estimate, GroundTruth
from capture.result_files import (
    checked_name,
    read_estimate,
    read_ground_truth,
    write_estimate,
    write_ground_truth,
)
from capture.session_info import SessionInfo, read_session_info
from capture.streams import (
    Drive,
    Imu,
    MagneticField,
    Observations,
    Odometry,
    Scans,
    UncertainOdometry,
    VescState,
)
from capture.topics import (
    DRIVE_TOPIC,
    IMAGE_LOGS,
    IMU_TOPIC,
    LOG_NAME,
    MAGNETIC_FIELD_TOPIC,
    ODOMETRY_SUFFIX,
    ODOMETRY_TYPE,
    OVERHEAD_LOG_NAME,
    OVERHEAD_TOPIC,
    POINTS_TOPIC,
    RANGE_BEARING_TOPIC,
    SCAN_TOPIC,
    VESC_STATE_TOPIC,
    ZED_LOG_NAME,
    ZED_TOPIC,
    odometry_source,
    odometry_topic,
    preference,
)

if TYPE_CHECKING:
    from capture.calibrations import Calibration
    from capture.images import LoggedImage
    from capture.log_reader import McapLog, RawMessages, Topic
    from capture.log_tail import LogTail
    from capture.session_writer import SessionWriter
    from drivers.vesc import VescCalibration


@dataclass(frozen=True)
class Session:
    """A session folder and what its `session.yaml` says; `Session.open` gives one.

    Streams are read from the log on each call. Readers raise `MissingStreamError`, naming what
    the session has, and `LogError` when the log is damaged.
    """

    folder: Path
    info: SessionInfo

    @classmethod
    def open(cls, folder: Path) -> Session:
        """The session in `folder`; raises `SessionError` when there is none that we can read."""
        return cls(folder, read_session_info(folder))

    @staticmethod
    def create(folder: Path, info: SessionInfo) -> AbstractContextManager[SessionWriter]:
        """A writer for a new session that appears when its block ends well, and only then."""
        from capture.session_writer import new_session

        return new_session(folder, info)

    @property
    def name(self) -> str:
        """The name of the folder."""
        return self.folder.resolve().name

    @cached_property
    def log(self) -> McapLog | None:
        """The log of the car, None for a session without one."""
        return self._log_named(LOG_NAME)

    @cached_property
    def logs(self) -> tuple[McapLog, ...]:
        """Every log of the session: the car's and those of the cameras."""
        from capture.log_reader import McapLog

        return tuple(McapLog(file) for file in self._log_files)

    def log_tail(self) -> LogTail:
        """A reader of the log while it is being recorded; it need not exist yet."""
        from capture.log_tail import LogTail

        return LogTail(self.folder / LOG_NAME)

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What the logs hold, the car's first, as it is the first by name, too."""
        return tuple(topic for log in self.logs for topic in log.topics.values())

    @property
    def truncated(self) -> bool:
        """Whether the log has no end, because the power or the program went while recording."""
        return self.log is not None and self.log.truncated

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know before trusting the session."""
        return self.log.remarks if self.log else ()

    @property
    def odometry_sources(self) -> tuple[str, ...]:
        """Names of the odometry streams, preferred ones first."""
        found = {
            odometry_source(topic.name)
            for log in self._odometry_logs
            for topic in log.topics.values()
            if topic.type_name == ODOMETRY_TYPE
            and topic.name.endswith(ODOMETRY_SUFFIX)
            and topic.count
        }
        return tuple(sorted(found, key=preference))

    def odometry(self, source: str | None = None) -> Odometry:
        """The odometry of `source`; None takes the only one, or vesc, wheel, zed, viso in turn."""
        from capture.log_columns import odometry_columns

        if source is None:
            sources = self.odometry_sources
            source = sources[0] if sources else "wheel"
        topic = odometry_topic(source)
        holds = [log for log in self._odometry_logs if topic in log.topics]
        raw = self._raw("odometry", topic, holds[0] if holds else self.log)
        return odometry_columns(raw, source)

    @property
    def has_scans(self) -> bool:
        """Whether there are lidar revolutions."""
        return self._has(POINTS_TOPIC) or self._has(SCAN_TOPIC)

    @property
    def has_observations(self) -> bool:
        """Whether the data set brought ranges and bearings of landmarks along."""
        return self._has(RANGE_BEARING_TOPIC)

    def scans(self) -> Scans:
        """Lidar revolutions; of `/lidar/points`, which has each beam's own time, else `/scan`."""
        if self._has(POINTS_TOPIC):
            from capture.point_cloud import point_cloud_columns

            return point_cloud_columns(self._raw("lidar points", POINTS_TOPIC))
        from capture.log_columns import scan_columns

        return scan_columns(self._raw("lidar scans", SCAN_TOPIC))

    def imu(self) -> Imu:
        """Angular velocity and acceleration."""
        from capture.log_columns import imu_columns

        return imu_columns(self._raw("IMU", IMU_TOPIC))

    def magnetic_field(self) -> MagneticField:
        """What the compass of the IMU read."""
        from capture.log_columns import magnetic_field_columns

        return magnetic_field_columns(self._raw("magnetic field", MAGNETIC_FIELD_TOPIC))

    def vesc_state(self) -> VescState:
        """Telemetry of the motor controller."""
        from capture.log_columns import vesc_state_columns

        return vesc_state_columns(self._raw("motor controller telemetry", VESC_STATE_TOPIC))

    def drive(self) -> Drive:
        """What the car was told to do."""
        from capture.log_columns import drive_columns

        return drive_columns(self._raw("drive commands", DRIVE_TOPIC))

    def observations(self) -> Observations:
        """Ranges and bearings of landmarks that the data set brought along."""
        from capture.log_columns import observation_columns

        return observation_columns(self._raw("landmark observations", RANGE_BEARING_TOPIC))

    @cached_property
    def film(self) -> McapLog | None:
        """The log of the overhead camera, None for a session without one."""
        return self._log_named(OVERHEAD_LOG_NAME)

    @property
    def overhead_count(self) -> int:
        """How many pictures the overhead camera took."""
        topic = self.film.topics.get(OVERHEAD_TOPIC) if self.film else None
        return topic.count if topic else 0

    def overhead_images(self) -> Iterator[LoggedImage]:
        """The pictures of the overhead camera, one at a time, in the order of the log.

        Of a joined session their times are on the clock of the car (`SessionInfo.film_clock`).
        """
        from capture.images import logged_images

        if self.film is None or not self.overhead_count:
            raise MissingStreamError(
                f"{self.folder}: has no pictures of the overhead camera ({OVERHEAD_LOG_NAME}, "
                f"topic {OVERHEAD_TOPIC}); record them with trackside film"
            )
        images = logged_images(self.film, OVERHEAD_TOPIC)
        clock = self.info.film_clock
        if clock is None:
            return images
        return (replace(one, t_ns=clock.session_ns(one.t_ns)) for one in images)

    @cached_property
    def stereo_film(self) -> McapLog | None:
        """The log of the car's stereo camera, None for a session without one."""
        return self._log_named(ZED_LOG_NAME)

    @property
    def stereo_count(self) -> int:
        """How many pairs of pictures the stereo camera took."""
        topic = self.stereo_film.topics.get(ZED_TOPIC) if self.stereo_film else None
        return topic.count if topic else 0

    def stereo_images(self) -> Iterator[LoggedImage]:
        """The pictures of the stereo camera, both eyes side by side, in the order of the log."""
        from capture.images import logged_images

        if self.stereo_film is None or not self.stereo_count:
            raise MissingStreamError(
                f"{self.folder}: has no pictures of the stereo camera ({ZED_LOG_NAME}, topic "
                f"{ZED_TOPIC}); record them with a rig that has a zed (trackside devices)"
            )
        return logged_images(self.stereo_film, ZED_TOPIC)

    def add_odometry(self, told: UncertainOdometry, *, replace: bool = False) -> Path:
        """Put a source's odometry into a log of its own, `SOURCE.mcap`; its path.

        Raises `SessionError` if the session has that source and `replace` is not set, or another
        log has it.
        """
        from capture.added_odometry import add_odometry

        return add_odometry(self, told, replace=replace)

    def calibration_in_force(self, kind: str) -> Calibration | None:
        """The newest accepted calibration of a kind that the session holds, None without one.

        Raises `CalibrationFileError` for a file that cannot be read.
        """
        from capture.in_force import calibration_in_force

        return calibration_in_force(self.folder, kind)

    def measured(self, kind: str) -> Mapping[str, float]:
        """The parameters of the car's calibration of a kind that is in force; empty without one."""
        from capture.in_force import measured

        return measured(self.folder, kind)

    def motor_calibration(self) -> VescCalibration | None:
        """What ties the motor controller's numbers to the car; None if unknown.

        An accepted `calibration/odometry_*.yaml` of the session goes before the words of its rig.
        Raises `ConfigurationError` where `session.yaml` holds something else in their place.
        """
        from capture.in_force import motor_calibration

        return motor_calibration(self.folder) or self.recorded_motor_calibration()

    def recorded_motor_calibration(self) -> VescCalibration | None:
        """The rig's words while it was recorded, by which `/drive` and `/vesc/odom` were written.

        Raises `ConfigurationError` where `session.yaml` holds something else in their place.
        """
        from capture.in_force import recorded_motor_calibration

        return recorded_motor_calibration(self.folder, self.info)

    @property
    def has_ground_truth(self) -> bool:
        """Whether it is known where the car really was."""
        return (self._truth_folder / "car.tum").exists()

    def ground_truth(self) -> GroundTruth:
        """Where the car and the landmarks really were."""
        if not self.has_ground_truth:
            raise MissingStreamError(
                f"{self.folder}: has no ground truth ({self._truth_folder.name}/car.tum); "
                "make it with trackside track, or import a session that has it"
            )
        return read_ground_truth(self._truth_folder)

    def write_ground_truth(self, truth: GroundTruth, *, replace: bool = False) -> None:
        """Add the truth; raises `SessionError` if there is one and `replace` is not set."""
        write_ground_truth(self._truth_folder, truth, replace=replace)

    @property
    def estimates(self) -> tuple[str, ...]:
        """Names of the estimates, sorted."""
        paths = (self.folder / "estimates").glob("[!.]*/path.tum")
        return tuple(sorted(path.parent.name for path in paths))

    def estimate(self, name: str) -> Estimate:
        """The estimate of that name."""
        if name not in self.estimates:
            has = ", ".join(self.estimates) or "none"
            raise MissingStreamError(
                f"{self.folder}: has no estimate {name!r}; it has: {has}; "
                "make one with trackside slam"
            )
        return read_estimate(self.folder / "estimates" / name)

    def write_estimate(self, estimate: Estimate, *, replace: bool = False) -> None:
        """Add an estimate; raises `SessionError` if the name is taken and `replace` is not set."""
        folder = self.folder / "estimates" / checked_name(estimate.name)
        write_estimate(folder, estimate, replace=replace)

    def score_file(self, name: str) -> Path:
        """Where the score of an estimate stands, or would stand."""
        return self.folder / "scores" / f"{checked_name(name)}.json"

    @property
    def deciding_files(self) -> tuple[Path, ...]:
        """What decides what can be made of the session: its logs, truth and calibrations."""
        # None of them is opened: a log that is damaged has content, too.
        logs = [file for file in self._log_files if file.name not in IMAGE_LOGS]
        files = (*logs, *sorted(self._truth_folder.glob("*")), *self.calibrations)
        return tuple(file for file in files if file.is_file())

    @property
    def calibrations(self) -> tuple[Path, ...]:
        """The calibrations that were in force, sorted by name."""
        return tuple(sorted((self.folder / "calibration").glob("*.yaml")))

    def copy_calibration(self, file: Path) -> None:
        """Keep a copy of a calibration file in the session."""
        from capture.session_writer import copy_calibration

        copy_calibration(self.folder, file)

    def adopt_calibrations(self, files: Iterable[Path]) -> tuple[Path, ...]:
        """Copy those calibration files in whose names are not there yet; which they were."""
        here = {file.name for file in self.calibrations}
        fresh = tuple(file for file in files if file.name not in here)
        for file in fresh:
            self.copy_calibration(file)
        return fresh

    @property
    def _truth_folder(self) -> Path:
        return self.folder / "ground_truth"

    @property
    def _log_files(self) -> list[Path]:
        """Files of the logs, none of them opened: a broken one is told by who reads it."""
        return sorted(self.folder.glob("[!.]*.mcap"))

    @property
    def _odometry_logs(self) -> tuple[McapLog, ...]:
        """The car's log, and those that were made of pictures later."""
        from capture.log_reader import McapLog

        others = {LOG_NAME, *IMAGE_LOGS}
        added = [McapLog(file) for file in self._log_files if file.name not in others]
        return (self.log, *added) if self.log else tuple(added)

    def _log_named(self, name: str) -> McapLog | None:
        from capture.log_reader import McapLog

        file = self.folder / name
        return McapLog(file) if file.exists() else None

    def _has(self, topic: str) -> bool:
        topics = self.log.topics if self.log else {}
        return topic in topics and topics[topic].count > 0

    def _raw(self, what: str, topic: str, log: McapLog | None = None) -> RawMessages:
        """The messages of a topic, of which there is at least one; of the car's log if not told."""
        log = log or self.log
        raw = log.read(topic) if log else None
        if raw is None or not raw.messages:
            has = ", ".join(f"{t.name} ({t.count})" for t in self.topics) or "no log at all"
            raise MissingStreamError(
                f"{self.folder}: has no {what} (topic {topic}); it has: {has}; "
                "use another stream, or import the recording again with --topic"
            )
        return raw
