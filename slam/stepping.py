"""A filter on its way through a recording, whole or as it comes: the one place where it is driven.

`slam.run` hands over a finished recording, `slam.online` one that is still growing. Both move the
filter along odometry and let it see scans in the order of time; path and counts are kept here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import Estimate
from geometry import Floats, Stamps, Trajectory, between
from slam.interface import Slam, UpdateReport


@dataclass(frozen=True, eq=False)
class Steps:
    """What the odometry did from each time to the next.

    t_ns : (k,) times; increments : (k, 3) from the time before each, `pose_before_after`.
    """

    t_ns: Stamps
    increments: Floats

    def __getitem__(self, rows: slice) -> Steps:
        return Steps(self.t_ns[rows], self.increments[rows])


def steps_between(driven: Trajectory, t_ns: Stamps) -> Steps:
    """The steps from `t_ns[0]` on through all further times (k + 1,), interpolated."""
    poses = driven.interpolated(t_ns).poses
    return Steps(t_ns[1:], between(poses[:-1], poses[1:]))


class Stepper:
    """Drives a filter from `start_ns` on and keeps the path.

    The path has a pose at every scan and, between scans, one at least every `path_period_s` where
    the odometry is that dense (0: every step).
    """

    def __init__(self, slam: Slam, start_ns: int, path_period_s: float) -> None:
        self.slam = slam
        self.updates = UpdateReport()
        self.scans = 0
        self._start_ns = start_ns
        self._period_ns = round(path_period_s * 1e9)
        self._here_ns, self._here_kept = start_ns, True
        self._pose: Floats = np.zeros(3)
        self._covariance: Floats = np.zeros((3, 3))
        self._kept: list[tuple[Stamps, Floats, Floats]] = []

    @property
    def t_ns(self) -> int:
        """How far the filter has come."""
        return self._here_ns

    def move(self, steps: Steps) -> None:
        """Follow the odometry."""
        if not steps.t_ns.size:
            return
        before = np.append(self._here_ns, steps.t_ns[:-1])
        poses, covariances = self.slam.predict(steps.increments, (steps.t_ns - before) * 1e-9)
        kept = self._in_new_periods(before, steps.t_ns)
        self._keep_here()
        on_the_way = np.flatnonzero(kept[:-1])
        self._kept.append((steps.t_ns[on_the_way], poses[on_the_way], covariances[on_the_way]))
        self._here_ns, self._here_kept = int(steps.t_ns[-1]), bool(kept[-1])
        self._pose, self._covariance = poses[-1], covariances[-1]

    def see(
        self, landmark_id: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        """Let the filter see a scan, taken where it has come to."""
        report = self.slam.update(self._here_ns, landmark_id, range_m, bearing_rad)
        self._pose, self._covariance = self.slam.pose, self.slam.pose_covariance
        self._here_kept = True
        self.updates += report
        self.scans += 1
        return report

    def estimate(self, name: str, provenance: Mapping[str, object]) -> Estimate:
        """Path and map as they stand now."""
        self._here_kept = True
        self._keep_here()
        self._here_kept = False
        t_ns, poses, covariances = (
            np.concatenate(parts) for parts in zip(*self._kept, strict=True)
        )
        return Estimate(
            name,
            Trajectory.from_poses(t_ns, poses),
            self.slam.estimated_map(),
            covariances,
            provenance,
        )

    def _keep_here(self) -> None:
        if self._here_kept:
            here = np.array([self._here_ns], np.int64)
            self._kept.append((here, self._pose[None].copy(), self._covariance[None].copy()))

    def _in_new_periods(self, before_ns: Stamps, t_ns: Stamps) -> npt.NDArray[np.bool_]:
        """(k,): whether each time is the first in its period."""
        if not self._period_ns:
            return np.ones(t_ns.size, np.bool_)
        slot, slot_before = (
            (times - self._start_ns) // self._period_ns for times in (t_ns, before_ns)
        )
        new: npt.NDArray[np.bool_] = slot > slot_before
        return new
