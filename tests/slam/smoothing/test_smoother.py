from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from smoothing_world import CONFIG, START_NS, S, dead_reckoned, world

from geometry import Floats, LandmarkMap, between, wrap
from slam.errors import SlamError
from slam.smoothing import chain, kernels
from slam.smoothing.problem import Problem
from slam.smoothing.smoother import smooth


def dense(normal: kernels.Normal, factors: kernels.Factors) -> tuple[Floats, Floats]:
    """The normal equations as one matrix and one right side: poses, then landmarks."""
    nodes, n = normal.pose_right.shape[0], normal.landmark.shape[0]
    matrix = np.zeros((3 * nodes + 2 * n, 3 * nodes + 2 * n))
    for k in range(nodes):
        rows = slice(3 * k, 3 * k + 3)
        matrix[rows, rows] = normal.diagonal[k]
        if k:
            matrix[rows, 3 * k - 3 : 3 * k] = normal.below[k]
            matrix[3 * k - 3 : 3 * k, rows] = normal.below[k].T
    for j in range(n):
        rows = slice(3 * nodes + 2 * j, 3 * nodes + 2 * j + 2)
        matrix[rows, rows] = normal.landmark[j]
    for i, (k, j) in enumerate(zip(factors.node.tolist(), factors.slot.tolist(), strict=True)):
        rows, columns = slice(3 * k, 3 * k + 3), slice(3 * nodes + 2 * j, 3 * nodes + 2 * j + 2)
        matrix[rows, columns] += normal.mixed[i]
        matrix[columns, rows] += normal.mixed[i].T
    return matrix, np.concatenate([normal.pose_right.ravel(), normal.landmark_right.ravel()])


def residuals(unknown: Floats, problem: Problem) -> Floats:
    """Whitened residuals in plain numpy, the first pose held."""
    f, nodes = problem.factors, problem.node_ns.size
    poses = np.concatenate([problem.poses[:1], unknown[: 3 * nodes - 3].reshape(-1, 3)])
    landmarks = unknown[3 * nodes - 3 :].reshape(-1, 2)
    off = between(poses[:-1], poses[1:]) - f.motion
    off[:, 2] = wrap(off[:, 2])
    root = np.linalg.cholesky(f.motion_information).transpose(0, 2, 1)
    way = landmarks[f.slot] - poses[f.node, :2]
    seen = np.stack(
        [
            np.hypot(*way.T) - f.range_m,
            wrap(np.arctan2(way[:, 1], way[:, 0]) - poses[f.node, 2] - f.bearing_rad),
        ],
        axis=1,
    )
    odometry = np.einsum("kij,kj->ki", root, off)
    return np.concatenate([odometry.ravel(), (seen * np.sqrt(f.information)).ravel()])


def unknowns(poses: Floats, landmarks: Floats) -> Floats:
    return np.concatenate([poses[1:].ravel(), landmarks.ravel()])


@pytest.mark.parametrize("loss", ["none", "huber", "cauchy"])
def test_right_sides_are_the_gradient_of_the_cost(loss: str) -> None:
    config = dataclasses.replace(CONFIG, loss=loss, loss_scale=1.5)
    problem = world(duration_s=4.0, outliers=0.3).problem(config)
    normal = kernels.linearise(problem.poses, problem.landmarks, problem.factors)
    for k, i in [(1, 0), (1, 1), (2, 2), (4, 0), (problem.node_ns.size - 1, 2)]:
        sides = []
        for h in (1e-6, -1e-6):
            poses = problem.poses.copy()
            poses[k, i] += h
            sides.append(kernels.cost(poses, problem.landmarks, problem.factors))
        slope = (sides[0] - sides[1]) / 2e-6
        assert normal.pose_right[k, i] == pytest.approx(-0.5 * slope, rel=1e-5, abs=1e-3)
    for j in range(2):
        for i in range(2):
            sides = []
            for h in (1e-6, -1e-6):
                landmarks = problem.landmarks.copy()
                landmarks[j, i] += h
                sides.append(kernels.cost(problem.poses, landmarks, problem.factors))
            slope = (sides[0] - sides[1]) / 2e-6
            assert normal.landmark_right[j, i] == pytest.approx(-0.5 * slope, rel=1e-5, abs=1e-3)


