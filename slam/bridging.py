"""Over the stretches in which a source of odometry was lost.

Such a source goes on from where it last knew itself: what the car drove meanwhile is missing in all
its later poses. The car is taken to have gone on at the mean of the speeds before and after.
"""

from __future__ import annotations

import numpy as np

from capture import Odometry
from geometry import Floats, Stamps, compose, inverse

_UNMOVED = np.zeros(3)


class Bridge:
    """Carries the poses of one source over its lost stretches, block by block.

    lost : how often it was lost; lost_s : for how long in all.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.lost_s = 0.0
        self._lost_ns: Stamps = np.zeros(0, np.int64)
        self._shift: Floats = _UNMOVED
        # Of the two samples before the block: time, told pose, speed and turn rate.
        self._before: list[tuple[int, Floats, float, float]] = []

    def carried(self, block: Odometry) -> Floats:
        """Poses (n, 3) of the next samples, with what is missing put in."""
        self._lost_ns = np.append(self._lost_ns, block.lost_t_ns)
        poses = np.empty_like(block.pose_odom_base)
        done = 0
        for row in self._rows_after_lost(block):
            poses[done:row] = self._shifted(block.pose_odom_base[done:row])
            self._cross(block, row)
            done = row
        poses[done:] = self._shifted(block.pose_odom_base[done:])
        for row in range(max(block.t_ns.size - 2, 0), block.t_ns.size):
            self._before = [*self._before[-1:], _sample(block, row)]
        return poses

    def _rows_after_lost(self, block: Odometry) -> list[int]:
        """Rows of the block before which, and after another sample, the source was lost."""
        if not block.t_ns.size or not self._lost_ns.size:
            return []
        after = np.searchsorted(block.t_ns, self._lost_ns)
        self._lost_ns = self._lost_ns[after == block.t_ns.size]
        rows = np.unique(after[after < block.t_ns.size]).tolist()
        return rows if self._before else [row for row in rows if row > 0]

    def _cross(self, block: Odometry, row: int) -> None:
        """Shift what follows by what the car drove between the samples around a lost stretch."""
        known = [*self._before, *(_sample(block, k) for k in range(max(row - 2, 0), row))]
        t_ns, told, *_ = known[-1]
        _, _, *speeds_before = known[-2] if len(known) > 1 else known[-1]
        after_ns, told_after, *speeds_after = _sample(block, row)
        lost_s = (after_ns - t_ns) * 1e-9
        driven_m, turned = 0.5 * (np.array(speeds_before) + np.array(speeds_after)) * lost_s
        moved = np.array([driven_m * np.cos(0.5 * turned), driven_m * np.sin(0.5 * turned), turned])
        there = compose(self._shifted(told), moved)
        self._shift = compose(there, inverse(told_after))
        self.lost += 1
        self.lost_s += lost_s

    def _shifted(self, poses: Floats) -> Floats:
        return poses if self._shift is _UNMOVED else compose(self._shift, poses)


def _sample(block: Odometry, row: int) -> tuple[int, Floats, float, float]:
    return (
        int(block.t_ns[row]),
        block.pose_odom_base[row],
        float(block.speed_m_s[row]),
        float(block.yaw_rate_rad_s[row]),
    )
