"""Scans that wait for their odometry: revolutions of a lidar, or observations as they were given.

A scan can be taken once the odometry has passed its end, for only then is it known from where each
of its beams was shot.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from capture import Arrived, Observations, Odometry, Scans
from geometry import Floats
from slam.cones.config import ConeConfig
from slam.cones.detection import ConeExtractor, revolution_stamp

MOST_WAITING = 2000
"""More do not wait: the odometry has stopped, minutes ago."""
Seen = tuple[npt.NDArray[np.int64], Floats, Floats]
"""Ids (-1: unknown), ranges and bearings of one scan."""
ScanStream = Literal["observations", "points", "scans"]


@dataclass(frozen=True, order=True)
class WaitingScan:
    """A scan, in the order of its stamp; `end_ns` is when its last beam was shot."""

    stamp_ns: int
    end_ns: int = field(compare=False)
    log_t_ns: int = field(compare=False)
    content: Scans | Observations = field(compare=False)
    trusted: bool = field(default=True, compare=False)


class ScanReader(Protocol):
    """Takes scans out of what arrived, and observations out of scans."""

    def arrived(self, new: Arrived) -> list[WaitingScan]:
        """The scans among it."""

    def seen(self, scan: WaitingScan, odometry: Odometry) -> Seen:
        """What a scan shows, given the odometry around it."""

    def notes(self, out_of_order: int) -> list[str]:
        """What to tell a person at the end."""


class GivenObservations:
    """Observations that the data set brought along."""

    def arrived(self, new: Arrived) -> list[WaitingScan]:
        """One scan for each message that holds any."""
        return [
            WaitingScan(int(seen.t_ns[0]), int(seen.t_ns[0]), log_t_ns, seen)
            for log_t_ns, seen in new.observations()
            if seen.t_ns.size
        ]

    def seen(self, scan: WaitingScan, odometry: Odometry) -> Seen:  # noqa: ARG002  needs none
        """As they were given."""
        given = scan.content
        assert isinstance(given, Observations)
        return given.landmark_id, given.range_m, given.bearing_rad

    def notes(self, out_of_order: int) -> list[str]:
        """How many came too late."""
        late = f"{out_of_order} scans were left out because their time does not increase"
        return [late] if out_of_order else []


class ConesInRevolutions:
    """The cones in the revolutions of a lidar."""

    def __init__(self, config: ConeConfig, stream: ScanStream) -> None:
        self._stream = stream
        self._revolutions = self._cones = 0
        self._extractor = ConeExtractor(config, None)

    def arrived(self, new: Arrived) -> list[WaitingScan]:
        """One scan for each revolution; its stamp is its middle."""
        found = []
        for log_t_ns, scan in new.points() if self._stream == "points" else new.scans():
            stamp_ns, trusted = revolution_stamp(int(scan.t_ns[0]), scan.beam_t_ns)
            end_ns = int(scan.beam_t_ns.max()) if trusted else stamp_ns
            found.append(WaitingScan(stamp_ns, end_ns, log_t_ns, scan, trusted))
        self._revolutions += len(found)
        return found

    def seen(self, scan: WaitingScan, odometry: Odometry) -> Seen:
        """Its cones, none of them named."""
        beams = scan.content
        assert isinstance(beams, Scans)
        self._extractor.odometry = odometry
        times = beams.beam_t_ns if scan.trusted else None
        found, _ = self._extractor.cones(scan.stamp_ns, times, beams.range_m, beams.bearing_rad)
        self._cones += len(found)
        return np.full(len(found), -1, np.int64), found[:, 0], found[:, 1]

    def notes(self, out_of_order: int) -> list[str]:
        """What became of the beams."""
        counts = {"revolutions": self._revolutions, "cones": self._cones}
        return self._extractor.report(**counts, out_of_order=out_of_order).text().splitlines()


class WaitingScans:
    """The queue, in the order of the stamps.

    out_of_order, too_many : scans that were left out.
    """

    def __init__(self) -> None:
        self.out_of_order = 0
        self.too_many = 0
        self._queue: list[WaitingScan] = []
        self._last_ns: int | None = None

    def __len__(self) -> int:
        return len(self._queue)

    def add(self, scans: list[WaitingScan]) -> None:
        """Let them wait; those before a scan that was taken already are left out."""
        for scan in scans:
            at = bisect_left(self._queue, scan)
            twice = at < len(self._queue) and self._queue[at].stamp_ns == scan.stamp_ns
            if twice or (self._last_ns is not None and scan.stamp_ns <= self._last_ns):
                self.out_of_order += 1
            elif len(self._queue) == MOST_WAITING:
                self.too_many += 1
            else:
                self._queue.insert(at, scan)

    def next(self, odometry_to_ns: int, *, last: bool) -> WaitingScan | None:
        """The earliest scan, if the odometry has passed it; at the end, if it covers its stamp."""
        if not self._queue:
            return None
        first = self._queue[0]
        needed = first.stamp_ns if last else max(first.stamp_ns, first.end_ns)
        if needed > odometry_to_ns or (needed == odometry_to_ns and not last):
            return None
        scan = self._queue.pop(0)
        self._last_ns = scan.stamp_ns
        return scan


def compile_cone_finder(config: ConeConfig) -> None:
    """Compile the kernels of the cone finder on a revolution that shows one cone."""
    bearing = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    range_m = np.where(np.abs(bearing) < 0.05, 1.0, np.nan)
    times = np.arange(360, dtype=np.int64)
    still = Odometry("", np.array([0, 360]), np.zeros((2, 3)), np.zeros(2), np.zeros(2))
    ConeExtractor(config, still).cones(180, times, range_m, bearing)
