"""The runs that are compared: one algorithm on one data set each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from scoring.result import ERROR_NAMES

COLUMNS = (*ERROR_NAMES, "total")
"""What is compared of a run: the six weighted errors, in metres, and their Total."""

TotalFormula = Literal["as-given", "eq-3.1", "thesis-print"]


@dataclass(frozen=True)
class Run:
    """One algorithm on one data set.

    power, trial : which run on this map; weighted : by `COLUMNS`, None where undefined, all None
    for a run that failed; choices : the options it was scored with; source : where it was read.
    """

    map: str
    power: str
    trial: str
    algorithm: str
    weighted: Mapping[str, float | None]
    source: Path
    choices: Mapping[str, object] = field(default_factory=dict)

    @property
    def dataset(self) -> str:
        """Its name among the runs on its map, as in the thesis: `Low-1`."""
        return f"{self.power}-{self.trial}" if self.trial else self.power

    @property
    def missing(self) -> bool:
        """Whether nothing came of the run."""
        return all(self.weighted.get(column) is None for column in COLUMNS)


@dataclass(frozen=True)
class Runs:
    """Everything that was read, and what was left out and why."""

    runs: tuple[Run, ...]
    remarks: tuple[str, ...] = ()


def total_of(weighted: Mapping[str, float | None], formula: TotalFormula) -> float | None:
    """The Total in metres by a formula; an undefined part adds 0.

    `eq-3.1` sums the six errors. `thesis-print` is how the thesis' printed Totals were made: the
    pose error once more in the place of the map error. `as-given` is the Total that was read.
    """
    if formula == "as-given" or all(weighted.get(name) is None for name in ERROR_NAMES):
        return weighted.get("total")
    parts = {name: weighted.get(name) or 0.0 for name in ERROR_NAMES}
    if formula == "thesis-print":
        parts["map"] = parts["pose"]
    return sum(parts.values())


def with_totals(runs: Runs, formula: TotalFormula) -> Runs:
    """The same runs with their Totals by this formula."""
    recomputed = tuple(
        replace(run, weighted={**run.weighted, "total": total_of(run.weighted, formula)})
        for run in runs.runs
    )
    return replace(runs, runs=recomputed)
