from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from capture import Observations, Odometry
from geometry import Floats
from slam.config import PRESETS
from slam.ekf import EkfSlam
from slam.errors import SlamError
from slam.run import run_slam

S = 1_000_000_000
CONFIG = dataclasses.replace(PRESETS["robust"], min_seen=1)


def odometry(poses: Floats, period_s: float = 0.1) -> Odometry:
    t_ns = (np.arange(len(poses)) * period_s * S).astype(np.int64)
    return Odometry("wheel", t_ns, poses, np.zeros(len(poses)), np.zeros(len(poses)))


def straight(n: int = 11) -> Odometry:
    return odometry(np.stack([np.arange(n) * 0.1, np.zeros(n), np.zeros(n)], axis=1))


def observations(times_s: list[float], ids: list[int], ranges: list[float]) -> Observations:
    t_ns = (np.array(times_s) * S).round().astype(np.int64)
    return Observations(t_ns, np.array(ids, dtype=np.int64), np.array(ranges), np.zeros(len(ids)))


def run(driven: Odometry, seen: Observations, period_s: float = 0.0):  # type: ignore[no-untyped-def]
    return run_slam(EkfSlam(CONFIG, "known"), driven, seen, name="x", path_period_s=period_s)


def test_scans_between_odometry_samples_are_taken_where_the_car_was() -> None:
    estimate, report = run(straight(), observations([0.55], [1], [2.0]))
    assert report.scans == 1
    assert estimate.map is not None
    assert estimate.map.added_from is not None
    np.testing.assert_allclose(estimate.map.added_from[0], [0.55, 0.0], atol=1e-12)
    np.testing.assert_allclose(estimate.map.landmarks.positions[0], [2.55, 0.0], atol=1e-12)
    assert int(0.55 * S) in estimate.path.t_ns


def test_the_estimate_begins_at_its_own_origin_wherever_the_odometry_began() -> None:
    turned = straight().pose_odom_base + np.array([5.0, -3.0, 0.0])
    estimate, _ = run(odometry(turned), observations([0.5], [1], [2.0]))
    np.testing.assert_allclose(estimate.path.positions[[0, -1]], [[0, 0], [1, 0]], atol=1e-12)


def test_observations_of_one_stamp_are_one_scan() -> None:
    _, report = run(straight(), observations([0.2, 0.2, 0.4], [1, 2, 1], [2.0, 3.0, 1.8]))
    assert (report.scans, report.updates.added, report.updates.matched) == (2, 2, 1)


def test_scans_outside_the_odometry_are_left_out_and_counted() -> None:
    seen = observations([-1.0, 0.0, 0.5, 1.0, 1.5, 2.0], [1] * 6, [2.0, 2.0, 1.5, 1.0, 9.0, 9.0])
    estimate, report = run(straight(), seen)
    assert (report.scans, report.outside_odometry) == (3, 3)
    assert estimate.path.t_ns[-1] == S


def test_no_overlap_is_refused_with_both_ranges() -> None:
    with pytest.raises(SlamError, match=r"0\.000 to 1\.000 s.*100\.000 to 101\.000 s.*overlap"):
        run(straight(), observations([100.0, 101.0], [1, 1], [1.0, 1.0]))


def test_a_session_without_observations_is_refused() -> None:
    with pytest.raises(SlamError, match="no observations"):
        run(straight(), observations([], [], []))


def test_the_path_is_thinned_but_keeps_scans_and_ends() -> None:
    dense = odometry(np.zeros((1001, 3)), period_s=0.001)
    estimate, _ = run(dense, observations([0.3333], [1], [1.0]), period_s=0.05)
    assert 20 <= len(estimate.path) <= 24
    assert {0, round(0.3333 * S), S} <= set(estimate.path.t_ns.tolist())
    assert np.max(np.diff(estimate.path.t_ns)) <= 0.051 * S


def test_path_and_covariances_go_together() -> None:
    estimate, _ = run(straight(), observations([0.5], [1], [2.0]))
    assert estimate.path_covariances is not None
    assert estimate.path_covariances.shape == (len(estimate.path), 3, 3)
    assert np.all(np.diff(estimate.path_covariances[:, 0, 0]) >= -1e-15)


def test_a_run_is_deterministic() -> None:
    random = np.random.default_rng(1)
    poses = np.cumsum(random.normal(0.0, 0.05, (200, 3)), axis=0)
    times = np.sort(random.uniform(0.0, 19.0, 80))
    seen = observations(times.tolist(), [1] * 80, random.uniform(1.0, 3.0, 80).tolist())
    one, other = run(odometry(poses), seen)[0], run(odometry(poses), seen)[0]
    assert one.path.poses.tobytes() == other.path.poses.tobytes()
    assert one.path_covariances.tobytes() == other.path_covariances.tobytes()


def test_progress_is_told_every_scan() -> None:
    told: list[int] = []
    run_slam(
        EkfSlam(CONFIG, "known"),
        straight(),
        observations([0.2, 0.4], [1, 1], [2.0, 1.8]),
        name="x",
        advance=told.append,
    )
    assert told == [1, 1]
