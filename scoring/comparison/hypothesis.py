"""The thesis' research question as tests: whether the way of scoring changes who is best.

F. Caesar, A Novel SLAM Quality Evaluation Method, KTH 2019, section 1.2: if the error-ranking by
pose error and by Total is the same over all data sets, the hypothesis is taken to be false.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scoring.comparison.compare import EVERYTHING, Comparison, Contrast
from scoring.comparison.runs import COLUMNS, Run
from scoring.comparison.statistics import (
    Bootstrap,
    Interval,
    holm,
    interval,
    mean,
    share_interval,
    sign_flip_p_value,
    value,
)

EFFECT_COLUMNS = ("total", "pose")


@dataclass(frozen=True)
class Disagreement:
    """On how many data sets the lowest pose error and the lowest Total are of other algorithms."""

    count: int
    n: int
    interval: Interval | None

    @property
    def share(self) -> float | None:
        """Of the data sets; None without any."""
        return self.count / self.n if self.n else None


@dataclass(frozen=True)
class Corrected:
    """A contrast of one map, its p value corrected for the number of maps (Holm)."""

    contrast: Contrast
    p_value: float | None


@dataclass(frozen=True)
class Effect:
    """How much more one error is under `what` than under `against`, over paired runs, in metres.

    Runs are paired by everything else: under two powers by map and trial, on two maps by power and
    trial. p_value : of the sign-flip test, not corrected.
    """

    algorithm: str
    column: str
    what: str
    against: str
    n: int
    mean: float | None
    interval: Interval | None
    p_value: float | None


def disagreement(comparison: Comparison) -> Disagreement:
    """How often the pose error orders the algorithms wrongly."""
    count = sum(ranking.disagrees for ranking in comparison.rankings)
    n = len(comparison.rankings)
    return Disagreement(count, n, share_interval(count, n, comparison.how.level))


def corrected_contrasts(comparison: Comparison) -> tuple[Corrected, ...]:
    """Every algorithm against the baseline, for each error one test a map; corrected over the maps.

    The last group, all runs together, is one test and stays as it is.
    """
    several = len(comparison.groups) > 1
    made: dict[tuple[str, str, str], Corrected] = {}
    for algorithm in comparison.algorithms:
        for column in COLUMNS:
            own = [
                c
                for c in comparison.contrasts
                if (c.algorithm, c.column) == (algorithm, column)
                and not (several and c.group == EVERYTHING)
            ]
            for contrast, p in zip(own, holm([c.p_value for c in own]), strict=True):
                made[contrast.group, algorithm, column] = Corrected(contrast, p)
    return tuple(
        made.get((c.group, c.algorithm, c.column), Corrected(c, c.p_value))
        for c in comparison.contrasts
    )


def effects(comparison: Comparison) -> tuple[Effect, ...]:
    """High power against low, and every map against every earlier one, for Total and pose error."""
    usable = [run for run in comparison.runs if not run.missing]
    powers = {run.power.lower(): run.power for run in usable}
    maps = list(dict.fromkeys(run.map for run in usable))
    made = []
    for algorithm in comparison.algorithms:
        own = [run for run in usable if run.algorithm == algorithm]
        for column in EFFECT_COLUMNS:
            if "high" in powers and "low" in powers:
                sides = [
                    {(r.map, r.trial): r for r in own if r.power == powers[name]}
                    for name in ("high", "low")
                ]
                made.append(_effect(algorithm, column, ("high", "low"), sides, comparison.how))
            for first, second in itertools.combinations(maps, 2):
                sides = [
                    {(r.power, r.trial): r for r in own if r.map == name}
                    for name in (second, first)
                ]
                made.append(_effect(algorithm, column, (second, first), sides, comparison.how))
    return tuple(made)


def _effect(
    algorithm: str,
    column: str,
    names: tuple[str, str],
    sides: Sequence[dict[tuple[str, str], Run]],
    how: Bootstrap,
) -> Effect:
    more, less = sides
    pairs = [
        (a, b)
        for key, run in more.items()
        if key in less
        and (a := run.weighted[column]) is not None
        and (b := less[key].weighted[column]) is not None
    ]
    differences = np.array([a - b for a, b in pairs], dtype=float)
    samples = differences[None, :]
    return Effect(
        *(algorithm, column, *names),
        n=differences.size,
        mean=value(mean, samples),
        interval=interval(mean, samples, how),
        p_value=sign_flip_p_value(differences, how),
    )
