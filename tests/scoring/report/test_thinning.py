"""Thinned lines draw what the full ones draw."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from report_scores import circle

from geometry import Floats
from scoring.report.thinning import thin_path, thin_series, with_gaps


def distance_to_polyline(points: Floats, line: Floats) -> float:
    """The largest distance of any point to a polyline, by brute force."""
    start, step = line[:-1], np.diff(line, axis=0)
    square = np.maximum(np.sum(step**2, axis=1), 1e-30)
    worst = 0.0
    for point in points:
        along = np.clip(np.sum((point - start) * step, axis=1) / square, 0.0, 1.0)
        worst = max(worst, np.linalg.norm(point - start - along[:, None] * step, axis=1).min())
    return worst


def test_a_smooth_path_keeps_few_points_and_its_shape() -> None:
    path = circle(20_000)
    rows = thin_path(path)
    assert rows.size < 200
    assert distance_to_polyline(path[::50], path[rows]) <= 2.0 / 2000.0 + 1e-12


def test_a_noisy_path_keeps_the_limit() -> None:
    path = circle(9_000) + np.random.default_rng(1).normal(0.0, 0.05, (9_000, 2))
    rows = thin_path(path, limit=500)
    assert rows.size <= 500
    assert rows[0] == 0
    assert rows[-1] == 8_999


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=40))
def test_no_point_is_farther_than_the_tolerance(corners: list[tuple[int, int]]) -> None:
    path = np.array(corners, dtype=np.float64)
    rows = thin_path(path)
    assert (np.diff(rows) > 0).all()
    extent = float(np.ptp(path, axis=0).max())
    kept = path[rows] if rows.size > 1 else np.repeat(path[rows], 2, axis=0)
    assert distance_to_polyline(path, kept) <= extent / 2000.0 + 1e-9


def test_a_turning_point_on_a_line_is_kept() -> None:
    path = np.array([[0.0, 0.0], [5.0, 0.0], [1.0, 0.0]])
    assert thin_path(path).tolist() == [0, 1, 2]


def test_series_keep_first_last_least_and_greatest_of_each_bucket() -> None:
    t_s = np.arange(10_000, dtype=np.float64) * 0.01
    values = np.random.default_rng(2).normal(size=10_000)
    rows = thin_series(t_s, values, buckets=100)
    assert rows.size <= 400
    bucket = np.minimum((t_s / t_s[-1] * 100).astype(int), 99)
    for number in (0, 37, 99):
        own = np.flatnonzero(bucket == number)
        kept = np.intersect1d(rows, own)
        assert values[kept].max() == values[own].max()
        assert values[kept].min() == values[own].min()


def test_short_series_stay_whole() -> None:
    assert thin_series(np.arange(5.0), np.zeros(5)).tolist() == [0, 1, 2, 3, 4]


def test_series_with_a_long_pause_are_thinned() -> None:
    t_s = np.arange(6_000, dtype=np.float64) * 0.01
    t_s[3_000:] += 1e6
    rows = thin_series(t_s, np.sin(t_s), buckets=50)
    assert rows[0] == 0
    assert rows[-1] == 5_999


def test_lines_break_where_stamps_do() -> None:
    t_ns = np.array([0, 10, 20, 30, 900, 910, 920], dtype=np.int64)
    columns = np.arange(7.0)[:, None]
    drawn = with_gaps(t_ns, np.array([0, 2, 5, 6]), columns)[:, 0]
    np.testing.assert_array_equal(drawn, [0.0, 2.0, np.nan, 5.0, 6.0])


@pytest.mark.parametrize("n", [1, 2])
def test_short_lines_are_left_alone(n: int) -> None:
    t_ns = np.arange(n, dtype=np.int64) * 10
    assert with_gaps(t_ns, np.arange(n), np.ones((n, 2))).shape == (n, 2)
