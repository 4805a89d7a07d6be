from __future__ import annotations

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from score_scenes import (
    estimate_of,
    landmark_map,
    lap,
    map_columns,
    ring,
    space_spiral,
    straight,
    truth_lap,
)

from capture import NO_STAMP, Estimate, EstimatedMap, GroundTruth
from dialogue import UsageError
from geometry import Floats, Trajectory, inverse, transform_points
from scoring import (
    ERROR_NAMES,
    METRIC_NAMES,
    Score,
    ScoreOptions,
    TooFewPosesError,
    UndefinedScoreError,
    score,
    score_space,
    to_json,
)

poses = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1)).map(np.array)


def _noisy(truth: GroundTruth, seed: int = 0) -> Estimate:
    """A plausible estimate: a bent path, seven of eight landmarks and one that is not there."""
    rng = np.random.default_rng(seed)
    exact = estimate_of(truth)
    path = exact.path
    landmarks, t_added_ns, added_from = map_columns(exact)
    bent = Trajectory(
        path.t_ns,
        path.x + np.cumsum(rng.normal(0, 0.003, len(path))),
        path.y + np.cumsum(rng.normal(0, 0.003, len(path))),
        path.heading + 0.01,
    )
    positions = landmarks.positions + rng.normal(0, 0.05, (8, 2))
    positions[3] += 5.0
    covariances = np.tile(np.diag([0.0025, 0.0025]), (8, 1, 1))
    return Estimate(
        "noisy",
        bent,
        EstimatedMap(landmark_map(positions, covariances), t_added_ns, added_from),
        path_covariances=np.tile(np.diag([0.01, 0.04, 0.001]), (len(path), 1, 1)),
    )


def _in_other_frame(estimate: Estimate, pose: Floats) -> Estimate:
    """The same estimate expressed in a frame that stands at `pose`."""
    back = inverse(pose)
    landmarks, t_added_ns, added_from = map_columns(estimate)
    covariances = estimate.path_covariances
    if covariances is not None:
        cos, sin = np.cos(back[2]), np.sin(back[2])
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        covariances = turn @ covariances @ turn.T
    return Estimate(
        estimate.name,
        estimate.path.transformed(back),
        EstimatedMap(landmarks.transformed(back), t_added_ns, transform_points(back, added_from)),
        covariances,
    )


def _numbers(result: Score) -> dict[str, float]:
    values = {**result.errors, **result.metrics, "total": result.total}
    return {name: np.nan if value is None else value for name, value in values.items()}


def test_a_perfect_estimate_errs_in_nothing_but_the_distance_of_adding() -> None:
    truth = truth_lap()
    result = score(truth, estimate_of(truth))
    for name in ("pose", "max_pose", "map", "false_negatives", "false_positives"):
        assert result.errors[name] == pytest.approx(0.0, abs=1e-12)
    assert result.total == result.errors["distance"]
    assert result.counts == {
        "poses": 200,
        "poses_dropped": 0,
        "coverage": 1.0,
        "span": 1.0,
        "pairs": 8,
        "distance_pairs": 8,
        "landmarks_true": 8,
        "landmarks_estimated": 8,
    }
    assert result.remarks == ()


def test_a_shifted_map_errs_by_the_shift() -> None:
    truth = truth_lap()
    result = score(truth, estimate_of(truth, shift=(0.03, -0.04)))
    assert result.errors["map"] == pytest.approx(0.05)
    assert result.metrics["map_rmse"] == pytest.approx(0.05)
    assert result.metrics["ospa"] == pytest.approx(0.05)


@given(poses)
def test_the_frame_of_the_estimate_does_not_matter(pose: Floats) -> None:
    truth = truth_lap()
    estimate = _noisy(truth)
    for align in ("origin", "path"):
        options = ScoreOptions(align=align)
        here = score(truth, estimate, options)
        there = score(truth, _in_other_frame(estimate, pose), options)
        assert _numbers(there) == pytest.approx(_numbers(here), rel=1e-6, abs=1e-8, nan_ok=True)


@given(poses)
def test_a_rigid_motion_of_the_whole_world_does_not_matter(pose: Floats) -> None:
    truth = truth_lap()
    estimate = _noisy(truth)
    assert truth.landmarks is not None
    moved = GroundTruth(truth.path.transformed(pose), truth.landmarks.transformed(pose))
    for align in ("none", "origin", "map"):
        options = ScoreOptions(align=align)
        here = score(truth, estimate, options)
        there = score(moved, _in_other_frame(estimate, inverse(pose)), options)
        assert _numbers(there) == pytest.approx(_numbers(here), rel=1e-6, abs=1e-8, nan_ok=True)


