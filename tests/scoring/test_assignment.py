from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import Floats
from scoring import assignment
from scoring.assignment import cheapest_matching, least_total_distance, near_pairs

coordinates = st.floats(-1.0, 1.0, width=32)
clouds = st.lists(st.tuples(coordinates, coordinates), max_size=5)


def _points(cloud: list[tuple[float, float]]) -> Floats:
    return np.array(cloud, dtype=np.float64).reshape(-1, 2)


def _least_by_brute_force(table: Floats, cutoff: float) -> float:
    """Least sum of min(d, c) over all one-to-one assignments of the smaller side."""
    if table.shape[0] > table.shape[1]:
        table = table.T
    cut = np.minimum(table, cutoff)
    n, m = cut.shape
    rows = np.arange(n)
    return min(float(cut[rows, list(p)].sum()) for p in itertools.permutations(range(m), n))


def _scipy_least(table: Floats) -> float:
    from scipy.optimize import linear_sum_assignment

    return float(table[linear_sum_assignment(table)].sum())


def _table(first: Floats, second: Floats) -> Floats:
    distances: Floats = np.linalg.norm(first[:, None] - second[None], axis=2)
    return distances


@given(clouds, clouds, st.floats(0.05, 3.0))
def test_the_matching_is_the_cheapest_of_all(
    first: list[tuple[float, float]], second: list[tuple[float, float]], cutoff: float
) -> None:
    a, b = _points(first), _points(second)
    near = near_pairs(a, b, cutoff)
    chosen = cheapest_matching(near, np.minimum(near.distance_m, cutoff), cutoff)
    smaller = min(len(a), len(b))
    cost = chosen.distance_m.sum() + cutoff * (smaller - chosen.rows.size)
    assert cost == pytest.approx(_least_by_brute_force(_table(a, b), cutoff), abs=1e-7)
    assert len(set(chosen.rows.tolist())) == len(set(chosen.columns.tolist())) == chosen.rows.size
    np.testing.assert_allclose(chosen.distance_m, _table(a, b)[chosen.rows, chosen.columns])


@pytest.mark.parametrize(("n", "m", "side"), [(64, 64, 3.0), (80, 50, 4.0), (50, 90, 1.0)])
def test_larger_maps_agree_with_scipy(n: int, m: int, side: float) -> None:
    rng = np.random.default_rng(n)
    a, b = rng.uniform(0, side, (n, 2)), rng.uniform(0, side, (m, 2))
    for cutoff in (0.1, 0.4, 2.0):
        near = near_pairs(a, b, cutoff)
        chosen = cheapest_matching(near, near.distance_m, cutoff)
        cost = chosen.distance_m.sum() + cutoff * (min(n, m) - chosen.rows.size)
        assert cost == pytest.approx(_scipy_least(np.minimum(_table(a, b), cutoff)), abs=1e-6)


@given(clouds, clouds)
def test_without_a_cutoff_every_point_of_the_smaller_set_is_paired(
    first: list[tuple[float, float]], second: list[tuple[float, float]]
) -> None:
    a, b = _points(first), _points(second)
    pairs = least_total_distance(a, b)
    assert pairs.rows.size == min(len(a), len(b))
    assert np.all(np.diff(pairs.rows) > 0)
    assert pairs.distance_m.sum() == pytest.approx(_least_by_brute_force(_table(a, b), np.inf))


def test_a_dense_problem_beyond_the_plain_limit_is_solved_the_same() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.uniform(0, 1, (70, 2)), rng.uniform(0, 1, (75, 2))
    assert near_pairs(a, b, 2.0).rows.size > assignment.PLAIN_LIMIT
    pairs = least_total_distance(a, b)
    assert pairs.rows.tolist() == list(range(70))
    assert pairs.distance_m.sum() == pytest.approx(_scipy_least(_table(a, b)))


def test_both_solvers_leave_out_the_same_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    a, b = rng.uniform(0, 1, (20, 2)), rng.uniform(0, 1, (20, 2))
    near = near_pairs(a, b, 0.25)
    plain = cheapest_matching(near, near.distance_m, 0.25)
    monkeypatch.setattr(assignment, "PLAIN_LIMIT", 0)
    monkeypatch.setattr(assignment, "_mostly_near", lambda _: True)
    dense = cheapest_matching(near, near.distance_m, 0.25)
    np.testing.assert_array_equal(plain.rows, dense.rows)
    np.testing.assert_array_equal(plain.columns, dense.columns)


def test_the_tree_finds_the_pairs_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    a = rng.uniform(0, 5, (60, 2))
    b = np.concatenate([a[:10], rng.uniform(0, 5, (50, 2))])
    by_table = near_pairs(a, b, 0.5)
    monkeypatch.setattr(assignment, "DENSE_LIMIT", 0)
    by_tree = near_pairs(a, b, 0.5)
    np.testing.assert_array_equal(by_table.rows, by_tree.rows)
    np.testing.assert_array_equal(by_table.columns, by_tree.columns)
    np.testing.assert_allclose(by_table.distance_m, by_tree.distance_m, atol=1e-12)
    assert np.count_nonzero(by_tree.distance_m == 0.0) == 10


def test_a_thousand_landmarks_need_no_full_table() -> None:
    rng = np.random.default_rng(6)
    a = rng.uniform(0, 100, (1200, 2))
    b = a[::-1] + rng.normal(0, 0.01, a.shape)
    near = near_pairs(a, b, 0.3)
    chosen = cheapest_matching(near, near.distance_m, 0.3)
    assert chosen.rows.size == 1200
    assert np.mean(chosen.columns == 1199 - chosen.rows) > 0.99


def test_an_augmenting_path_runs_through_rows_placed_before() -> None:
    # Each row is nearest to the column that the row before it has taken.
    cost = {(0, 0): 0.10, (1, 0): 0.10, (1, 1): 0.20, (2, 1): 0.10, (2, 2): 0.29, (3, 2): 0.10}
    rows, columns = (np.array([key[axis] for key in cost]) for axis in (0, 1))
    near = assignment.NearPairs(rows, columns, np.array(list(cost.values())))
    chosen = cheapest_matching(near, near.distance_m, 0.3)
    assert list(zip(chosen.rows.tolist(), chosen.columns.tolist(), strict=True)) == [
        (0, 0),
        (2, 1),
        (3, 2),
    ]
