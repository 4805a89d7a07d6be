"""Runs side by side: means, ratios to a baseline, correlations, and who is best."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dialogue import UsageError, nearest_names
from geometry import Floats
from scoring.comparison.runs import COLUMNS, Run, Runs
from scoring.comparison.statistics import (
    FEWEST,
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
from scoring.errors import ScoringError

GroupBy = Literal["map", "power", "none"]

EVERYTHING = "all"
"""The group of all runs together."""

POWER_ORDER = ("low", "medium", "high")


@dataclass(frozen=True)
class Summary:
    """One column of one algorithm in one group.

    n : runs with a value; undefined : runs without; mean, std (of the sample, n - 1) in metres.
    """

    group: str
    algorithm: str
    column: str
    n: int
    undefined: int
    mean: float | None
    std: float | None
    interval: Interval | None


@dataclass(frozen=True)
class Contrast:
    """An algorithm against the baseline over the data sets where both have a value.

    ratio : mean of the algorithm over mean of the baseline; p_value : sign-flip test of the
    differences, not corrected for the number of columns and groups.
    """

    group: str
    algorithm: str
    column: str
    n: int
    mean: float | None
    baseline_mean: float | None
    ratio: float | None
    interval: Interval | None
    p_value: float | None


@dataclass(frozen=True)
class Correlation:
    """How far the pose error tells the Total, over the runs that have both.

    None for fewer than three: two points always lie on a line.
    """

    group: str
    algorithm: str
    n: int
    pearson: float | None
    pearson_interval: Interval | None
    spearman: float | None
    spearman_interval: Interval | None


@dataclass(frozen=True)
class Ranking:
    """Which algorithms have the lowest pose error and the lowest Total on one data set."""

    map: str
    dataset: str
    lowest_pose: tuple[str, ...]
    lowest_total: tuple[str, ...]

    @property
    def disagrees(self) -> bool:
        """Whether no algorithm is best by both."""
        return not set(self.lowest_pose) & set(self.lowest_total)


@dataclass(frozen=True)
class Comparison:
    """Everything that `trackside compare` shows.

    runs : also those that failed (`Run.missing`), in the order of the tables; groups : the last is
    all runs together; remarks : what a reader must know before believing the numbers.
    """

    runs: tuple[Run, ...]
    group_by: GroupBy
    groups: tuple[str, ...]
    algorithms: tuple[str, ...]
    baseline: str
    how: Bootstrap
    summaries: tuple[Summary, ...]
    contrasts: tuple[Contrast, ...]
    correlations: tuple[Correlation, ...]
    rankings: tuple[Ranking, ...]
    remarks: tuple[str, ...]


def compare(
    given: Runs,
    *,
    group_by: GroupBy = "map",
    baseline: str | None = None,
    how: Bootstrap | None = None,
) -> Comparison:
    """All figures over the runs; failed runs are counted and left out.

    The baseline is the first algorithm unless named. Raises `UsageError` for one that is not there.
    """
    how = how or Bootstrap()
    runs = _ordered(given.runs)
    usable = tuple(run for run in runs if not run.missing)
    algorithms = tuple(dict.fromkeys(run.algorithm for run in given.runs if not run.missing))
    first = _baseline(baseline, algorithms)
    groups = _groups(runs, group_by)
    grids = [_Grid(group, members(usable, group_by, group), how) for group in groups]
    cells = [(grid, name) for grid in grids for name in algorithms if grid.counts.get(name)]
    rivals = [(grid, name) for grid, name in cells if name != first]
    return Comparison(
        runs=runs,
        group_by=group_by,
        groups=groups,
        algorithms=algorithms,
        baseline=first,
        how=how,
        summaries=tuple(grid.summary(name, c) for grid, name in cells for c in COLUMNS),
        contrasts=tuple(grid.contrast(name, first, c) for grid, name in rivals for c in COLUMNS),
        correlations=tuple(grid.correlation(name) for grid, name in cells),
        rankings=_rankings(usable),
        remarks=(*given.remarks, *_mixed_choices(usable)),
    )


def members(runs: Sequence[Run], group_by: GroupBy, group: str) -> tuple[Run, ...]:
    """The runs of one group, in their order."""
    return tuple(run for run in runs if group in (EVERYTHING, _group_of(run, group_by)))


def _group_of(run: Run, group_by: GroupBy) -> str:
    return {"map": run.map, "power": run.power, "none": EVERYTHING}[group_by]


def _groups(runs: Sequence[Run], group_by: GroupBy) -> tuple[str, ...]:
    """Groups in order of appearance; all runs together at the end, unless that is one of them."""
    named = tuple(dict.fromkeys(_group_of(run, group_by) for run in runs))
    return named if len(named) == 1 else (*named, EVERYTHING)


def _ordered(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Maps as they come; on each low before medium before high, however the shell listed them."""
    maps = list(dict.fromkeys(run.map for run in runs))
    ranks = {power: rank for rank, power in enumerate(POWER_ORDER)}
    return tuple(
        sorted(runs, key=lambda r: (maps.index(r.map), ranks.get(r.power.lower(), len(ranks))))
    )


