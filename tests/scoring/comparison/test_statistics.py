"""Statistics against scipy, closed forms and brute force."""

from __future__ import annotations

from itertools import product
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from geometry import Floats
from scoring.comparison.statistics import (
    EXACT_UP_TO,
    Bootstrap,
    Interval,
    interval,
    mean,
    pearson,
    ratio_of_means,
    sign_flip_p_value,
    spearman,
    value,
)

FEW = Bootstrap(seed=7, resamples=999)
LONG_LISTS = st.lists(st.integers(-20, 20), min_size=4, max_size=12)


def skewed(n: int, seed: int = 3) -> Floats:
    return np.exp(np.random.default_rng(seed).normal(size=(2, n)))


@pytest.mark.parametrize("method", ["bca", "percentile"])
def test_interval_of_a_mean_is_scipys(method: Literal["bca", "percentile"]) -> None:
    samples = skewed(9)[:1]
    ours = interval(mean, samples, Bootstrap(seed=7, resamples=999, method=method))
    theirs = stats.bootstrap(
        (samples[0],),
        np.mean,
        n_resamples=999,
        method="BCa" if method == "bca" else "percentile",
        rng=np.random.default_rng(7),
    ).confidence_interval
    assert ours is not None
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)


def test_interval_of_a_ratio_is_scipys_paired_one() -> None:
    # With twelve data sets no resample is a permutation, which rounding would place by chance.
    samples = skewed(12)

    def ratio(x: Floats, y: Floats, axis: int = -1) -> Floats:
        quotient: Floats = x.mean(axis=axis) / y.mean(axis=axis)
        return quotient

    theirs = stats.bootstrap(
        (samples[0], samples[1]),
        ratio,
        n_resamples=999,
        paired=True,
        vectorized=True,
        method="BCa",
        rng=np.random.default_rng(7),
    ).confidence_interval
    ours = interval(ratio_of_means, samples, FEW)
    assert ours is not None
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)


def test_interval_covers_the_true_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    hits = 0
    for seed in range(200):
        found = interval(mean, rng.normal(5.0, 1.0, (1, 30)), Bootstrap(seed=seed, resamples=400))
        assert found is not None
        hits += found.low <= 5.0 <= found.high
    assert 180 <= hits <= 198


def test_interval_needs_three_data_sets() -> None:
    assert interval(mean, np.array([[1.0, 2.0]]), FEW) is None
    assert interval(mean, np.array([[1.0, 2.0, 4.0]]), FEW) is not None


def test_interval_of_equal_values_is_that_value() -> None:
    assert interval(mean, np.full((1, 5), 2.5), FEW) == Interval(2.5, 2.5)


def test_no_interval_where_the_statistic_is_often_undefined() -> None:
    # A baseline that is 0 in most runs is 0 in many resamples: the ratio has no interval.
    samples = np.array([[1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 1.0]])
    assert value(ratio_of_means, samples) == pytest.approx(10.0)
    assert interval(ratio_of_means, samples, FEW) is None


def test_ratio_over_a_zero_mean_is_undefined() -> None:
    assert value(ratio_of_means, np.array([[1.0, 2.0], [0.0, 0.0]])) is None


def test_nothing_has_no_mean() -> None:
    assert value(mean, np.empty((1, 0))) is None


@given(LONG_LISTS, st.integers(0, 2**32 - 1))
def test_correlations_are_scipys(numbers: list[int], seed: int) -> None:
    x = np.array(numbers, dtype=np.float64)
    y = np.round(x + np.random.default_rng(seed).normal(0.0, 6.0, x.size))
    samples = np.stack([x, y])
    if np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        assert value(pearson, samples) is None
        assert value(spearman, samples) is None
        return
    assert value(pearson, samples) == pytest.approx(stats.pearsonr(x, y).statistic, abs=1e-9)
    assert value(spearman, samples) == pytest.approx(stats.spearmanr(x, y).statistic, abs=1e-9)


def test_correlation_of_a_line_is_one() -> None:
    x = np.linspace(0.0, 1.0, 7)
    assert value(pearson, np.stack([x, 3.0 - 2.0 * x])) == pytest.approx(-1.0)
    assert value(spearman, np.stack([x, x**5])) == pytest.approx(1.0)


@given(LONG_LISTS)
def test_sign_flip_is_brute_force(numbers: list[int]) -> None:
    differences = np.array(numbers[:8], dtype=np.float64)
    signs = product((-1, 1), repeat=differences.size)
    sums = [abs(sum(s * d for s, d in zip(pattern, numbers, strict=False))) for pattern in signs]
    expected = np.mean([total >= abs(sum(numbers[:8])) for total in sums])
    assert sign_flip_p_value(differences, FEW) == pytest.approx(expected)


def test_sign_flip_is_scipys_permutation_test() -> None:
    differences = np.array([0.4, -0.1, 0.9, 0.3, 0.7, -0.2, 0.5])
    theirs = stats.permutation_test(
        (differences,), lambda d: float(np.mean(d)), permutation_type="samples", vectorized=False
    )
    assert sign_flip_p_value(differences, FEW) == pytest.approx(theirs.pvalue)


def test_sign_flip_of_one_sided_differences_is_two_patterns() -> None:
    assert sign_flip_p_value(np.arange(1.0, 9.0), FEW) == 2 / 2**8


def test_sampled_sign_flip_is_near_the_exact_one() -> None:
    differences = np.random.default_rng(5).normal(0.5, 1.0, EXACT_UP_TO)
    exact = sign_flip_p_value(differences, FEW)
    # A zero changes no sum: the same test, one difference over the limit.
    sampled = sign_flip_p_value(np.append(differences, 0.0), Bootstrap(resamples=20_000))
    assert exact is not None
    assert sampled == pytest.approx(exact, abs=4 * np.sqrt(exact * (1 - exact) / 20_000) + 1e-4)


def test_sign_flip_of_nothing_is_undefined_and_of_no_difference_certain() -> None:
    assert sign_flip_p_value(np.empty(0), FEW) is None
    assert sign_flip_p_value(np.zeros(5), FEW) == 1.0


def test_a_seed_gives_one_answer() -> None:
    samples = skewed(20)
    first, again = (interval(mean, samples[:1], Bootstrap(seed=4, resamples=500)) for _ in "ab")
    other = interval(mean, samples[:1], Bootstrap(seed=5, resamples=500))
    assert first == again != other
