from __future__ import annotations

import itertools

import numpy as np
import pytest
from dense import full, numeric_jacobian, observe
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry import Floats, wrap
from slam.association import IGNORED, NEW, expectations, nearest_compatible, squared_distances
from slam.config import ObservationNoise
from slam.jcbb import joint_compatible, joint_gates
from slam.observation import noise_array

NOISE = noise_array(ObservationNoise(range_sigma_m=0.05, bearing_sigma_rad=0.03))
R = np.diag([0.05**2, 0.03**2])
GATES = joint_gates(0.95, 16)


def scene(seed: int, n: int = 5, m: int = 4) -> tuple[Floats, Floats, Floats, Floats]:
    """A state with correlated doubt, and observations of some landmarks by a displaced car."""
    random = np.random.default_rng(seed)
    x = np.concatenate([np.zeros(3), random.uniform(-1.5, 1.5, 2 * n)])
    root = random.normal(0.0, 0.05, (x.size, x.size))
    root[:3] += random.normal(0.0, 0.1, (3, x.size))
    P = root @ root.T + 1e-4 * np.eye(x.size)
    truth = x + root @ random.normal(0.0, 1.0, x.size)
    seen = [observe(truth, 3 + 2 * int(j)) for j in random.permutation(n)[:m]]
    z = np.array(seen) + random.normal(0.0, [0.05, 0.03], (m, 2))
    return x, P, z[:, 0].copy(), np.asarray(wrap(z[:, 1])).copy()


def joint(
    x: Floats, P: Floats, ranges: Floats, bearings: Floats, nodes: int = 100_000
) -> tuple[list[int], bool]:
    n = (x.size - 3) // 2
    distances = squared_distances(expectations(x, P, n), ranges, bearings, NOISE)
    chosen, cut_short = joint_compatible(
        x, P, distances, ranges, bearings, NOISE, 9.21, 25.0, GATES, nodes
    )
    return chosen.tolist(), bool(cut_short)


def joint_distance(x: Floats, P: Floats, pairs: list[tuple[int, int]], z: Floats) -> float:
    """Of all pairs (observation, slot) together, with dense matrices."""
    H = np.concatenate(
        [numeric_jacobian(lambda s, j=3 + 2 * j: observe(s, j), x) for _, j in pairs]
    )
    nu = np.concatenate([z[i] - observe(x, 3 + 2 * j) for i, j in pairs])
    nu[1::2] = wrap(nu[1::2])
    S = H @ full(P, x.size) @ H.T + np.kron(np.eye(len(pairs)), R)
    return float(nu @ np.linalg.solve(S, nu))


def best_by_trying_all(x: Floats, P: Floats, ranges: Floats, bearings: Floats) -> tuple[int, float]:
    """Most pairs and least distance among all pairings whose every step is plausible."""
    n, z = (x.size - 3) // 2, np.stack([ranges, bearings], axis=1)
    distances = squared_distances(expectations(x, P, n), ranges, bearings, NOISE)
    best = (0, 0.0)
    for slots in itertools.product(range(-1, n), repeat=len(z)):
        pairs = [(i, j) for i, j in enumerate(slots) if j >= 0]
        taken = [j for _, j in pairs]
        if not pairs or len(set(taken)) < len(taken):
            continue
        if any(distances[i, j] > 9.21 for i, j in pairs):
            continue
        d = joint_distance(x, P, pairs, z)
        if d <= GATES[len(pairs)] and (-len(pairs), d) < (-best[0], best[1]):
            best = (len(pairs), d)
    return best


def test_the_joint_gates_are_the_quantiles_of_chi_square() -> None:
    from scipy.stats import chi2

    for probability in (0.5, 0.95, 0.9999):
        ours = joint_gates(probability, 300)
        np.testing.assert_allclose(
            ours[1:], chi2.ppf(probability, 2 * np.arange(1, 301)), rtol=1e-9
        )


