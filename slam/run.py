"""Session -> estimate: drives a filter over odometry and observations in the order of time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import Estimate, Observations, Odometry
from geometry import Stamps, Trajectory
from slam.errors import SlamError
from slam.interface import Slam, UpdateReport
from slam.stepping import Stepper, Steps, steps_between


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
    """Odometry and scans merged: after which step of the merged time each scan comes.

    steps : k from `start_ns` on; scan_step : (s,) steps done before each scan; starts : (s + 1,)
    observations of each scan.
    """

    start_ns: int
    steps: Steps
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
    stepper, here = Stepper(slam, schedule.start_ns, path_period_s), 0
    for scan, step in enumerate(schedule.scan_step.tolist()):
        stepper.move(schedule.steps[here:step])
        one = slice(schedule.starts[scan], schedule.starts[scan + 1])
        stepper.see(
            observations.landmark_id[one], observations.range_m[one], observations.bearing_rad[one]
        )
        here = step
        advance(1)
    stepper.move(schedule.steps[here:])
    return stepper.estimate(name, provenance or {}), RunReport(
        stepper.updates,
        stepper.scans,
        schedule.outside,
        time.process_time() - started_s,
        (stepper.t_ns - schedule.start_ns) * 1e-9,
    )


def _schedule(odometry: Odometry, observations: Observations) -> _Schedule:
    driven = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    starts = observations.batch_starts
    scan_ns = observations.t_ns[starts[:-1]]
    inside = (scan_ns >= driven.t_ns[0]) & (scan_ns <= driven.t_ns[-1])
    if not np.any(inside):
        raise SlamError(no_overlap(driven.t_ns, scan_ns))
    # Scans outside are a head and a tail, so that the rest stays one run of `starts`.
    first = int(np.argmax(inside))
    last = int(inside.size - np.argmax(inside[::-1]))
    t_ns = np.union1d(driven.t_ns, scan_ns[inside])
    return _Schedule(
        int(t_ns[0]),
        steps_between(driven, t_ns),
        np.searchsorted(t_ns, scan_ns[first:last]),
        starts[first : last + 1],
        int(inside.size - inside.sum()),
    )


def no_overlap(odometry_ns: Stamps, scan_ns: Stamps) -> str:
    """What to tell when no scan lies within the time of the odometry."""
    if scan_ns.size == 0:
        return "the session has no observations; nothing can be mapped"
    return (
        f"odometry covers {odometry_ns[0] * 1e-9:.3f} to {odometry_ns[-1] * 1e-9:.3f} s and the "
        f"observations {scan_ns[0] * 1e-9:.3f} to {scan_ns[-1] * 1e-9:.3f} s: they do not overlap; "
        "was one of them stamped by another clock?"
    )
