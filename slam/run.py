"""Session -> estimate: drives a filter over odometry and observations in the order of time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import Estimate, Observations, Odometry
from geometry import Floats, Stamps, Trajectory, between
from slam.errors import SlamError
from slam.interface import Slam, UpdateReport


@dataclass(frozen=True)
class RunReport:
    """What happened on the way: observation fates, data left out, and how long it took."""

    updates: UpdateReport
    scans: int
    outside_odometry: int
    cpu_s: float
    duration_s: float


@dataclass(frozen=True, eq=False)
class _Schedule:
    """Odometry and scans merged: at which step of the merged time each scan comes.

    t_ns : (k + 1,) times; increments : (k, 3) from each to the next; scan_step : (s,) index into
    t_ns; starts : (s + 1,) observations of each scan.
    """

    t_ns: Stamps
    increments: Floats
    dt_s: Floats
    scan_step: npt.NDArray[np.intp]
    starts: npt.NDArray[np.int64]
    outside: int


def run_slam(
    slam: Slam,
    odometry: Odometry,
    observations: Observations,
    *,
    name: str,
    path_period_s: float = 0.0,
    provenance: Mapping[str, object] | None = None,
    advance: Callable[[int], None] = lambda _: None,
) -> tuple[Estimate, RunReport]:
    """The path and map that `slam` makes of the data, and what happened on the way.

    The path has a pose at every scan and, between scans, one at least every `path_period_s` where
    the odometry is that dense (0: every odometry sample). Scans outside the time of the odometry
    are left out and counted. `advance` is told how many scans were done. Deterministic.
    Raises `SlamError` when odometry and observations do not overlap.
    """
    started_s = time.process_time()
    schedule = _schedule(odometry, observations)
    poses, covariances = np.zeros((schedule.t_ns.size, 3)), np.zeros((schedule.t_ns.size, 3, 3))
    total, here = UpdateReport(), 0
    for scan, step in enumerate(schedule.scan_step.tolist()):
        _predict(slam, schedule, here, step, poses, covariances)
        one = slice(schedule.starts[scan], schedule.starts[scan + 1])
        total += slam.update(
            int(schedule.t_ns[step]),
            observations.landmark_id[one],
            observations.range_m[one],
            observations.bearing_rad[one],
        )
        poses[step], covariances[step] = slam.pose, slam.pose_covariance
        here = step
        advance(1)
    _predict(slam, schedule, here, schedule.t_ns.size - 1, poses, covariances)
    kept = _kept(schedule, path_period_s)
    estimate = Estimate(
        name,
        Trajectory.from_poses(schedule.t_ns[kept], poses[kept]),
        slam.estimated_map(),
        covariances[kept],
        provenance or {},
    )
    duration_s = float(schedule.t_ns[-1] - schedule.t_ns[0]) * 1e-9
    cpu_s = time.process_time() - started_s
    scans = schedule.scan_step.size
    return estimate, RunReport(total, scans, schedule.outside, cpu_s, duration_s)


def _predict(
    slam: Slam, schedule: _Schedule, start: int, end: int, poses: Floats, covariances: Floats
) -> None:
    if end > start:
        steps = slice(start, end)
        moved = slice(start + 1, end + 1)
        poses[moved], covariances[moved] = slam.predict(
            schedule.increments[steps], schedule.dt_s[steps]
        )


def _schedule(odometry: Odometry, observations: Observations) -> _Schedule:
    driven = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    starts = observations.batch_starts
    scan_ns = observations.t_ns[starts[:-1]]
    inside = (scan_ns >= driven.t_ns[0]) & (scan_ns <= driven.t_ns[-1])
    if not np.any(inside):
        raise SlamError(_no_overlap(driven.t_ns, scan_ns))
    # Scans outside are a head and a tail, so that the rest stays one run of `starts`.
    first = int(np.argmax(inside))
    last = int(inside.size - np.argmax(inside[::-1]))
    t_ns = np.union1d(driven.t_ns, scan_ns[inside])
    poses = driven.interpolated(t_ns).poses
    return _Schedule(
        t_ns,
        between(poses[:-1], poses[1:]),
        np.diff(t_ns) * 1e-9,
        np.searchsorted(t_ns, scan_ns[first:last]),
        starts[first : last + 1],
        int(inside.size - inside.sum()),
    )


def _no_overlap(odometry_ns: Stamps, scan_ns: Stamps) -> str:
    if scan_ns.size == 0:
        return "the session has no observations; nothing can be mapped"
    return (
        f"odometry covers {odometry_ns[0] * 1e-9:.3f} to {odometry_ns[-1] * 1e-9:.3f} s and the "
        f"observations {scan_ns[0] * 1e-9:.3f} to {scan_ns[-1] * 1e-9:.3f} s: they do not overlap; "
        "was one of them stamped by another clock?"
    )


def _kept(schedule: _Schedule, period_s: float) -> npt.NDArray[np.bool_]:
    """(k + 1,): scans, both ends, and the first sample in each further period of the time axis."""
    keep = np.zeros(schedule.t_ns.size, dtype=np.bool_)
    if period_s <= 0.0:
        keep[:] = True
        return keep
    slot = (schedule.t_ns - schedule.t_ns[0]) // round(period_s * 1e9)
    keep[1:] = np.diff(slot) > 0
    keep[schedule.scan_step] = keep[0] = keep[-1] = True
    return keep
