"""Means, ratios and correlations of a few paired runs, and how far to trust them.

Numpy only. A statistic takes resampled rows, shape (k, b, n), and gives (b,): k variables measured
on the same n data sets, drawn together, so that pairs stay pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np

from geometry import Floats

Statistic = Callable[[Floats], Floats]
IntervalMethod = Literal["bca", "percentile"]

EXACT_UP_TO = 16
"""Most differences whose 2^n sign patterns are all tried; beyond that they are sampled."""

FEWEST = 3
"""Fewer data sets than this have no bootstrap interval: two points resample to three values."""

UNDEFINED_SHARE = 0.01
"""An interval is given only while the statistic exists in all but this share of the resamples."""


@dataclass(frozen=True)
class Bootstrap:
    """How intervals are made: seed, number of resamples, confidence level, method."""

    seed: int = 0
    resamples: int = 10_000
    level: float = 0.95
    method: IntervalMethod = "bca"


@dataclass(frozen=True)
class Interval:
    """A confidence interval."""

    low: float
    high: float


def mean(samples: Floats) -> Floats:
    """Mean of the first variable."""
    means: Floats = samples[0].mean(axis=-1)
    return means


def ratio_of_means(samples: Floats) -> Floats:
    """Mean of the first variable over mean of the second; NaN where that is 0."""
    means = samples.mean(axis=-1)
    zero = means[1] == 0.0
    ratio: Floats = np.where(zero, np.nan, means[0] / np.where(zero, 1.0, means[1]))
    return ratio


def pearson(samples: Floats) -> Floats:
    """Correlation of the two variables; NaN where one of them is constant."""
    centred = samples - samples.mean(axis=-1, keepdims=True)
    # A constant row leaves rounding behind instead of zero.
    constant = np.ptp(samples, axis=-1).min(axis=0) == 0.0
    scale = np.sqrt(np.prod(np.sum(centred**2, axis=-1), axis=0))
    undefined = constant | (scale == 0.0)
    correlation = np.sum(centred[0] * centred[1], axis=-1) / np.where(undefined, 1.0, scale)
    return np.where(undefined, np.nan, np.clip(correlation, -1.0, 1.0))


def spearman(samples: Floats) -> Floats:
    """Correlation of the ranks of the two variables, ties at their mean rank."""
    return pearson(np.stack([_ranks(samples[0]), _ranks(samples[1])]))


def _ranks(values: Floats) -> Floats:
    """Ranks 1..n along the last axis of (b, n), ties at their mean rank."""
    distinct, codes = np.unique(values, return_inverse=True)
    rows = np.arange(values.shape[0])[:, None] * distinct.size + codes.reshape(values.shape)
    counts = np.bincount(rows.ravel(), minlength=values.shape[0] * distinct.size)
    counts = counts.reshape(values.shape[0], distinct.size)
    mean_ranks = np.cumsum(counts, axis=1) - (counts - 1) / 2.0
    ranks: Floats = np.take_along_axis(mean_ranks, codes.reshape(values.shape), axis=1)
    return ranks


def value(statistic: Statistic, samples: Floats) -> float | None:
    """The statistic of samples (k, n) as they are; None where it does not exist."""
    if samples.shape[-1] == 0:
        return None
    number = float(statistic(samples[:, None, :])[0])
    return number if np.isfinite(number) else None


def interval(statistic: Statistic, samples: Floats, how: Bootstrap) -> Interval | None:
    """Bootstrap confidence interval of a statistic of samples (k, n), resampled over data sets.

    Bias-corrected and accelerated, or plain percentiles: Efron & Tibshirani, An Introduction to the
    Bootstrap, 1993, Eq. 14.9-14.15 and 13.5. The same seed draws the same data sets for every
    column, so that the intervals of one table belong together. None where it cannot be known.
    """
    n = samples.shape[-1]
    observed = value(statistic, samples)
    if n < FEWEST or observed is None:
        return None
    draws = np.random.default_rng(how.seed).integers(0, n, (how.resamples, n))
    drawn = statistic(samples[:, draws])
    defined = drawn[np.isfinite(drawn)]
    if defined.size < (1.0 - UNDEFINED_SHARE) * drawn.size:
        return None
    tail = (1.0 - how.level) / 2.0
    tails = (tail, 1.0 - tail)
    if how.method == "bca":
        left_out = np.array([np.delete(np.arange(n), i) for i in range(n)])
        tails = _bca_tails(observed, defined, statistic(samples[:, left_out]), tails)
    low, high = np.quantile(defined, tails)
    return Interval(float(low), float(high))


def _bca_tails(
    observed: float, drawn: Floats, left_out: Floats, tails: tuple[float, float]
) -> tuple[float, float]:
    """The quantiles to read instead of `tails`: corrected for bias and for skewness."""
    normal = NormalDist()
    # A resample that is a mere permutation equals the sample but for its rounding.
    rounding = 1e-12 * abs(observed)
    below = (np.mean(drawn < observed - rounding) + np.mean(drawn <= observed + rounding)) / 2.0
    influence = np.nanmean(left_out) - left_out[np.isfinite(left_out)]
    spread = float(np.sum(influence**2))
    # Every resample on one side, or no data set that matters: nothing to correct with.
    if not 0.0 < below < 1.0 or spread == 0.0:
        return tails
    bias = normal.inv_cdf(float(below))
    acceleration = float(np.sum(influence**3)) / (6.0 * spread**1.5)

    def corrected(tail: float) -> float:
        shifted = bias + normal.inv_cdf(tail)
        return normal.cdf(bias + shifted / (1.0 - acceleration * shifted))

    return corrected(tails[0]), corrected(tails[1])


def sign_flip_p_value(differences: Floats, how: Bootstrap) -> float | None:
    """Two-sided p value that paired differences (n,) have no preferred sign; None for n = 0.

    Permutation test of the mean under random signs: all 2^n patterns up to `EXACT_UP_TO`
    differences, otherwise `resamples` of them. Good, Permutation, Parametric and Bootstrap Tests
    of Hypotheses, 3rd ed. 2005, section 3.2; the sampled p counts the observed pattern as one.
    """
    n = differences.size
    if n == 0:
        return None
    # Patterns that only rounding tells from the observed one are as extreme as it is.
    threshold = abs(differences.sum()) - 1e-9 * np.abs(differences).sum()
    if n <= EXACT_UP_TO:
        patterns = (np.arange(2**n)[:, None] >> np.arange(n)) & 1
        return float(np.mean(np.abs((2.0 * patterns - 1.0) @ differences) >= threshold))
    patterns = np.random.default_rng(how.seed).integers(0, 2, (how.resamples, n))
    extreme = np.sum(np.abs((2.0 * patterns - 1.0) @ differences) >= threshold)
    return float((1 + extreme) / (1 + how.resamples))


def holm(p_values: Sequence[float | None]) -> tuple[float | None, ...]:
    """The p values corrected for being several; None stays None and does not count.

    Holm, A simple sequentially rejective multiple test procedure, Scand. J. Statist. 6, 1979.
    """
    known = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    corrected: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for rank, (p, place) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p))
        corrected[place] = largest
    return tuple(corrected)


def share_interval(count: int, n: int, level: float = 0.95) -> Interval | None:
    """Score interval of a share `count` of `n`; None for n = 0.

    Wilson, Probable inference, the law of succession, and statistical inference, JASA 22, 1927.
    """
    if n == 0:
        return None
    z = NormalDist().inv_cdf(0.5 + level / 2.0)
    share = count / n
    middle = (share + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z / (1.0 + z * z / n) * (share * (1.0 - share) / n + z * z / (4.0 * n * n)) ** 0.5
    return Interval(max(0.0, middle - half), min(1.0, middle + half))
