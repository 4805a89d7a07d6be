from __future__ import annotations

import numpy as np
import pytest

from capture import Odometry
from geometry import Floats, Trajectory, compose
from visual_odometry.drift import drift_of

T_NS = 1_000_000_000 + 50_000_000 * np.arange(101, dtype=np.int64)
WAY = np.linspace(0.0, 5.0, 101)
TRUTH = Trajectory.from_poses(T_NS, compose(
    np.array([1.0, -2.0, 0.7]), np.stack([WAY, 0.0 * WAY, 0.0 * WAY], axis=1)
))  # fmt: skip


def told(pose: Floats, lost: tuple[int, ...] = ()) -> Odometry:
    kept = np.setdiff1d(np.arange(101), lost)
    zero = np.zeros(kept.size)
    return Odometry("viso", T_NS[kept], pose[kept], zero, zero, T_NS[list(lost)])


def test_a_wrong_scale_is_told() -> None:
    drift = drift_of(told(np.stack([1.02 * WAY, 0.0 * WAY, 0.0 * WAY], axis=1)), TRUTH)
    assert drift is not None
    assert drift.distance_m == pytest.approx(5.0)
    assert drift.end_m == pytest.approx(0.1)
    assert drift.per_metre == pytest.approx(0.02)
    assert drift.scale == pytest.approx(1.02)
    assert drift.heading_rad == pytest.approx(0.0)


def test_only_what_lies_between_losses_counts() -> None:
    pose = np.stack([WAY, 0.0 * WAY, 0.0 * WAY], axis=1)
    pose[40:, 0] -= 0.7
    drift = drift_of(told(pose, (39, 40)), TRUTH)
    assert drift is not None
    assert drift.distance_m == pytest.approx(3.0, abs=0.06)
    assert drift.end_m == pytest.approx(0.0, abs=1e-9)


def test_other_times_have_no_drift() -> None:
    pose = np.stack([WAY, 0.0 * WAY, 0.0 * WAY], axis=1)
    late = Trajectory.from_poses(T_NS + 10_000_000_000, TRUTH.poses)
    assert drift_of(told(pose), late) is None
