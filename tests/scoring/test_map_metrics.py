from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from score_scenes import landmark_map, ring

from geometry import Floats
from scoring import ScoreOptions
from scoring.map_metrics import MAP_METRICS, cola, gospa, map_metrics, ospa
from scoring.pairing import pair_landmarks

NONE = np.zeros((0, 2))
coordinates = st.floats(-1.0, 1.0, width=32)
clouds = st.lists(st.tuples(coordinates, coordinates), max_size=5).map(
    lambda cloud: np.array(cloud, dtype=np.float64).reshape(-1, 2)
)
orders = st.sampled_from((1.0, 2.0, 3.0))


def test_ospa_and_cola_by_hand() -> None:
    truth, estimate = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.1, 0.0]])
    assert ospa(truth, estimate, 0.3, 1.0) == pytest.approx((0.1 + 0.3) / 2)
    assert ospa(truth, estimate, 0.3, 2.0) == pytest.approx(math.sqrt((0.01 + 0.09) / 2))
    assert cola(truth, estimate, 0.3, 1.0) == pytest.approx(0.4 / 0.3)
    assert cola(truth, estimate, 0.3, 2.0) == pytest.approx(math.sqrt(0.1) / 0.3)


def test_gospa_by_hand() -> None:
    truth = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    estimate = np.array([[0.1, 0.0], [5.0, 0.0]])
    one = gospa(truth, estimate, 0.6, 1.0)
    assert (one.localisation, one.missed, one.false) == pytest.approx((0.1, 0.6, 0.3))
    assert one.distance == pytest.approx(1.0)
    two = gospa(truth, estimate, 0.6, 2.0)
    assert (two.localisation, two.missed, two.false) == pytest.approx((0.01, 0.36, 0.18))
    assert two.distance == pytest.approx(math.sqrt(0.55))


def test_gospa_of_order_one_prices_errors_as_the_thesis_prices_them() -> None:
    # Cut-off 2 c: a missed or false landmark costs c, a pair its distance.
    rng = np.random.default_rng(0)
    truth = rng.uniform(0, 10, (12, 2))
    estimate = np.concatenate([truth[:9] + rng.normal(0, 0.05, (9, 2)), [[20.0, 0.0]]])
    pairs = pair_landmarks(truth, estimate, "saturated", 0.3)
    total = pairs.distance_m.sum() + 0.3 * (12 - 9) + 0.3 * 1
    assert gospa(truth, estimate, 0.6, 1.0).distance == pytest.approx(total)


def test_empty_maps() -> None:
    some = ring().positions
    assert ospa(NONE, NONE, 0.3, 1.0) == cola(NONE, NONE, 0.3, 1.0) == 0.0
    assert gospa(NONE, NONE, 0.6, 1.0).distance == 0.0
    for truth, estimate in ((some, NONE), (NONE, some)):
        assert ospa(truth, estimate, 0.3, 2.0) == pytest.approx(0.3)
        assert cola(truth, estimate, 0.3, 1.0) == pytest.approx(8.0)
        assert gospa(truth, estimate, 0.6, 1.0).distance == pytest.approx(8 * 0.3)


def _ospa_by_definition(truth: Floats, estimate: Floats, c: float, p: float) -> float:
    small, large = sorted((truth, estimate), key=len)
    if not len(large):
        return 0.0
    table = np.minimum(np.linalg.norm(small[:, None] - large[None], axis=2), c) ** p
    rows = range(len(small))
    best = min(
        sum(table[i, j] for i, j in zip(rows, order, strict=True))
        for order in itertools.permutations(range(len(large)), len(small))
    )
    return float(((best + c**p * (len(large) - len(small))) / len(large)) ** (1 / p))


def _gospa_by_definition(truth: Floats, estimate: Floats, c: float, p: float) -> float:
    table = np.linalg.norm(truth[:, None] - estimate[None], axis=2) ** p
    best = math.inf
    for columns in itertools.product([None, *range(len(estimate))], repeat=len(truth)):
        taken = [column for column in columns if column is not None]
        if len(set(taken)) == len(taken):
            pairs = [(i, j) for i, j in enumerate(columns) if j is not None]
            alone = len(truth) + len(estimate) - 2 * len(pairs)
            best = min(best, sum(table[pair] for pair in pairs) + c**p / 2 * alone)
    return float(best ** (1 / p))


@given(clouds, clouds, st.floats(0.1, 2.0), orders)
def test_set_distances_agree_with_their_definitions(
    truth: Floats, estimate: Floats, c: float, p: float
) -> None:
    expected = _ospa_by_definition(truth, estimate, c, p)
    assert ospa(truth, estimate, c, p) == pytest.approx(expected, abs=1e-6)
    larger = max(len(truth), len(estimate))
    assert cola(truth, estimate, c, p) == pytest.approx(expected * larger ** (1 / p) / c, abs=1e-6)
    parts = gospa(truth, estimate, c, p)
    assert parts.distance == pytest.approx(_gospa_by_definition(truth, estimate, c, p), abs=1e-6)
    root = (parts.localisation + parts.missed + parts.false) ** (1 / p)
    assert parts.distance == pytest.approx(root)


@given(clouds, clouds, clouds, orders)
def test_they_are_metrics(a: Floats, b: Floats, c: Floats, p: float) -> None:
    def by_ospa(x: Floats, y: Floats) -> float:
        return ospa(x, y, 0.7, p)

    def by_gospa(x: Floats, y: Floats) -> float:
        return gospa(x, y, 0.7, p).distance

    for distance in (by_ospa, by_gospa):
        assert distance(a, a) == pytest.approx(0.0, abs=1e-6)
        assert distance(a, b) == pytest.approx(distance(b, a), abs=1e-9)
        assert distance(a, c) <= distance(a, b) + distance(b, c) + 1e-6


def test_rates_of_a_map_with_one_missed_and_two_false() -> None:
    truth = ring()
    positions = np.concatenate(
        [truth.positions[1:] + np.array([0.03, 0.04]), [[9.0, 9.0], [8.0, 8.0]]]
    )
    estimate = landmark_map(positions, np.tile(np.diag([9e-4, 16e-4]), (9, 1, 1)))
    pairs = pair_landmarks(truth.positions, estimate.positions, "saturated", 0.3)
    metrics = map_metrics(truth, estimate, pairs, ScoreOptions())
    assert set(metrics) == set(MAP_METRICS)
    assert metrics["precision"] == pytest.approx(7 / 9)
    assert metrics["recall"] == pytest.approx(7 / 8)
    assert metrics["f1"] == pytest.approx(2 * 7 / (8 + 9))
    assert metrics["missed_share"] == pytest.approx(1 / 8)
    assert metrics["map_rmse"] == pytest.approx(0.05)
    assert metrics["map_nees"] == pytest.approx(2.0)
    assert metrics["map_nees_within"] == 1.0
    assert metrics["ospa"] == pytest.approx((7 * 0.05 + 2 * 0.3) / 9)


def test_rates_over_nothing_are_undefined() -> None:
    empty = landmark_map(NONE)
    pairs = pair_landmarks(NONE, NONE, "saturated", 0.3)
    metrics = map_metrics(empty, empty, pairs, ScoreOptions())
    names = ("precision", "recall", "f1", "missed_share", "map_rmse", "map_nees")
    assert {metrics[name] for name in names} == {None}
    assert metrics["ospa"] == 0.0
