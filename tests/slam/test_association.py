from __future__ import annotations

import numpy as np
from dense import full, numeric_jacobian, observe
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from geometry import Floats, wrap
from slam.association import (
    IGNORED,
    NEW,
    expectations,
    nearest_compatible,
    squared_distance,
    squared_distances,
)
from slam.config import ObservationNoise
from slam.observation import noise_array

NOISE = noise_array(
    ObservationNoise(range_sigma_m=0.05, bearing_sigma_rad=0.03, range_sigma_per_m=0.02)
)


def random_state(n: int, seed: int) -> tuple[Floats, Floats]:
    random = np.random.default_rng(seed)
    x = random.uniform(-3.0, 3.0, 3 + 2 * n)
    root = random.normal(0.0, 0.05, (x.size, x.size))
    return x, root @ root.T + 1e-4 * np.eye(x.size)


@given(seed=st.integers(0, 500))
def test_distances_are_those_of_the_full_matrices(seed: int) -> None:
    n = 4
    x, P = random_state(n, seed)
    random = np.random.default_rng(seed + 1)
    ranges, bearings = random.uniform(0.2, 4.0, 3), random.uniform(-np.pi, np.pi, 3)
    ours = squared_distances(expectations(x, np.tril(P), n), ranges, bearings, NOISE)
    for i in range(3):
        R = np.diag([0.05**2 + (0.02 * ranges[i]) ** 2, 0.03**2])
        for slot in range(n):
            j = 3 + 2 * slot
            H = numeric_jacobian(lambda state, j=j: observe(state, j), x)
            nu = np.array([ranges[i], bearings[i]]) - observe(x, j)
            nu[1] = wrap(nu[1])
            S = H @ full(P, x.size) @ H.T + R
            expected = nu @ np.linalg.solve(S, nu)
            np.testing.assert_allclose(ours[i, slot], expected, rtol=1e-4)
            alone = squared_distance(x, np.tril(P), slot, ranges[i], bearings[i], NOISE)
            np.testing.assert_allclose(alone, ours[i, slot], rtol=1e-9)


def test_the_closest_pair_goes_first_and_no_landmark_is_taken_twice() -> None:
    distances = np.array([[1.0, 50.0], [0.5, 60.0]])
    # Observation 0 wanted landmark 0 as well; it is near something known, so it is no new one.
    assert nearest_compatible(distances, 5.991, 25.0).tolist() == [IGNORED, 0]


def test_the_loser_takes_its_second_best_landmark() -> None:
    distances = np.array([[1.0, 4.0], [0.5, 9.0]])
    assert nearest_compatible(distances, 5.991, 25.0).tolist() == [1, 0]


def test_between_the_thresholds_lies_a_grey_zone() -> None:
    distances = np.array([[5.9], [6.5], [24.9], [25.1]])
    assert nearest_compatible(distances, 5.991, 25.0).tolist() == [0, IGNORED, IGNORED, NEW]


def test_with_one_threshold_there_is_no_grey_zone() -> None:
    assert nearest_compatible(np.array([[6.0]]), 5.991, 5.991).tolist() == [NEW]


def test_without_a_map_everything_is_new() -> None:
    assert nearest_compatible(np.empty((3, 0)), 5.991, 25.0).tolist() == [NEW] * 3


@given(arrays(np.float64, (5, 7), elements=st.floats(0.0, 60.0)))
def test_mutual_exclusion_and_gates_hold_for_any_distances(distances: Floats) -> None:
    chosen = nearest_compatible(distances, 9.0, 25.0)
    taken = chosen[chosen >= 0]
    assert taken.size == np.unique(taken).size
    for i, slot in enumerate(chosen):
        if slot >= 0:
            assert distances[i, slot] <= 9.0
        elif slot == NEW:
            assert np.all(distances[i] > 25.0)
        else:
            assert np.any(distances[i] <= 25.0)
    # Nothing compatible is left on both sides.
    free = np.setdiff1d(np.arange(7), taken)
    assert not np.any(distances[np.ix_(chosen == IGNORED, free)] <= 9.0)
