"""SLAM on a recording that is still growing, with the very steps that a finished one gets.

The streams are chosen once a second of the log is there, by the rules for a finished session.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from capture import Arrived, Estimate, MissingStreamError, preferred_source
from dialogue import UsageError
from geometry import Floats
from slam.algorithms import Request
from slam.catalogue import ALGORITHMS
from slam.errors import SlamError
from slam.latency import Latency
from slam.live_gyro import LiveGyroAided
from slam.live_run import LiveRun
from slam.live_scans import (
    ConesInRevolutions,
    GivenObservations,
    ScanReader,
    ScanStream,
    WaitingScan,
    compile_cone_finder,
)
from slam.live_sources import LiveOdometry, LiveStream, LiveTachometer
from slam.run import RunReport
from slam.sources import IMU_PREFIX, TACHOMETER, parsed_source

CHOOSE_AFTER_NS = 1_000_000_000
"""So much of the log is looked at before streams are chosen: one device starts before another."""


@dataclass(frozen=True, eq=False)
class Position:
    """Where the car is and what was mapped, after the last scan that was taken.

    since_start_s : from the first odometry to that scan; pose : (3,); update_s : computing for it;
    age_s : from its arrival to its pose, None where it arrived before we watched.
    """

    since_start_s: float
    pose: Floats
    landmarks: int
    scans: int
    update_s: float
    age_s: float | None


class OnlineSlam:
    """A filter that takes what arrives in the log of the session `folder`.

    now_ns : the clock of the log times (UTC); scans that arrived before this object was made have
    no age. Raises `UsageError` for words of the request that cannot be met.
    """

    def __init__(
        self, request: Request, folder: Path, now_ns: Callable[[], int] = time.time_ns
    ) -> None:
        if request.smooth:
            raise UsageError(
                "--smooth needs the whole recording: leave it out of --follow, and run "
                "trackside slam SESSION --smooth afterwards"
            )
        self.latency = Latency()
        self._request, self._folder, self._now_ns = request, folder, now_ns
        self._config = request.config()
        # Not when the first scan waits.
        request.made(request.association or ALGORITHMS[request.algorithm].associations[:2][-1])
        compile_cone_finder(request.cone_config())
        self._watching_since_ns = now_ns()
        self._cpu_s = 0.0
        self._log_ns: tuple[int, int] | None = None
        self._early: list[Arrived] = []
        self._topics: set[str] = set()
        self._association = self._source = ""
        self._run: LiveRun | None = None

    def take(self, new: Arrived) -> None:
        """Take what arrived, and every scan that can be taken now."""
        if not new:
            return
        started_s = time.process_time()
        first_ns, last_ns = self._log_ns or (new.first_log_t_ns, new.log_t_ns)
        self._log_ns = min(first_ns, new.first_log_t_ns), max(last_ns, new.log_t_ns)
        self._topics.update(new.topics)
        if self._run is None:
            self._early.append(new)
            if self._log_ns[1] - self._log_ns[0] >= CHOOSE_AFTER_NS:
                self._choose(last=False)
        else:
            self._run.take(new, self._log_ns[1], last=False)
        self._cpu_s += time.process_time() - started_s

    @property
    def position(self) -> Position | None:
        """None before the first scan was taken."""
        run, update_s = self._run, self.latency.last_update_s
        if run is None or run.stepper is None or update_s is None:
            return None
        slam = run.stepper.slam
        return Position(
            (run.stepper.t_ns - run.start_ns) * 1e-9,
            slam.pose,
            len(slam.estimated_map()),
            run.stepper.scans,
            update_s,
            self.latency.last_age_s,
        )

    def finish(self, name: str) -> tuple[Estimate, RunReport, list[str]]:
        """The estimate, when nothing more will come; what happened, and notes for a person.

        Raises `MissingStreamError` when the log has no odometry or no scans, `SlamError` when no
        scan lies within the time of the odometry.
        """
        started_s = time.process_time()
        if self._run is None:
            self._choose(last=True)
        run = self._run
        assert run is not None
        run.take(Arrived({}), self._log_ns[1] if self._log_ns else 0, last=True)
        stepper = run.stepper
        if stepper is None:
            raise self._missing(f"odometry {self._source!r}")
        if not stepper.scans:
            raise SlamError(
                f"{self._folder}: none of the scans lies within the time of odometry "
                f"{self._source!r} ({run.outside} lie outside), nothing can be mapped; was one of "
                "them stamped by another clock?"
            )
        cones = isinstance(run.reader, ConesInRevolutions)
        provenance = self._request.provenance(self._association, self._source, cones=cones)
        estimate = stepper.estimate(name, {**provenance, "latency": self.latency.summary()})
        self._cpu_s += time.process_time() - started_s
        duration_s = (stepper.t_ns - run.start_ns) * 1e-9
        report = RunReport(stepper.updates, stepper.scans, run.outside, self._cpu_s, duration_s)
        return estimate, report, self._notes(run)

    def _notes(self, run: LiveRun) -> list[str]:
        notes = run.reader.notes(run.waiting.out_of_order)
        if run.waiting.too_many:
            notes.append(
                f"{run.waiting.too_many} scans came while the odometry was silent: left out"
            )
        return [*notes, str(run.source.report)] if run.source.report.remarkable else notes

    def _choose(self, *, last: bool) -> None:
        """Choose streams, once odometry and scans are there, and take what came early.

        Raises `MissingStreamError` when at the end they are not.
        """
        scans = _scan_stream(self._early)
        sources = sorted({source for new in self._early for source in new.odometry_sources})
        source = self._request.odometry or preferred_source(sources)
        if scans is None or source is None:
            if last:
                raise self._missing("odometry" if source is None else "scans or observations")
            return
        own, aided = parsed_source(source, sources)
        assert own is not None
        self._source = f"{IMU_PREFIX}{own}" if aided else own
        named = scans == "observations" and _named(self._early)
        self._association = self._request.association_for(self._folder, named=named)
        self._run = LiveRun(
            self._request.made(self._association),
            self._config.path_period_s,
            self._live_source(own, aided=aided),
            self._reader(scans),
            self._taken,
        )
        early, self._early = self._early, []
        for new in early:
            self._run.take(new, new.log_t_ns, last=False)

    def _live_source(self, own: str, *, aided: bool) -> LiveOdometry:
        config = self._request.source_config()
        inner: LiveOdometry = LiveStream(own, config)
        if own == TACHOMETER:
            inner = LiveTachometer(config, steers=not aided)
        return LiveGyroAided(inner, config) if aided else inner

    def _reader(self, scans: ScanStream) -> ScanReader:
        if scans == "observations":
            return GivenObservations()
        return ConesInRevolutions(self._request.cone_config(), scans)

    def _taken(self, scan: WaitingScan, update_s: float) -> None:
        live = scan.log_t_ns >= self._watching_since_ns
        age_s = (self._now_ns() - scan.log_t_ns) * 1e-9 if live else None
        self.latency.note(update_s, age_s)

    def _missing(self, what: str) -> MissingStreamError:
        return MissingStreamError(
            f"{self._folder}: its log has no {what}, nothing can be mapped; it has: "
            f"{', '.join(sorted(self._topics)) or 'nothing'}; is the recorder running?"
        )


def _scan_stream(early: Sequence[Arrived]) -> ScanStream | None:
    """Given observations before scans, as in a finished session."""
    if any(seen.t_ns.size for new in early for _, seen in new.observations()):
        return "observations"
    if any(new.points() for new in early):
        return "points"
    return "scans" if any(new.scans() for new in early) else None


def _named(early: Sequence[Arrived]) -> bool:
    return any((seen.landmark_id >= 0).any() for new in early for _, seen in new.observations())
