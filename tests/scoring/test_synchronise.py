from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from score_scenes import START_NS, lap, space_spiral, stamps, straight

from geometry import Trajectory
from scoring import ScoreOptions, TooFewPosesError
from scoring.synchronise import _mutual_nearest, synchronise


def _delayed(path: Trajectory, delay_ns: int) -> Trajectory:
    return Trajectory(path.t_ns + delay_ns, path.x, path.y, path.heading)


def test_the_truth_is_interpolated_at_the_stamps_of_the_estimate() -> None:
    truth = straight(50)
    estimate = _delayed(straight(40), 12_500_000)
    paired = synchronise(truth, estimate, ScoreOptions())
    np.testing.assert_array_equal(paired.truth.t_ns, estimate.t_ns)
    np.testing.assert_allclose(paired.truth.x, estimate.x + 0.0125, atol=1e-12)
    assert paired.coverage == 1.0
    assert paired.dropped == 0


def test_heading_is_interpolated_along_the_shorter_arc() -> None:
    truth = Trajectory(stamps(2), np.zeros(2), np.zeros(2), np.array([3.1, -3.1]))
    estimate = Trajectory(stamps(1) + 25_000_000, np.zeros(1), np.zeros(1), np.zeros(1))
    paired = synchronise(truth, estimate, ScoreOptions(min_poses=1))
    assert abs(paired.truth.heading[0]) == pytest.approx(np.pi)


def test_nothing_is_extrapolated_and_nothing_taken_from_a_gap() -> None:
    whole = straight(100)
    t_s = (whole.t_ns - START_NS) * 1e-9
    truth = whole.selected((t_s < 1.0) | (t_s > 2.0))
    estimate = _delayed(straight(120), -1_000_000_000)
    paired = synchronise(truth, estimate, ScoreOptions(max_gap_s=0.25))
    seconds = (paired.truth.t_ns - START_NS) * 1e-9
    assert seconds.min() >= 0.0
    assert seconds.max() <= 4.95
    assert not np.any((seconds > 0.95 + 1e-9) & (seconds < 2.05 - 1e-9))
    assert paired.dropped == 120 - len(paired.truth)
    assert paired.coverage == len(paired.truth) / 120
    wide = synchronise(truth, estimate, ScoreOptions(max_gap_s=2.0))
    assert len(wide.truth) > len(paired.truth)


def test_nearest_uses_each_stamp_once() -> None:
    truth = straight(50)
    doubled = Trajectory(
        np.sort(np.concatenate([truth.t_ns + 1_000_000, truth.t_ns + 2_000_000])),
        np.zeros(100),
        np.zeros(100),
        np.zeros(100),
    )
    paired = synchronise(truth, doubled, ScoreOptions(sync="nearest"))
    assert len(paired.truth) == 50
    np.testing.assert_array_equal(paired.estimate.t_ns, truth.t_ns + 1_000_000)
    np.testing.assert_array_equal(paired.rows, np.arange(0, 100, 2))


def test_nearest_takes_a_difference_of_exactly_the_limit() -> None:
    truth = straight(20)
    late = _delayed(truth, 20_000_000)
    assert len(synchronise(truth, late, ScoreOptions(sync="nearest", max_diff_s=0.02)).truth) == 20
    with pytest.raises(TooFewPosesError, match=r"--max-diff above 0\.0199"):
        synchronise(truth, late, ScoreOptions(sync="nearest", max_diff_s=0.0199))


@given(
    st.sets(st.integers(0, 300), min_size=1, max_size=30),
    st.sets(st.integers(0, 300), min_size=1, max_size=30),
)
def test_mutual_nearest_agrees_with_its_definition(first: set[int], second: set[int]) -> None:
    a, b = (np.array(sorted(s), dtype=np.int64) * 1_000_000 for s in (first, second))
    rows_a, rows_b = _mutual_nearest(a, b, max_diff_s=0.02)
    table = np.abs(a[:, None] - b[None, :])
    expected = [
        (i, j)
        for i in range(a.size)
        for j in range(b.size)
        if table[i, j] <= 20_000_000
        and i == int(np.argmin(table[:, j]))
        and j == int(np.argmin(table[i]))
    ]
    assert list(zip(rows_a.tolist(), rows_b.tolist(), strict=True)) == expected


def test_paths_in_space_pair_the_same_way() -> None:
    path = space_spiral()
    for options in (ScoreOptions(space="3d"), ScoreOptions(space="3d", sync="nearest")):
        paired = synchronise(path, path, options)
        np.testing.assert_allclose(paired.truth.positions, path.positions, atol=1e-12)


def test_the_span_is_the_share_of_the_truths_time() -> None:
    truth = lap(201)
    half = truth.selected(np.arange(201) <= 100)
    assert synchronise(truth, half, ScoreOptions()).span == pytest.approx(0.5)


def test_ranges_that_do_not_overlap_are_told_with_the_offset_that_mends_them() -> None:
    truth = straight(50)
    estimate = _delayed(truth, 3_600_000_000_000)
    with pytest.raises(TooFewPosesError) as caught:
        synchronise(truth, estimate, ScoreOptions())
    text = str(caught.value)
    assert "0 of 50 poses" in text
    assert "20.0 Hz" in text
    assert "1700000000.000 to 1700000002.450 s" in text
    assert "3597.6 s apart; a clock set to another zone? --offset -3600.000" in text


def test_the_proposed_offset_adds_to_the_one_in_force() -> None:
    truth = straight(50)
    estimate = _delayed(truth, 3_600_000_000_000)
    with pytest.raises(TooFewPosesError, match=r"offset 5 s.*--offset -3595\.000"):
        synchronise(truth, estimate, ScoreOptions(offset_s=5.0))


def test_a_truth_of_one_pose_needs_min_poses_1_and_an_equal_stamp() -> None:
    truth, estimate = straight(1), straight(50)
    with pytest.raises(TooFewPosesError, match="1 of 50 poses"):
        synchronise(truth, estimate, ScoreOptions())
    for sync in ("interpolate", "nearest"):
        paired = synchronise(truth, estimate, ScoreOptions(min_poses=1, sync=sync))
        assert paired.rows.tolist() == [0]
        assert paired.span == 1.0