def test_the_matrix_is_that_of_jacobians_by_differences() -> None:
    problem = world(duration_s=4.0).problem()
    start = unknowns(problem.poses, problem.landmarks)
    columns = []
    for i in range(start.size):
        h = np.zeros(start.size)
        h[i] = 1e-6
        columns.append((residuals(start + h, problem) - residuals(start - h, problem)) / 2e-6)
    slopes = np.stack(columns, axis=1)
    normal = kernels.linearise(problem.poses, problem.landmarks, problem.factors)
    matrix, right = dense(normal, problem.factors)
    expected = slopes.T @ slopes
    np.testing.assert_allclose(matrix[3:, 3:], expected, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(
        right[3:], -slopes.T @ residuals(start, problem), atol=1e-6 * np.abs(right).max()
    )
    assert not matrix[:3, 3:].any()


def test_elimination_gives_the_step_and_covariances_of_the_dense_equations() -> None:
    problem = world(duration_s=6.0).problem()
    factors, nodes = problem.factors, problem.node_ns.size
    normal = kernels.linearise(problem.poses, problem.landmarks, factors)
    matrix, right = dense(normal, factors)
    diagonal, below, positive = chain.factor_chain(normal, 0.0)
    assert positive
    reduced, side = chain.schur(diagonal, below, normal, factors, 0.0)
    whole = np.tril(reduced) + np.tril(reduced, -1).T
    step = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(np.linalg.solve(whole, side), step[3 * nodes :], atol=1e-9)
    poses = normal.pose_right[:, :, None] - chain.mixed_product(
        normal, factors, np.ascontiguousarray(step[3 * nodes :, None])
    )
    chain.solve_chain(diagonal, below, poses)
    np.testing.assert_allclose(poses.ravel(), step[: 3 * nodes], atol=1e-9)
    inverse = np.linalg.inv(matrix[: 3 * nodes, : 3 * nodes])
    for k, block in enumerate(chain.chain_covariances(diagonal, below)):
        expected = inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(block, expected, rtol=1e-7, atol=1e-12)


def test_it_comes_where_scipy_comes_and_claims_its_covariances() -> None:
    drive = world(duration_s=12.0)
    problem, estimate = drive.problem(), drive.smoothed()
    start = unknowns(problem.poses, problem.landmarks)
    found = least_squares(residuals, start, args=(problem,), method="trf", xtol=1e-12, ftol=1e-12)
    assert estimate.map is not None
    landmarks = found.x[3 * problem.node_ns.size - 3 :].reshape(-1, 2)
    rows = [problem.landmark_ids.tolist().index(i) for i in estimate.map.landmarks.ids.tolist()]
    np.testing.assert_allclose(estimate.map.landmarks.positions, landmarks[rows], atol=2e-5)
    at = np.searchsorted(estimate.path.t_ns, problem.node_ns)
    poses = found.x[: 3 * problem.node_ns.size - 3].reshape(-1, 3)
    np.testing.assert_allclose(estimate.path.poses[at[1:]], poses, atol=2e-5)
    slopes = np.asarray(found.jac, dtype=np.float64)
    covariance = np.linalg.inv(slopes.T @ slopes)
    assert estimate.map.landmarks.covariances is not None
    assert estimate.path_covariances is not None
    first = 3 * problem.node_ns.size - 3
    for row, block in zip(rows, estimate.map.landmarks.covariances, strict=True):
        place = slice(first + 2 * row, first + 2 * row + 2)
        np.testing.assert_allclose(block, covariance[place, place], rtol=1e-3, atol=1e-9)
    for k in range(1, problem.node_ns.size):
        block = covariance[3 * k - 3 : 3 * k, 3 * k - 3 : 3 * k]
        np.testing.assert_allclose(estimate.path_covariances[at[k]], block, rtol=1e-3, atol=1e-8)
    assert not estimate.path_covariances[0].any()


@pytest.mark.parametrize("loss", ["none", "huber", "cauchy"])
def test_without_noise_a_bent_estimate_is_straightened_exactly(loss: str) -> None:
    drive = world(noise=0.0)
    bent = drive.odometry.pose_odom_base.copy()
    bent[:, 2] += np.linspace(0.0, 0.3, len(bent))
    bent[:, 0] += np.linspace(0.0, 0.4, len(bent))
    wrong = dead_reckoned(
        dataclasses.replace(drive.odometry, pose_odom_base=bent), drive.observations
    )
    found = smooth(
        wrong, drive.odometry, drive.observations, drive.ids, dataclasses.replace(CONFIG, loss=loss)
    )
    assert drive.path_error_m(wrong) > 0.1
    assert drive.path_error_m(found) < 1e-7
    assert drive.map_error_m(found) < 1e-7
    told = found.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["converged"] is True
    assert told["cost_after"] < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_smoothing_beats_dead_reckoning(seed: int) -> None:
    drive = world(seed, duration_s=60.0)
    found = drive.smoothed()
    assert drive.path_error_m(found) < 0.06
    assert drive.path_error_m(found) < 0.25 * drive.path_error_m(drive.estimate)
    assert drive.map_error_m(found) < 0.06


@pytest.mark.parametrize("seed", range(3))
def test_a_robust_loss_bears_one_outlier_in_ten(seed: int) -> None:
    clean, dirty = world(seed, duration_s=60.0), world(seed, duration_s=60.0, outliers=0.1)
    cauchy = dataclasses.replace(CONFIG, loss="cauchy")
    huber = dataclasses.replace(CONFIG, loss="huber", loss_scale=1.5)
    quadratic_m = dirty.path_error_m(dirty.smoothed())
    for robust in (cauchy, huber):
        assert dirty.path_error_m(dirty.smoothed(robust)) < 0.45 * quadratic_m
        assert dirty.path_error_m(dirty.smoothed(robust)) < 0.06
        assert dirty.map_error_m(dirty.smoothed(robust)) < 0.06
    assert clean.path_error_m(clean.smoothed(cauchy)) < 0.06


def test_claimed_covariances_are_those_of_the_errors() -> None:
    """Average NEES of the last pose, 40 runs, 3 degrees of freedom: 99.9 % bounds."""
    total = 0.0
    for seed in range(40):
        drive = world(100 + seed, duration_s=10.0)
        found = drive.smoothed()
        at = int(np.searchsorted(found.path.t_ns, drive.problem().node_ns[-1]))
        off = found.path.poses[at] - drive.truth.interpolated(found.path.t_ns[at : at + 1]).poses[0]
        off[2] = float(wrap(off[2]))
        assert found.path_covariances is not None
        total += float(off @ np.linalg.solve(found.path_covariances[at], off))
    assert 1.9 < total / 40 < 4.4


def test_stamps_first_pose_histories_and_provenance_are_kept() -> None:
    drive = world()
    found = drive.smoothed()
    np.testing.assert_array_equal(found.path.t_ns, drive.estimate.path.t_ns)
    np.testing.assert_array_equal(found.path.poses[0], drive.estimate.path.poses[0])
    assert found.map is not None
    assert drive.estimate.map is not None
    np.testing.assert_array_equal(found.map.landmarks.ids, drive.estimate.map.landmarks.ids)
    np.testing.assert_array_equal(found.map.t_added_ns, drive.estimate.map.t_added_ns)
    np.testing.assert_array_equal(found.map.n_seen, found.map.landmarks.ids * 7)
    assert found.map.added_from is None
    assert found.provenance["algorithm"] == "none"
    told = found.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["observations_used"] == drive.ids.size
    assert told["cost_after"] < told["cost_before"]


def test_a_frame_that_does_not_begin_at_the_origin_is_kept() -> None:
    drive, shift = world(), np.array([3.0, -2.0, 2.0])
    assert drive.estimate.map is not None
    moved = dataclasses.replace(
        drive.estimate,
        path=drive.estimate.path.transformed(shift),
        map=dataclasses.replace(
            drive.estimate.map, landmarks=drive.estimate.map.landmarks.transformed(shift)
        ),
    )
    there = smooth(moved, drive.odometry, drive.observations, drive.ids, CONFIG)
    expected = drive.smoothed().path.transformed(shift)
    np.testing.assert_allclose(there.path.positions, expected.positions, atol=1e-6)


def test_between_scans_the_path_follows_the_odometry() -> None:
    drive = world(noise=0.0)
    assert drive.path_error_m(drive.smoothed()) < 1e-7
    noisy = world(5)
    found = noisy.smoothed()
    told = noisy.estimate.path.poses
    off = between(found.path.poses[:-1], found.path.poses[1:]) - between(told[:-1], told[1:])
    assert np.abs(off).max() < 0.03


def test_while_the_car_stands_its_pose_stays() -> None:
    drive = world(3)
    found = drive.smoothed()
    after = (found.path.t_ns - START_NS) * 1e-9
    halt = found.path.poses[(after > 8.15) & (after < 9.85)]
    assert len(halt) > 15
    assert np.ptp(halt, axis=0).max() < 1e-4


def test_unused_observations_and_unseen_landmarks_are_left_out() -> None:
    drive = world()
    ids = drive.ids.copy()
    ids[ids == 2] = -1
    ids[::7] = 99
    found = smooth(drive.estimate, drive.odometry, drive.observations, ids, CONFIG)
    assert found.map is not None
    assert 2 not in found.map.landmarks.ids
    np.testing.assert_array_equal(found.map.n_seen, found.map.landmarks.ids * 7)
    told = found.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["observations_left_out"] == np.count_nonzero((ids < 0) | (ids == 99))


def test_observations_that_are_no_numbers_are_left_out() -> None:
    drive = world()
    drive.observations.range_m[3], drive.observations.bearing_rad[8] = np.nan, np.inf
    found = drive.smoothed()
    told = found.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["observations_left_out"] == 2
    assert drive.path_error_m(found) < 0.06


def test_one_scan_at_the_first_stamp_moves_nothing() -> None:
    drive = world(noise=0.0)
    first = dataclasses.replace(
        drive.observations, t_ns=np.full(drive.ids.size, drive.odometry.t_ns[0])
    )
    once = np.zeros(drive.ids.size, dtype=np.bool_)
    once[np.unique(drive.ids, return_index=True)[1]] = True
    found = smooth(drive.estimate, drive.odometry, first, np.where(once, drive.ids, -1), CONFIG)
    np.testing.assert_allclose(found.path.poses, drive.estimate.path.poses, atol=1e-9)


def test_landmarks_are_named_by_the_filter_and_not_by_the_observation() -> None:
    """The ids are the filter's own, as they are with nearest association."""
    drive = world()
    assert drive.estimate.map is not None
    renamed = dataclasses.replace(
        drive.estimate,
        map=dataclasses.replace(
            drive.estimate.map,
            landmarks=LandmarkMap(
                drive.estimate.map.landmarks.ids + 40, drive.estimate.map.landmarks.positions
            ),
        ),
    )
    found = smooth(renamed, drive.odometry, drive.observations, drive.ids + 40, CONFIG)
    np.testing.assert_allclose(found.path.poses, drive.smoothed().path.poses, atol=1e-12)


def test_the_same_data_give_the_same_bits() -> None:
    one, two = world().smoothed(), world().smoothed()
    np.testing.assert_array_equal(one.path.poses, two.path.poses)
    np.testing.assert_array_equal(one.path_covariances, two.path_covariances)


def test_an_iteration_limit_is_told() -> None:
    found = world().smoothed(dataclasses.replace(CONFIG, max_iterations=1))
    told = found.provenance["smoothing"]
    assert isinstance(told, dict)
    assert told["converged"] is False


def test_parts_that_do_not_belong_together_are_refused() -> None:
    drive = world()
    with pytest.raises(SlamError, match=r"1 associations for \d+ observations"):
        smooth(drive.estimate, drive.odometry, drive.observations, drive.ids[:1], CONFIG)
    with pytest.raises(SlamError, match="has no landmarks"):
        smooth(
            dataclasses.replace(drive.estimate, map=None),
            drive.odometry,
            drive.observations,
            drive.ids,
            CONFIG,
        )
    with pytest.raises(SlamError, match=r"none of .* belongs to one of its 6 landmarks"):
        smooth(drive.estimate, drive.odometry, drive.observations, drive.ids * 0 - 1, CONFIG)
    late = dataclasses.replace(drive.odometry, t_ns=drive.odometry.t_ns + S)
    with pytest.raises(SlamError, match="the odometry that the estimate was made from"):
        smooth(drive.estimate, late, drive.observations, drive.ids, CONFIG)


@pytest.mark.realdata
@pytest.mark.slow
def test_five_real_robots_are_smoothed_as_well_as_promised(data_dir: Path) -> None:
    script = Path(__file__).parents[3] / "benchmarks" / "smoothing.py"
    command = [sys.executable, str(script), str(data_dir / "mrclam")]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    lines = printed.splitlines()
    for figure in ("mean path", "mean map", "slowest"):
        row = next(line for line in lines if line.startswith(f"| {figure} "))
        assert "| met |" in row, printed
    robots = [line.split("|") for line in lines if line.startswith("| robot ")]
    assert [cells[8].strip() for cells in robots] == ["15"] * 5, printed
