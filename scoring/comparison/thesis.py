"""The tables of F. Caesar, A Novel SLAM Quality Evaluation Method, KTH 2019, checked.

The printed numbers are truncated, not rounded, nearly everywhere: that is why an agreement is
defined by digits here, and why recomputed Totals differ by up to 0.003 m.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_HALF_UP, Decimal
from types import MappingProxyType

from scoring.comparison.runs import COLUMNS, Run, TotalFormula, total_of

TOTAL_TOLERANCE_M = 0.003
"""Largest sum of what truncating 2 ep1, ep2, edist and Total to three decimals leaves, as found."""

PRINTED_RATIOS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        group: dict(zip(COLUMNS, digits.split(), strict=True))
        for group, digits in {
            "turn": "1.085 1.131 0.944 1.344 3.066 10.00 1.995",
            "scurve": "1.397 1.330 1.035 1.808 1.926 5.540 1.819",
            "loop": "1.568 1.464 0.853 3.772 2.652 7.412 2.730",
        }.items()
    }
)
"""Tables 4.4, 4.7 and 4.10: FastSLAM over EKF-SLAM, digit by digit."""

PRINTED_DISAGREEMENTS = (("turn", "High-1"), ("turn", "High-3"), ("scurve", "High-1"))
"""Section 4.5: where the lower pose error does not come with the lower Total."""


DATASETS = 26
"""Data sets that the thesis scored with both algorithms (turn Low-3 failed to record)."""

POSE_COUNTS_FALSE_RANKS = 4
"""Of them, those whose lower pose error is not with the lower Total; section 4.5 counts three."""


COUNT_WEIGHT_M = 0.3
"""Of a missed or false landmark, Table 4.1."""


@dataclass(frozen=True)
class Means:
    """Means over the thesis' runs of one algorithm: weighted errors by `COLUMNS`, in metres."""

    weighted: Mapping[str, float]

    @property
    def missed(self) -> float:
        """Landmarks a run."""
        return self.weighted["false_negatives"] / COUNT_WEIGHT_M

    @property
    def false(self) -> float:
        """Landmarks a run."""
        return self.weighted["false_positives"] / COUNT_WEIGHT_M


def _means(digits: str) -> Means:
    numbers = map(float, digits.split())
    return Means(MappingProxyType(dict(zip(COLUMNS, numbers, strict=True))))


MEANS: Mapping[str, Mapping[str, Means]] = MappingProxyType(
    {
        "turn": {
            "ekf": _means("0.195 0.545 0.100 1.163 1.125 0.046 3.173"),
            "fastslam": _means("0.212 0.617 0.094 1.562 3.450 0.460 6.395"),
        },
        "scurve": {
            "ekf": _means("0.178 0.491 0.100 1.567 1.367 0.070 3.772"),
            "fastslam": _means("0.249 0.653 0.103 2.833 2.633 0.387 6.859"),
        },
        "loop": {
            "ekf": _means("0.171 0.426 0.153 0.733 0.767 0.072 2.322"),
            "fastslam": _means("0.268 0.624 0.131 2.767 2.033 0.534 6.356"),
        },
        "all": {
            "ekf": _means("0.181 0.485 0.118 1.154 1.085 0.063 3.086"),
            "fastslam": _means("0.244 0.632 0.110 2.419 2.677 0.460 6.542"),
        },
    }
)
"""Column means of Tables 4.2, 4.3, 4.5, 4.6, 4.8 and 4.9, the Totals by Eq. 3.1."""

PEARSON: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"ekf": (0.881, 0.814, 0.927), "fastslam": (0.354, -0.129, 0.667)}
)
"""Pose error against Total (Eq. 3.1) over all 26 runs, with the ends of its 95 % interval."""

TOTAL_RATIO = (2.120, 1.561, 2.912)
"""FastSLAM over EKF-SLAM, mean Total by Eq. 3.1 over all data sets, and its 95 % interval."""


@dataclass(frozen=True)
class Place:
    """Where the thesis shows what it found on one map: numbers of figures and tables."""

    scene: str
    errors: str
    tables: Mapping[str, str]
    ratios: str


PLACES: Mapping[str, Place] = MappingProxyType(
    {
        "turn": Place("4.1", "4.2", {"ekf": "4.2", "fastslam": "4.3"}, "4.4"),
        "scurve": Place("4.3", "4.4", {"ekf": "4.5", "fastslam": "4.6"}, "4.7"),
        "loop": Place("4.5", "4.6", {"ekf": "4.8", "fastslam": "4.9"}, "4.10"),
    }
)


def map_name(name: str) -> str:
    """A map's name as the tables above have it."""
    return name.lower().replace("-", "").replace("_", "").replace(" ", "")


@dataclass(frozen=True)
class TotalCheck:
    """A Total as it was given, against both formulas, in metres."""

    run: Run
    given: float
    equation: float
    printed: float

    @property
    def fits_equation(self) -> bool:
        """Whether it is the sum of the six errors, Eq. 3.1."""
        return _close(self.given, self.equation)

    @property
    def fits_print(self) -> bool:
        """Whether it is the sum with a second pose error in the place of the map error."""
        return _close(self.given, self.printed)


def check_totals(runs: Sequence[Run]) -> tuple[TotalCheck, ...]:
    """Every run that has a Total, against both formulas."""
    return tuple(
        TotalCheck(run, given, _total(run, "eq-3.1"), _total(run, "thesis-print"))
        for run in runs
        if (given := run.weighted["total"]) is not None
    )


def agrees_with_print(number: float, printed: str) -> bool:
    """Whether `number`, truncated or rounded to the digits of `printed`, is what is printed."""
    digits = Decimal(printed)
    exact = Decimal(repr(number))
    return digits in (exact.quantize(digits, ROUND_DOWN), exact.quantize(digits, ROUND_HALF_UP))


def _total(run: Run, formula: TotalFormula) -> float:
    total = total_of(run.weighted, formula)
    assert total is not None, "a run with a Total has parts"
    return total


def _close(given: float, computed: float) -> bool:
    # Both stem from three decimals: a difference of exactly 0.003 must not fail by its rounding.
    return round(abs(given - computed), 9) <= TOTAL_TOLERANCE_M