@given(st.permutations(range(8)), st.permutations(range(8)))
def test_the_order_of_landmarks_does_not_matter(true_order: list[int], order: list[int]) -> None:
    truth = truth_lap()
    estimate = _noisy(truth)
    landmarks, t_added_ns, added_from = map_columns(estimate)
    assert truth.landmarks is not None
    assert landmarks.covariances is not None
    shuffled = EstimatedMap(
        landmark_map(landmarks.positions[order], landmarks.covariances[order]),
        t_added_ns[order],
        added_from[order],
    )
    truth_shuffled = GroundTruth(truth.path, landmark_map(truth.landmarks.positions[true_order]))
    there = score(truth_shuffled, replace(estimate, map=shuffled))
    assert _numbers(there) == pytest.approx(_numbers(score(truth, estimate)), nan_ok=True)


@given(st.floats(5, 100), st.floats(0, 6.28), st.floats(0.0, 2.0))
def test_a_far_false_landmark_adds_exactly_w5(
    distance_m: float, direction: float, w5: float
) -> None:
    truth = truth_lap()
    estimate = _noisy(truth)
    landmarks, t_added_ns, added_from = map_columns(estimate)
    far = (15 + distance_m) * np.array([[np.cos(direction), np.sin(direction)]])
    more = EstimatedMap(
        landmark_map(np.concatenate([landmarks.positions, far])),
        np.append(t_added_ns, NO_STAMP),
        np.concatenate([added_from, [[np.nan, np.nan]]]),
    )
    options = ScoreOptions(weights=(1.0, 1.0, 1.0, 0.3, w5, 1.0))
    before = score(truth, estimate, options).total
    after = score(truth, replace(estimate, map=more), options).total
    assert before is not None
    assert after == pytest.approx(before + w5)


def test_the_clock_offset_moves_path_and_landmark_times_together() -> None:
    truth = truth_lap()
    estimate = estimate_of(truth)
    landmarks, t_added_ns, added_from = map_columns(estimate)
    late_ns = 3_600_000_000_000
    path = estimate.path
    late = Estimate(
        "late",
        Trajectory(path.t_ns + late_ns, path.x, path.y, path.heading),
        EstimatedMap(landmarks, t_added_ns + late_ns, added_from),
    )
    mended = score(truth, late, ScoreOptions(offset_s=-3600.0))
    assert mended.errors == pytest.approx(score(truth, estimate).errors, abs=1e-12)
    with pytest.raises(TooFewPosesError, match="do not overlap"):
        score(truth, late)


def test_the_nees_of_the_path_follows_the_alignment() -> None:
    straight_truth = GroundTruth(straight(40))
    path = straight_truth.path
    beside = Trajectory(path.t_ns, path.x, path.y + 0.1, path.heading)
    covariances = np.tile(np.diag([1.0, 0.01, 1.0]), (40, 1, 1))
    flat = Estimate("flat", beside, path_covariances=covariances)
    assert score(straight_truth, flat, ScoreOptions(align="none")).metrics["path_nees"] == (
        pytest.approx(1.0)
    )
    certain_start = np.concatenate([np.zeros((1, 3, 3)), covariances[1:]])
    result = score(straight_truth, replace(flat, path_covariances=certain_start))
    assert result.metrics["path_nees"] == pytest.approx(0.0, abs=1e-12)
    assert any("path NEES leaves out 1 of " in remark for remark in result.remarks)


def test_dropped_poses_keep_the_covariances_of_the_others() -> None:
    path = straight(40)
    sizes = np.arange(1.0, 41.0)
    covariances = np.eye(3) * sizes[:, None, None]
    truth = GroundTruth(path.selected(np.arange(40) >= 20))
    beside = Trajectory(path.t_ns, path.x, path.y + 1.0, path.heading)
    estimate = Estimate("e", beside, path_covariances=covariances)
    result = score(truth, estimate, ScoreOptions(align="none"))
    assert result.metrics["path_nees"] == pytest.approx(np.mean(1.0 / sizes[20:]))
    assert "20 of 40 poses have no true pose at their time" in result.remarks


def test_without_true_landmarks_only_the_path_is_scored() -> None:
    truth = truth_lap()
    result = score(GroundTruth(truth.path), estimate_of(truth))
    assert [result.errors[name] for name in ERROR_NAMES[2:]] == [None] * 4
    assert result.map is None
    assert result.metrics["ospa"] is None
    assert result.remarks == ("landmark errors undefined: the truth has no landmarks",)
    assert result.total == pytest.approx(0.0, abs=1e-12)


def test_without_a_map_only_the_path_is_scored() -> None:
    truth = truth_lap()
    estimate = replace(estimate_of(truth), map=None)
    result = score(truth, estimate)
    assert result.errors["false_negatives"] is None
    assert result.remarks == ("landmark errors undefined: the estimate has no map",)
    assert score(truth, estimate, ScoreOptions(strict=True)).total is None


def test_an_empty_map_misses_every_landmark() -> None:
    truth = truth_lap()
    estimate = replace(estimate_of(truth), map=EstimatedMap(landmark_map(np.zeros((0, 2)))))
    result = score(truth, estimate)
    assert result.errors["map"] is None
    assert result.errors["distance"] is None
    assert result.errors["false_negatives"] == 8.0
    assert result.total == pytest.approx(8 * 0.3)
    assert any(remark.startswith("map and distance undefined") for remark in result.remarks)


