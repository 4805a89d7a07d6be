"""Lidar revolutions -> the cones they show, as range and bearing from the car.

Each beam is first carried, with the odometry at its own time, to where it would have been shot at
the middle of the revolution: the stamp of its observations. No beam is then carried for more than
half a revolution, which halves what an error of the odometry does.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from capture import Observations, Odometry, Scans
from geometry import Floats, Stamps
from slam.cones import kernels
from slam.cones.config import CENTRES, ConeConfig
from slam.observation import noise_array

MAX_REVOLUTION_S = 1.0
"""Beams stamped further apart than this are no revolution; their own times are then not used."""
MAX_ODOMETRY_GAP_S = 0.25
MAX_CARRY_S = 0.1
"""So far beyond the odometry's ends its last motion is taken to go on (live, scans come first)."""
_STILL: tuple[Stamps, Floats] = np.array([0, 1], np.int64), np.zeros((2, 3))
"""Odometry of a car that stands."""


@dataclass(frozen=True)
class ConeReport:
    """What became of the beams, the revolutions and the clusters that were no cones."""

    revolutions: int = 0
    without_echo: int = 0
    """Revolutions in which no beam was usable."""
    out_of_order: int = 0
    """Revolutions left out because their time does not increase."""
    not_deskewed: int = 0
    """Revolutions taken as if the car had stood still: no odometry there, or impossible times."""
    beams: int = 0
    beams_without_echo: int = 0
    beams_out_of_range: int = 0
    cones: int = 0
    refused: Mapping[str, int] = field(default_factory=dict)

    def text(self) -> str:
        """Two or three lines for a person."""
        lines = [
            f"{self.cones} cones in {self.revolutions} lidar revolutions of {self.beams} beams, "
            f"{self.beams_without_echo} without echo, {self.beams_out_of_range} out of range"
        ]
        if self.refused:
            reasons = ", ".join(f"{count} {reason}" for reason, count in self.refused.items())
            lines.append(f"clusters that are no cones: {reasons}")
        faults = (
            (self.without_echo, "without any echo"),
            (self.out_of_order, "left out because their time does not increase"),
            (self.not_deskewed, "not corrected for the motion of the car"),
        )
        told = ", ".join(f"{count} {what}" for count, what in faults if count)
        return "\n".join([*lines, f"revolutions {told}"] if told else lines)


@dataclass(frozen=True, eq=False)
class ConeDetections:
    """Every cone of every revolution, m in all.

    covariance : (m, 2, 2) of range [m] and bearing [rad]; hits : (m,) beams that struck it.
    """

    observations: Observations
    covariance: Floats
    hits: npt.NDArray[np.int64]
    report: ConeReport


def observations_from_scans(
    scans: Scans, odometry: Odometry | None, config: ConeConfig
) -> tuple[Observations, ConeReport]:
    """The cones of all revolutions as observations with id -1, and what was left out and why."""
    detections = detect_cones(scans, odometry, config)
    return detections.observations, detections.report


def detect_cones(
    scans: Scans,
    odometry: Odometry | None,
    config: ConeConfig,
    advance: Callable[[int], None] = lambda _: None,
) -> ConeDetections:
    """The cones of all revolutions in the frame of the car in the middle of each revolution.

    Beams of a revolution may come in any order of angle and time. Without odometry, or where it has
    a gap, the car is taken to stand still during the revolution. `advance` is told how many
    revolutions were done. Deterministic; raises nothing for whatever the beams say.
    """
    extractor = ConeExtractor(config, odometry)
    stamps = [
        revolution_stamp(int(t_ns), scans.beam_t_ns[start:stop])
        for t_ns, start, stop in zip(scans.t_ns, scans.starts[:-1], scans.starts[1:], strict=True)
    ]
    kept = _longest_increasing([stamp for stamp, _ in stamps])
    rows: list[tuple[int, Floats, Floats]] = []
    for k in kept:
        stamp_ns, trusted = stamps[k]
        one = slice(int(scans.starts[k]), int(scans.starts[k + 1]))
        beam_t_ns = scans.beam_t_ns[one] if trusted else None
        found = extractor.cones(stamp_ns, beam_t_ns, scans.range_m[one], scans.bearing_rad[one])
        rows.append((stamp_ns, *found))
        advance(1)
    total = scans.t_ns.size
    return _joined(rows, extractor.report(revolutions=total, out_of_order=total - len(kept)))


