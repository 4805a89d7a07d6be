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