def test_a_truth_with_no_landmark_on_the_floor_makes_every_one_false() -> None:
    truth = truth_lap()
    result = score(GroundTruth(truth.path, landmark_map(np.zeros((0, 2)))), estimate_of(truth))
    assert result.errors["false_positives"] == 8.0
    assert result.errors["false_negatives"] == 0.0
    assert result.metrics["recall"] is None


def test_a_truth_of_one_pose() -> None:
    truth = truth_lap()
    one = GroundTruth(truth.path.selected(np.arange(200) == 7), truth.landmarks)
    with pytest.raises(TooFewPosesError):
        score(one, estimate_of(truth))
    result = score(one, estimate_of(truth), ScoreOptions(min_poses=1))
    assert result.errors["pose"] == pytest.approx(0.0, abs=1e-12)
    assert result.metrics["rpe_rmse"] is None
    assert result.errors["distance"] is None
    with pytest.raises(UndefinedScoreError, match="--align path"):
        score(one, estimate_of(truth), ScoreOptions(min_poses=1, align="path"))


def test_an_estimate_of_the_first_half_says_so() -> None:
    truth = truth_lap()
    estimate = estimate_of(truth)
    half = replace(estimate, path=estimate.path.selected(np.arange(200) < 100))
    assert "the estimate spans 50 % of the truth's time only" in score(truth, half).remarks


def test_a_heading_that_nothing_observed_is_told_with_its_remedy() -> None:
    truth = truth_lap()
    path = truth.path
    blind = Estimate("blind", Trajectory(path.t_ns, path.x, path.y, np.zeros(200)))
    remarks = score(truth, blind).remarks
    assert any("heading of the alignment is not observed" in r for r in remarks)
    assert any("--align path" in r for r in remarks)


def test_what_a_report_draws_is_in_the_world() -> None:
    truth = truth_lap()
    estimate = _in_other_frame(_noisy(truth), np.array([3.0, 1.0, 0.5]))
    result = score(truth, estimate)
    assert result.path is not None
    assert result.map is not None
    assert truth.landmarks is not None
    np.testing.assert_allclose(
        np.hypot(*(result.path.estimate - result.path.truth).T), result.path.position_m
    )
    rows, columns = result.map.pairs.T
    np.testing.assert_allclose(
        np.linalg.norm(
            result.map.truth.positions[rows] - result.map.estimate.positions[columns], axis=1
        ),
        result.map.distance_m,
    )
    assert result.map.missed.tolist() == [3]
    assert result.map.false.tolist() == [3]
    np.testing.assert_array_equal(result.true_path, truth.path.positions)


def test_every_result_has_every_name_and_is_json() -> None:
    truth = truth_lap()
    results = [
        score(truth, _noisy(truth)),
        score(GroundTruth(truth.path), replace(estimate_of(truth), map=None)),
        score_space(space_spiral(), space_spiral(), "spiral"),
    ]
    for result in results:
        assert tuple(result.metrics) == METRIC_NAMES
        assert tuple(result.errors) == tuple(result.weighted) == ERROR_NAMES
    json.dumps(to_json(results), allow_nan=False)


def test_scoring_leaves_its_inputs_alone() -> None:
    truth = truth_lap()
    estimate = _noisy(truth)
    before = copy.deepcopy((truth, estimate))
    score(truth, estimate, ScoreOptions(align="map", offset_s=0.001))
    assert str(before) == str((truth, estimate))
    for column, original in zip(map_columns(estimate)[1:], map_columns(before[1])[1:], strict=True):
        np.testing.assert_array_equal(column, original)
    np.testing.assert_array_equal(before[1].path.poses, estimate.path.poses)
    np.testing.assert_array_equal(before[1].path_covariances, estimate.path_covariances)


def test_a_space_path_is_scored_without_a_map() -> None:
    path = space_spiral()
    shifted = replace(path, positions=path.positions + np.array([0.0, 0.0, 0.3]))
    result = score_space(path, shifted, "up", ScoreOptions(space="3d", align="none"))
    assert result.errors["pose"] == pytest.approx(0.3)
    assert result.errors["map"] is None
    assert result.metrics["heading_rmse"] is None
    assert result.metrics["rpe_rmse"] == pytest.approx(0.0, abs=1e-12)
    aligned = score_space(path, shifted, "up", ScoreOptions(space="3d", align="path"))
    assert aligned.errors["pose"] == pytest.approx(0.0, abs=1e-9)


def test_plane_and_space_are_not_mixed_up() -> None:
    truth = truth_lap()
    with pytest.raises(UsageError, match=r"score_space\(\)"):
        score(truth, estimate_of(truth), ScoreOptions(space="3d"))
    with pytest.raises(UsageError, match=r"score\(\)"):
        score_space(space_spiral(), space_spiral(), "x", ScoreOptions())


def test_a_lap_and_its_ring_are_where_the_tests_think() -> None:
    assert lap().positions[0] == pytest.approx([2.0, 0.0])
    assert len(ring()) == 8
