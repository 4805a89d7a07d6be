"""What a comparison says of the thesis' findings, in words that follow from the numbers alone."""

from __future__ import annotations

from dataclasses import dataclass

from scoring.comparison.compare import Comparison, Contrast, Correlation
from scoring.comparison.hypothesis import disagreement
from scoring.comparison.overview import summary_of, thesis_means
from scoring.comparison.statistics import Interval
from scoring.comparison.thesis import (
    DATASETS,
    PEARSON,
    POSE_COUNTS_FALSE_RANKS,
    TOTAL_RATIO,
)

AGREES, DISAGREES, OPEN = "agrees", "disagrees", "open"
LOWER, HIGHER, LEVEL = "lower", "higher", "level"
NAMES = {"ekf": "EKF-SLAM", "fastslam": "FastSLAM"}


@dataclass(frozen=True)
class Verdict:
    """One finding of the thesis against ours: `word` is one of those above."""

    word: str
    text: str


def verdicts(comparison: Comparison) -> tuple[Verdict, ...]:
    """Level, order of the algorithms, correlation and hypothesis, as far as the thesis has them."""
    made = [_level(comparison, name) for name in comparison.algorithms]
    made += [_order(comparison)]
    made += [_correlation(comparison, name) for name in comparison.algorithms]
    return tuple(verdict for verdict in (*made, _hypothesis(comparison)) if verdict is not None)


def told(algorithm: str) -> str:
    """An algorithm as a sentence has it."""
    return NAMES.get(algorithm, algorithm)


def _level(comparison: Comparison, algorithm: str) -> Verdict | None:
    own, found = summary_of(comparison, algorithm, "total"), thesis_means(algorithm)
    if own.mean is None or found is None:
        return None
    thesis = found.weighted["total"]
    text = (
        f"{told(algorithm)} has a mean Total of {own.mean:.2f} m{_spread(own.interval)} over "
        f"{own.n} runs; in the thesis it was {thesis:.2f} m"
    )
    if own.interval is None:
        return Verdict(OPEN, f"{text}. Too few runs for an interval.")
    if own.interval.low <= thesis <= own.interval.high:
        return Verdict(LEVEL, f"{text}, which lies within.")
    return Verdict(LOWER if own.mean < thesis else HIGHER, f"{text}.")


def _order(comparison: Comparison) -> Verdict | None:
    found = _contrast(comparison)
    if found is None or found.ratio is None:
        return None
    ratio, low, high = TOTAL_RATIO
    text = (
        f"FastSLAM's mean Total is {found.ratio:.2f} times EKF-SLAM's{_spread(found.interval)}; in "
        f"the thesis {ratio:.2f} ({low:.2f} to {high:.2f}), FastSLAM being worse"
    )
    if found.interval is None or found.interval.low <= 1.0 <= found.interval.high:
        return Verdict(OPEN, f"{text}. Here no difference of the two is shown.")
    if found.interval.low > 1.0:
        return Verdict(AGREES, f"{text}. Here too.")
    return Verdict(DISAGREES, f"{text}. Here it is better.")


def _contrast(comparison: Comparison) -> Contrast | None:
    """FastSLAM against EKF-SLAM on the Total of all runs, where that was compared."""
    if comparison.baseline != "ekf":
        return None
    wanted = (comparison.groups[-1], "fastslam", "total")
    return next(
        (c for c in comparison.contrasts if (c.group, c.algorithm, c.column) == wanted), None
    )


def _correlation(comparison: Comparison, algorithm: str) -> Verdict | None:
    own, thesis = correlation_of(comparison, algorithm), PEARSON.get(algorithm)
    if own is None or own.pearson is None or thesis is None:
        return None
    r, low, high = thesis
    text = (
        f"Pose error and Total of {told(algorithm)} correlate with r = {own.pearson:.2f}"
        f"{_spread(own.pearson_interval)}; in the thesis' data {r:.2f} ({low:.2f} to {high:.2f})"
    )
    ends = own.pearson_interval
    if ends is None:
        return Verdict(OPEN, f"{text}. Too few runs for an interval.")
    if low <= own.pearson <= high or ends.low <= r <= ends.high:
        return Verdict(AGREES, f"{text}: one lies in the interval of the other.")
    if ends.low <= high and low <= ends.high:
        return Verdict(OPEN, f"{text}: the intervals only overlap.")
    return Verdict(DISAGREES, f"{text}: the intervals do not even overlap.")


def correlation_of(comparison: Comparison, algorithm: str, group: str = "") -> Correlation | None:
    """The correlation of one group, by default of all runs together."""
    wanted = (group or comparison.groups[-1], algorithm)
    return next((c for c in comparison.correlations if (c.group, c.algorithm) == wanted), None)


def _hypothesis(comparison: Comparison) -> Verdict | None:
    found = disagreement(comparison)
    if found.share is None:
        return None
    text = (
        f"The pose error and the Total name different best algorithms on {found.count} of "
        f"{found.n} data sets, {found.share:.0%}{_shares(found.interval)}; in the thesis on "
        f"{POSE_COUNTS_FALSE_RANKS} of {DATASETS}. "
    )
    if found.count == 0:
        return Verdict(
            DISAGREES,
            f"{text}By the rule of its section 1.2 that speaks against the hypothesis: the ranking "
            "does not depend on how quality is measured.",
        )
    return Verdict(
        AGREES,
        f"{text}By the rule of its section 1.2 the hypothesis stands: how quality is measured "
        "changes which algorithm appears the most suitable, on some data sets.",
    )


def _spread(ends: Interval | None) -> str:
    return "" if ends is None else f" ({ends.low:.2f} to {ends.high:.2f})"


def _shares(ends: Interval | None) -> str:
    return "" if ends is None else f" ({ends.low:.0%} to {ends.high:.0%})"