def test_it_finds_what_trying_all_pairings_finds() -> None:
    """Never better, and the same unless the best one passes through an implausible part of it."""
    same = 0
    for seed in range(30):
        x, P, ranges, bearings = scene(seed, n=4, m=3)
        chosen, cut_short = joint(x, np.tril(P), ranges, bearings)
        pairs = [(i, j) for i, j in enumerate(chosen) if j >= 0]
        count, distance = best_by_trying_all(x, P, ranges, bearings)
        found = joint_distance(x, P, pairs, np.stack([ranges, bearings], axis=1)) if pairs else 0.0
        assert not cut_short
        assert (-len(pairs), found * (1 + 1e-4)) >= (-count, distance)
        same += len(pairs) == count and found == pytest.approx(distance, rel=1e-4)
    assert same >= 27


def test_a_turned_car_fools_the_nearest_neighbour_but_not_the_joint() -> None:
    """Two rows of cones, heading off by nearly their spacing: each alone fits its neighbour."""
    x = np.array([0.0, 0.0, 0.0, *np.ravel([[2.0, 0.35 * k] for k in range(-3, 4)])])
    P = 1e-6 * np.eye(x.size)
    P[2, 2] = 0.15**2
    truth = x.copy()
    truth[2] = 0.13
    z = np.array([observe(truth, 3 + 2 * j) for j in range(1, 6)])
    chosen, _ = joint(x, P, z[:, 0].copy(), z[:, 1].copy())
    assert chosen == [1, 2, 3, 4, 5]
    distances = squared_distances(expectations(x, P, 7), z[:, 0].copy(), z[:, 1].copy(), NOISE)
    assert nearest_compatible(distances, 9.21, 25.0).tolist() != [1, 2, 3, 4, 5]


def test_what_does_not_agree_with_the_rest_is_left_out_not_born_anew() -> None:
    x = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, -2.0, 0.0])
    P = 1e-8 * np.eye(9)
    P[2, 2] = 0.1**2
    z = np.array([observe(x, j) for j in (3, 5, 7)])
    z[2, 1] += 0.2
    chosen, _ = joint(x, P, z[:, 0].copy(), np.asarray(wrap(z[:, 1])).copy())
    assert chosen == [0, 1, IGNORED]


def test_without_a_map_everything_is_new_and_without_observations_nothing_is() -> None:
    x, P = np.zeros(3), np.eye(3)
    assert joint(x, P, np.ones(3), np.zeros(3)) == ([NEW] * 3, False)
    assert joint(x, P, np.empty(0), np.empty(0)) == ([], False)


def test_when_the_nodes_are_spent_the_best_so_far_is_taken_and_told() -> None:
    n = 12
    x = np.concatenate([np.zeros(3), np.tile([2.0, 0.0], n) + 0.01 * np.arange(2 * n)])
    P = 0.2 * np.eye(x.size)
    ranges, bearings = np.linspace(1.0, 3.0, 10), np.linspace(-0.5, 0.5, 10)
    chosen, cut_short = joint(x, P, ranges, bearings, nodes=12)
    assert cut_short
    taken = [slot for slot in chosen if slot >= 0]
    assert len(taken) >= 8
    assert len(set(taken)) == len(taken)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30)
def test_no_landmark_twice_and_every_pair_compatible(seed: int) -> None:
    x, P, ranges, bearings = scene(seed, n=6, m=6)
    ranges[0] = np.nan
    chosen, _ = joint(x, np.tril(P), ranges, bearings)
    distances = squared_distances(expectations(x, P, 6), ranges, bearings, NOISE)
    taken = [slot for slot in chosen if slot >= 0]
    assert len(set(taken)) == len(taken)
    assert chosen[0] == NEW  # nothing to compare; the filter leaves it out as invalid
    for i, slot in enumerate(chosen):
        assert slot < 0 or distances[i, slot] <= 9.21
