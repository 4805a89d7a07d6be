"""Sigma points over two coordinates against sigma points over the whole state, in plain numpy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from geometry import Floats, wrap
from slam.gaussian import kernels, sights


def a_covariance(size: int, scale: float, seed: int) -> Floats:
    root = np.random.default_rng(seed).normal(0.0, scale, (size, size))
    covariance: Floats = root @ root.T
    return covariance


def unscented(
    function: Callable[[Floats], Floats], mean: Floats, covariance: Floats, bent: Floats
) -> tuple[Floats, Floats, Floats]:
    """Mean, covariance, and cross-covariance with the state, of 2n + 1 points, n + kappa = 3.

    bent : (k, n), the linear combinations that the function bends; the square root of the
    covariance is chosen so that only k of its columns move them. Outputs are differences from that
    of the middle point, so that angles do not wrap.
    """
    n, k = mean.size, bent.shape[0]
    basis = np.concatenate([bent, np.linalg.svd(bent)[2][k:]])
    root = np.linalg.solve(basis, np.linalg.cholesky(basis @ covariance @ basis.T))
    middle = function(mean)
    offsets = np.sqrt(3.0) * np.concatenate([root.T, -root.T])
    outputs = np.array([function(mean + offset) - middle for offset in offsets])
    average = outputs.sum(axis=0) / 6.0
    spread = outputs - average
    weight_of_middle = 1.0 - 2.0 * n / 6.0
    own = spread.T @ spread / 6.0 + weight_of_middle * np.outer(average, average)
    return middle + average, own, offsets.T @ outputs / 6.0


def turned(x: Floats) -> Floats:
    """(n, n): what an error that turns and moves car and map together is as one of the state."""
    told = np.eye(x.size)
    told[0, 2], told[1, 2] = -x[1], x[0]
    told[3::2, 2], told[4::2, 2] = -x[4::2], x[3::2]
    return told


def erring(x: Floats, error: Floats) -> Floats:
    """The state with every place moved by its error, and all turned by that of the heading."""
    cos, sin = np.cos(error[2]), np.sin(error[2])
    places = np.delete(x + error, 2).reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]])
    state: Floats = np.insert(places.ravel(), 2, x[2] + error[2])
    return state


@pytest.mark.parametrize("scale", [0.01, 0.2])
def test_five_points_see_what_points_over_the_whole_state_see(scale: float) -> None:
    x = np.array([0.3, -0.2, 0.7, 1.5, 0.9, -1.0, 2.0])
    P = a_covariance(7, scale, 1)
    told = turned(x)
    of_errors = np.linalg.solve(told, np.linalg.solve(told, P).T)
    found = sights.sigma_sights(x, P, 2)
    due = sights.expectations(P, found)
    for slot in range(2):
        j = 3 + 2 * slot
        bent = np.zeros((2, 7))
        bent[0, 0] = bent[1, 1] = -1.0
        bent[0, j] = bent[1, j + 1] = 1.0

        def seen(error: Floats, j: int = j) -> Floats:
            state = erring(x, error)
            dx, dy = state[j] - state[0], state[j + 1] - state[1]
            return np.array([np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - state[2])])

        mean, S, crossed = unscented(seen, np.zeros(7), of_errors, bent)
        np.testing.assert_allclose(found[slot, :2], mean, atol=1e-12)
        np.testing.assert_allclose(due[slot, 2:], [S[0, 0], S[0, 1], S[1, 1]], rtol=1e-9)
        HP = kernels.seen_rows(P, 7, np.array([slot]), found)
        np.testing.assert_allclose(HP[:2], (told @ crossed).T, atol=1e-12)
        one, none = np.array([slot]), np.zeros(3)
        innovated = kernels.innovation_covariance(HP, one, found, np.ones(1), none, np.ones(1))
        np.testing.assert_allclose(np.tril(innovated), np.tril(S), atol=1e-12)


def test_a_landmark_is_placed_as_points_over_range_and_bearing_place_it() -> None:
    x, P = np.array([0.3, -0.2, 0.7]), a_covariance(3, 0.1, 3)
    noise = np.array([0.04, 0.2, 0.0])

    def seen(observed: Floats) -> Floats:
        direction = x[2] + observed[1]
        place: Floats = x[:2] + observed[0] * np.array([np.cos(direction), np.sin(direction)])
        return place

    mean, own, _ = unscented(seen, np.array([1.7, 2.4]), np.diag(noise[:2] ** 2), np.eye(2))
    rows = sights.placings(x[2], np.array([1.7]), np.array([2.4]), noise, True)
    grow = np.array([[1.0, 0.0, -(mean - x[:2])[1]], [0.0, 1.0, (mean - x[:2])[0]]])
    x, grown = np.append(x, [0.0, 0.0]), np.zeros((5, 5))
    grown[:3, :3] = P
    kernels.place(x, grown, 5, 0, rows[0])
    np.testing.assert_allclose(x[3:], mean, atol=1e-12)
    np.testing.assert_allclose(np.tril(grown[3:, 3:]), np.tril(grow @ P @ grow.T + own), atol=1e-12)
    np.testing.assert_allclose(grown[3:, :3], grow @ P, atol=1e-12)


def test_errors_told_anew_are_those_of_the_moved_state() -> None:
    before, P = np.random.default_rng(6).uniform(-2.0, 2.0, 9), a_covariance(9, 0.1, 7)
    for moved in (np.ones(9), np.repeat([1.0, 0.0], [3, 6])):  # all, or the car alone
        after, found = before + 0.3 * moved, P.copy()
        anew = turned(after) @ np.linalg.inv(turned(before))
        if moved[-1]:
            kernels.retell(found, 9, after, before)
        else:
            kernels.carry(found, 9, -0.3, 0.3)
        np.testing.assert_allclose(np.tril(found), np.tril(anew @ P @ anew.T), atol=1e-12)


def test_without_doubt_points_are_derivatives() -> None:
    random = np.random.default_rng(4)
    x = random.uniform(-3.0, 3.0, 43)
    P = a_covariance(43, 1e-6, 5)
    bent, straight = sights.sigma_sights(x, P, 20), sights.first_estimate_sights(x, x, 20)
    np.testing.assert_allclose(bent, straight, atol=1e-7)
    certain = sights.sigma_sights(x, np.zeros_like(P), 20)
    np.testing.assert_allclose(certain, straight, atol=1e-7)
    observed = np.array([1.0, 2.0]), np.array([0.1, -3.0]), np.array([0.04, 0.02, 0.05])
    np.testing.assert_allclose(
        sights.placings(0.3, *observed, True), sights.placings(0.3, *observed, False), rtol=1e-3
    )


def test_points_on_both_sides_of_the_seam_have_their_mean_there() -> None:
    x = np.array([0.0, 0.0, 0.0, -2.0, 1e-3])
    due = sights.sigma_sights(x, 0.09 * np.eye(5), 1)[0]
    assert abs(due[1]) == pytest.approx(np.pi, abs=1e-2)
    assert due[8] < 0.01  # were the seam not minded, turns of 2 pi would be among the points


def test_first_estimates_bend_nothing_but_the_derivatives() -> None:
    x = np.array([0.0, 0.0, 0.5, 2.0, 1.0])
    first = np.array([9.0, 9.0, 9.0, 0.0, 2.0])
    row = sights.first_estimate_sights(x, first, 1)[0]
    np.testing.assert_allclose(row[:2], [np.hypot(2.0, 1.0), np.arctan2(1.0, 2.0) - 0.5])
    np.testing.assert_allclose(row[2:6], [0.0, 1.0, -0.5, 0.0], atol=1e-15)
    np.testing.assert_array_equal(row[6:], [0.0, 0.0, 0.0, 0.0, -1.0])
