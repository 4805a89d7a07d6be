"""One source of odometry while it is being recorded, completed as `odometry_columns` completes it.

Whether a source tells poses, speeds or both shows only once the car moves. Until then its samples
are held back; as the car stands, nothing is missed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from capture.log_columns import at_other, differentiated, tells_motion, unwound
from capture.streams import Odometry, extended, joined, split
from geometry import Floats, wrap

SPEEDS_ONLY_M, SPEEDS_ONLY_RAD = 0.05, 0.05
"""A source whose pose stays while its speeds tell so much motion tells no poses."""


class GrowingOdometry:
    """Takes the samples as the source told them and gives them complete, each once.

    Where only poses are told, a speed is that by which the pose was reached.
    """

    def __init__(self, source: str) -> None:
        self._held = self._given = no_odometry(source)
        self._first: Floats | None = None
        self._tells_poses: bool | None = None
        self._tells_speeds = False
        self._unwound: Floats | None = None

    def take(self, told: Odometry | None, *, last: bool) -> Odometry:
        """What is complete now; with `last` all. Samples out of order are left out."""
        if told is not None:
            self._held = split(
                extended(joined(self._given, self._held), told), self._given.t_ns.size
            )[1]
        ready, self._held = split(self._held, self._readable(last=last))
        complete = self._complete(ready)
        if complete.t_ns.size:
            self._given = split(complete, complete.t_ns.size - 1)[1]
        return complete

    def _readable(self, *, last: bool) -> int:
        """How many of the held samples it is known how to read."""
        held = self._held
        if not held.t_ns.size or self._tells_poses is not None:
            return int(held.t_ns.size)
        if self._first is None:
            self._first = held.pose_odom_base[:1]
        moving = tells_motion(held)
        if np.any(at_other(held.pose_odom_base, self._first)):
            self._tells_poses = True
        elif moving.any():
            x, y, heading = (self._integrated(held)[-1] - self._first[0]).tolist()
            far = np.hypot(x, y) > SPEEDS_ONLY_M or abs(heading) > SPEEDS_ONLY_RAD
            if not far and not last:
                return int(np.argmax(moving))
            self._tells_poses = False
        return int(held.t_ns.size)

    def _complete(self, ready: Odometry) -> Odometry:
        if not ready.t_ns.size:
            return ready
        self._tells_speeds |= bool(np.any(tells_motion(ready)))
        if self._tells_poses is False:
            poses = self._integrated(ready)
            self._unwound = poses[-1:].copy()
            poses[:, 2] = wrap(poses[:, 2])
            return replace(ready, pose_odom_base=poses)
        if self._tells_poses and not self._tells_speeds:
            both = joined(self._given, ready)
            speed, yaw_rate = differentiated(both.t_ns, both.pose_odom_base)
            rows = slice(-1 - ready.t_ns.size, -1)
            if self._given.t_ns.size:
                return replace(ready, speed_m_s=speed[rows], yaw_rate_rad_s=yaw_rate[rows])
            speed, yaw_rate = (np.append(0.0, column[:-1]) for column in (speed, yaw_rate))
            return replace(ready, speed_m_s=speed, yaw_rate_rad_s=yaw_rate)
        return ready

    def _integrated(self, ready: Odometry) -> Floats:
        """Poses that go on from the last sample given, headings not wrapped."""
        both = joined(self._given, ready)
        start = both.pose_odom_base[:1] if self._unwound is None else self._unwound
        poses = unwound(both.t_ns, both.speed_m_s, both.yaw_rate_rad_s, start)
        return poses[self._given.t_ns.size :]


def no_odometry(source: str) -> Odometry:
    """No samples of a source."""
    return Odometry(source, np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
