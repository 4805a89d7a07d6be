"""Limits on a score, so that a build can fail on a worse estimate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dialogue import UsageError, nearest_names
from scoring.result import ERROR_NAMES, Score
from scoring.score import METRIC_NAMES


@dataclass(frozen=True)
class Threshold:
    """The largest value of one number that is still good."""

    name: str
    limit: float

    @classmethod
    def from_text(cls, text: str) -> Threshold:
        """From `total=1.0`; the name is the Total, an error or a metric. Raises `UsageError`."""
        name, _, number = text.partition("=")
        valid = ("total", *ERROR_NAMES, *METRIC_NAMES)
        if name not in valid:
            raise UsageError(
                f"--fail-above {text}: no value {name!r}; {nearest_names(name, valid)}"
            )
        try:
            limit = float(number)
        except ValueError as err:
            raise UsageError(f"--fail-above {text}: expected {name}=NUMBER") from err
        if math.isnan(limit):
            raise UsageError(f"--fail-above {text}: nothing is above nan; expected {name}=NUMBER")
        return cls(name, limit)

    def breach(self, score: Score) -> str | None:
        """What is wrong with the score, or None; an undefined value is no good value."""
        values = {"total": score.total, **score.metrics, **score.errors}
        value = values[self.name]
        if value is None or math.isnan(value):
            return f"{score.name}: {self.name} is undefined, limit {self.limit:g}"
        if value > self.limit:
            return f"{score.name}: {self.name} {value:.6g} is above {self.limit:g}"
        return None


def breaches(scores: Sequence[Score], thresholds: Sequence[Threshold]) -> list[str]:
    """One line per score and threshold that it breaks."""
    found = [threshold.breach(score) for score in scores for threshold in thresholds]
    return [line for line in found if line is not None]
