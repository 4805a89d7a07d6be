from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry import Floats
from scoring.pairing import pair_landmarks

RULES = ("saturated", "max-pairs", "assign-then-cut", "greedy")

clouds = st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), max_size=5, unique=True).map(
    lambda cells: np.array(cells, dtype=np.float64).reshape(-1, 2) * 0.1
)


def _on_line(*places: float) -> Floats:
    return np.array([(x, 0.0) for x in places])


def _pairs(
    truth: Floats, estimate: Floats, rule: str, cutoff: float = 0.3
) -> list[tuple[int, int]]:
    found = pair_landmarks(truth, estimate, rule, cutoff)
    return list(zip(found.rows.tolist(), found.columns.tolist(), strict=True))


def test_the_rules_differ_where_one_pair_is_worth_two() -> None:
    # 0.22 + 0.3 is less than 0.28 + 0.25, but two pairs are more than one.
    truth, estimate = _on_line(0.0, 0.5), _on_line(0.28, 0.75)
    assert _pairs(truth, estimate, "saturated") == [(1, 0)]
    assert _pairs(truth, estimate, "greedy") == [(1, 0)]
    assert _pairs(truth, estimate, "max-pairs") == [(0, 0), (1, 1)]
    assert _pairs(truth, estimate, "assign-then-cut") == [(0, 0), (1, 1)]


def test_an_assignment_made_before_the_cut_pays_for_far_landmarks() -> None:
    # One cone is 10 m off: without the cut-off it decides which of the others is taken.
    truth = np.array([[0.0, 0.0], [10.0, 0.0]])
    estimate = np.array([[0.1, 0.0], [-0.05, 0.0]])
    assert _pairs(truth, estimate, "saturated") == [(0, 1)]
    assert _pairs(truth, estimate, "assign-then-cut") == [(0, 1)]
    assert _pairs(truth[::-1], estimate, "assign-then-cut") == [(1, 1)]
    bent = np.array([[0.0, 0.1], [0.05, 0.0]])
    assert _pairs(truth, bent, "assign-then-cut") == [(0, 0)]
    assert _pairs(truth, bent, "saturated") == [(0, 1)]


def test_greedy_takes_the_nearest_first() -> None:
    truth, estimate = _on_line(0.0, 0.25), _on_line(0.2, 0.52)
    assert _pairs(truth, estimate, "greedy") == [(1, 0)]
    assert _pairs(truth, estimate, "saturated") == [(1, 0)]
    truth, estimate = _on_line(0.0, 0.2), _on_line(0.15, 0.45)
    assert _pairs(truth, estimate, "greedy") == [(1, 0)]
    assert _pairs(truth, estimate, "max-pairs") == [(0, 0), (1, 1)]


@pytest.mark.parametrize("rule", RULES)
def test_a_distance_of_exactly_the_cutoff_is_a_pair(rule: str) -> None:
    assert _pairs(_on_line(1.0), _on_line(1.3), rule) == [(0, 0)]
    assert _pairs(_on_line(1.0), _on_line(1.3001), rule) == []


@pytest.mark.parametrize("rule", RULES)
def test_empty_maps_have_no_pairs(rule: str) -> None:
    none, one = np.zeros((0, 2)), _on_line(0.0)
    for truth, estimate in ((none, one), (one, none), (none, none)):
        assert _pairs(truth, estimate, rule) == []


@pytest.mark.parametrize("rule", RULES)
def test_ties_go_to_the_lower_row(rule: str) -> None:
    assert _pairs(_on_line(0.0), _on_line(0.1, -0.1), rule) == [(0, 0)]
    assert _pairs(_on_line(0.1, -0.1), _on_line(0.0), rule) == [(0, 0)]


@given(clouds, clouds, st.sampled_from((0.1, 0.25, 0.3, 1.0)))
def test_each_rule_reaches_its_own_optimum(truth: Floats, estimate: Floats, cutoff: float) -> None:
    table = np.linalg.norm(truth[:, None] - estimate[None], axis=2)
    every = [
        [(i, j) for i, j in enumerate(columns) if j is not None]
        for columns in itertools.product([None, *range(len(estimate))], repeat=len(truth))
        if len({c for c in columns if c is not None}) == sum(1 for c in columns if c is not None)
    ]
    near = [pairs for pairs in every if all(table[p] <= cutoff + 1e-9 for p in pairs)]

    def saturated(pairs: list[tuple[int, int]]) -> float:
        return float(sum(table[p] - cutoff for p in pairs))

    def most(pairs: list[tuple[int, int]]) -> tuple[int, float]:
        return -len(pairs), sum(table[p] for p in pairs)

    found = _pairs(truth, estimate, "saturated", cutoff)
    assert saturated(found) == pytest.approx(min(map(saturated, near)), abs=1e-8)
    found = _pairs(truth, estimate, "max-pairs", cutoff)
    assert most(found) == pytest.approx(min(map(most, near)), abs=1e-8)


@given(clouds, clouds, st.sampled_from(RULES))
def test_pairs_are_one_to_one_and_near(truth: Floats, estimate: Floats, rule: str) -> None:
    found = pair_landmarks(truth, estimate, rule, 0.3)
    assert len(set(found.rows.tolist())) == len(set(found.columns.tolist())) == found.rows.size
    assert np.all(found.distance_m <= 0.3 + 1e-9)
    assert np.all(np.diff(found.rows) > 0)
    again = np.linalg.norm(truth[found.rows] - estimate[found.columns], axis=1)
    np.testing.assert_allclose(found.distance_m, again, atol=1e-12)