class ConeExtractor:
    """Configuration and odometry as the kernels take them, and the counts so far.

    odometry : of the time around the next revolution; may be replaced at any time.
    """

    def __init__(self, config: ConeConfig, odometry: Odometry | None) -> None:
        self.count: Counter[str] = Counter()
        self._refused = np.zeros(len(kernels.REFUSALS), np.int64)
        self._mounting = np.array(
            [config.mounting.x_m, config.mounting.y_m, config.mounting.yaw_rad]
        )
        self._noise, self._floor = noise_array(config.hit), noise_array(config.floor)
        self._rule = _rule_array(config)
        self._nearest_m = config.min_range_m
        self._furthest_m = math.inf if config.see_walls else config.max_range_m
        self.odometry = odometry

    def cones(
        self, stamp_ns: int, beam_t_ns: Stamps | None, range_m: Floats, bearing_rad: Floats
    ) -> tuple[Floats, Floats]:
        """Of one revolution: (k, 5) range, bearing, covariance rr rb bb; and (k,) hits.

        Beams without times of their own are taken as shot at the stamp.
        """
        motion = _STILL if beam_t_ns is None else self._motion(beam_t_ns)
        self.count["not_deskewed"] += motion is _STILL
        if beam_t_ns is None:
            beam_t_ns = np.full(range_m.size, stamp_ns)
        placed = np.empty((4, range_m.size))
        count, silent, outside = kernels.place_beams(
            beam_t_ns, range_m, bearing_rad, stamp_ns, *motion,
            self._mounting, self._nearest_m, self._furthest_m, placed,
        )  # fmt: skip
        beams = placed.take(np.argsort(placed[2, :count], kind="stable"), axis=1)
        echo = np.flatnonzero(beams[3])
        self.count["beams"] += range_m.size
        self.count["beams_without_echo"] += silent
        self.count["beams_out_of_range"] += outside
        self.count["without_echo"] += echo.size == 0
        found = kernels.find_cones(
            beams, echo, _usual_spacing(beams[2]), self._rule, self._noise, self._refused
        )
        seen = np.empty((found.shape[0], 5))
        kernels.as_seen_from_car(found, self._mounting, self._floor, seen)
        return seen, found[:, 5]

    def report(self, **more: int) -> ConeReport:
        """The counts so far; the cones are not among them."""
        refused = dict(zip(kernels.REFUSALS, self._refused.tolist(), strict=True))
        told = {reason: count for reason, count in refused.items() if count}
        return ConeReport(**{**self.count, **more}, refused=told)

    def _motion(self, beam_t_ns: Stamps) -> tuple[Stamps, Floats]:
        """Odometry rows around the revolution; two equal poses where there is none to trust."""
        driven = self.odometry
        if beam_t_ns.size and driven is not None and driven.t_ns.size > 1:
            t_ns, start, end = driven.t_ns, int(beam_t_ns.min()), int(beam_t_ns.max())
            low = max(int(np.searchsorted(t_ns, start, side="right")) - 1, 0)
            rows = slice(min(low, t_ns.size - 2), int(np.searchsorted(t_ns, end)) + 1)
            if _usable(t_ns[rows], driven.pose_odom_base[rows], start, end):
                return t_ns[rows], driven.pose_odom_base[rows]
        return _STILL


def _usable(t_ns: Stamps, poses: Floats, start_ns: int, end_ns: int) -> bool:
    """Whether odometry rows tell how the car moved from start to end."""
    if t_ns.size < 2 or not np.all(np.isfinite(poses)):
        return False
    gaps, carry_ns = np.diff(t_ns), round(MAX_CARRY_S * 1e9)
    return (
        int(t_ns[0]) - carry_ns <= start_ns
        and end_ns <= int(t_ns[-1]) + carry_ns
        and int(gaps.min()) > 0
        and int(gaps.max()) <= MAX_ODOMETRY_GAP_S * 1e9
    )


def _rule_array(config: ConeConfig) -> Floats:
    """(11,), in the order `kernels.judged` reads them."""
    return np.array(
        [
            config.cone_radius_m,
            config.min_range_m,
            config.max_range_m,
            min(config.within_m, 2.0 * config.cone_radius_m + config.join_m),
            float(config.min_hits),
            float(config.max_hits),
            config.hits_tolerance,
            config.round_share,
            float(CENTRES.index(config.centre)),
            float(config.see_walls),
            config.join_m,
        ]
    )


def _usual_spacing(bearing_rad: Floats) -> float:
    """The median angle between neighbouring beams; bearings sorted."""
    if bearing_rad.size < 2:
        return 2.0 * math.pi
    gaps = np.sort(bearing_rad[1:] - bearing_rad[:-1])
    return float(gaps[gaps.size // 2])


def revolution_stamp(t_ns: int, beam_t_ns: Stamps) -> tuple[int, bool]:
    """The middle of a revolution, and whether its beams' own times can be trusted.

    Where they cannot, the stamp of the message `t_ns` stands for all.
    """
    start, end = (int(beam_t_ns.min()), int(beam_t_ns.max())) if beam_t_ns.size else (0, 0)
    trusted = beam_t_ns.size > 0 and end - start <= MAX_REVOLUTION_S * 1e9
    return ((start + end) // 2 if trusted else t_ns), trusted


def _longest_increasing(stamps: list[int]) -> list[int]:
    """Rows whose stamps increase, the most that can be kept: one wrong stamp costs one row.

    Patience sorting, n log n: tails[j] is the least stamp that ends an increasing run of j + 1.
    """
    tails: list[int] = []
    row_of_tail: list[int] = []
    before = [-1] * len(stamps)
    for row, stamp in enumerate(stamps):
        j = bisect_left(tails, stamp)
        before[row] = row_of_tail[j - 1] if j else -1
        tails[j : j + 1] = [stamp]
        row_of_tail[j : j + 1] = [row]
    kept, row = [], row_of_tail[-1] if row_of_tail else -1
    while row >= 0:
        kept.append(row)
        row = before[row]
    return kept[::-1]


def _joined(rows: list[tuple[int, Floats, Floats]], report: ConeReport) -> ConeDetections:
    seen = np.concatenate([np.empty((0, 5)), *(found for _, found, _ in rows)])
    hits = np.concatenate([np.empty(0), *(hit for _, _, hit in rows)]).astype(np.int64)
    t_ns = np.repeat(
        np.array([stamp for stamp, _, _ in rows], np.int64), [hit.size for _, _, hit in rows]
    )
    unknown = np.full(hits.size, -1, np.int64)
    observations = Observations(t_ns, unknown, seen[:, 0], seen[:, 1])
    return ConeDetections(
        observations,
        seen[:, [2, 3, 3, 4]].reshape(-1, 2, 2),
        hits,
        ConeReport(**{**vars(report), "cones": hits.size}),
    )