def _baseline(asked: str | None, algorithms: tuple[str, ...]) -> str:
    if not algorithms:
        raise ScoringError("nothing to compare: every run is missing")
    if asked is None:
        return algorithms[0]
    if asked not in algorithms:
        raise UsageError(f"--baseline {asked!r}: {nearest_names(asked, algorithms)}")
    return asked


class _Grid:
    """The values of one group: per algorithm and column a row over its data sets, NaN for none."""

    def __init__(self, group: str, runs: Sequence[Run], how: Bootstrap) -> None:
        self.group, self.how = group, how
        self.counts = Counter(run.algorithm for run in runs)
        place = {key: i for i, key in enumerate(dict.fromkeys((r.map, r.dataset) for r in runs))}
        self._rows: dict[tuple[str, str], Floats] = {
            (name, column): np.full(len(place), np.nan)
            for name in self.counts
            for column in COLUMNS
        }
        for run in runs:
            for column in COLUMNS:
                number = run.weighted[column]
                if number is not None:
                    self._rows[run.algorithm, column][place[run.map, run.dataset]] = number

    def _paired(self, *keys: tuple[str, str]) -> Floats:
        """(k, n): these rows where all of them have a value."""
        rows = np.array([self._rows[key] for key in keys])
        return rows[:, np.isfinite(rows).all(axis=0)]

    def summary(self, algorithm: str, column: str) -> Summary:
        samples = self._paired((algorithm, column))
        n = samples.shape[1]
        return Summary(
            group=self.group,
            algorithm=algorithm,
            column=column,
            n=n,
            undefined=self.counts[algorithm] - n,
            mean=value(mean, samples),
            std=float(np.std(samples[0], ddof=1)) if n > 1 else None,
            interval=interval(mean, samples, self.how),
        )

    def contrast(self, algorithm: str, baseline: str, column: str) -> Contrast:
        if not self.counts[baseline]:
            return Contrast(self.group, algorithm, column, 0, None, None, None, None, None)
        samples = self._paired((algorithm, column), (baseline, column))
        return Contrast(
            group=self.group,
            algorithm=algorithm,
            column=column,
            n=samples.shape[1],
            mean=value(mean, samples[:1]),
            baseline_mean=value(mean, samples[1:]),
            ratio=value(ratio_of_means, samples),
            interval=interval(ratio_of_means, samples, self.how),
            p_value=sign_flip_p_value(samples[0] - samples[1], self.how),
        )

    def correlation(self, algorithm: str) -> Correlation:
        samples = self._paired((algorithm, "pose"), (algorithm, "total"))
        n = samples.shape[1]
        return Correlation(
            group=self.group,
            algorithm=algorithm,
            n=n,
            pearson=value(pearson, samples) if n >= FEWEST else None,
            pearson_interval=interval(pearson, samples, self.how),
            spearman=value(spearman, samples) if n >= FEWEST else None,
            spearman_interval=interval(spearman, samples, self.how),
        )


def _rankings(runs: Sequence[Run]) -> tuple[Ranking, ...]:
    """Every data set on which two or more algorithms have a pose error and a Total."""
    by_dataset: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        if run.weighted["pose"] is not None and run.weighted["total"] is not None:
            by_dataset.setdefault((run.map, run.dataset), []).append(run)
    return tuple(
        Ranking(*key, _lowest(rivals, "pose"), _lowest(rivals, "total"))
        for key, rivals in by_dataset.items()
        if len(rivals) > 1
    )


def _lowest(runs: Sequence[Run], column: str) -> tuple[str, ...]:
    least = min(number for run in runs if (number := run.weighted[column]) is not None)
    return tuple(run.algorithm for run in runs if run.weighted[column] == least)


def _mixed_choices(runs: Sequence[Run]) -> tuple[str, ...]:
    """A warning for every option that was not the same in all runs that state it."""
    found: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, choice in run.choices.items():
            found.setdefault(name, {})[str(choice)] = None
    return tuple(
        f"the runs were scored with different {name}: {', '.join(values)}; "
        "their numbers do not compare"
        for name, values in found.items()
        if len(values) > 1
    )
