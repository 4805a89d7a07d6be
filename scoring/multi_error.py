"""The multi-error function of the thesis: six errors, six weights, one Total.

F. Caesar, *A Novel SLAM Quality Evaluation Method*, KTH 2019, section 3.1. An error that the data
leave undefined is None; it adds nothing to the Total, or under `--strict` leaves no Total.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from geometry import Floats
from scoring.assignment import NearPairs
from scoring.distance_error import DistanceError
from scoring.options import ScoreOptions
from scoring.result import ERROR_NAMES

Errors = Mapping[str, float | None]


@dataclass(frozen=True)
class MultiError:
    """The six errors by `ERROR_NAMES`, each times its weight, and their sum (Eq. 3.1)."""

    errors: Errors
    weighted: Errors
    total: float | None
    remarks: tuple[str, ...] = ()


def path_errors(position_m: Floats) -> dict[str, float | None]:
    """`pose` and `max_pose` in metres: mean (Eq. 3.2) and largest (Eq. 3.3) position error."""
    return {"pose": float(position_m.mean()), "max_pose": float(position_m.max())}


def landmark_errors(
    pairs: NearPairs, true_count: int, estimated_count: int, distance: DistanceError
) -> dict[str, float | None]:
    """`map` (Eq. 3.4), `false_negatives` (3.5), `false_positives` (3.6), `distance` (3.7).

    The map error is a mean distance in metres, as Eq. 3.4 says, not the mean square of the text.
    """
    count = len(pairs)
    return {
        "map": float(pairs.distance_m.mean()) if count else None,
        "false_negatives": float(true_count - count),
        "false_positives": float(estimated_count - count),
        "distance": distance.value,
    }


def weigh(errors: Errors, options: ScoreOptions) -> MultiError:
    """Errors, weighted errors and Total (Eq. 3.1); missing names count as undefined.

    With `thesis-print` the weighted map error is that of the pose, because the Totals printed in
    the thesis' tables are 2 pose + max_pose + false_negatives + false_positives + distance.
    """
    complete = {name: errors.get(name) for name in ERROR_NAMES}
    summands = dict(complete)
    remarks: tuple[str, ...] = ()
    if options.total_formula == "thesis-print":
        summands["map"] = complete["pose"]
        remarks = ("Total as printed in the thesis: the pose error stands in for the map error",)
    weighted = {
        name: None if value is None else weight * value
        for (name, value), weight in zip(summands.items(), options.weights, strict=True)
    }
    undefined = [name for name, value in weighted.items() if value is None]
    total = sum(value for value in weighted.values() if value is not None)
    if undefined and options.strict:
        reason = f"no Total under --strict: undefined {', '.join(undefined)}"
        return MultiError(complete, weighted, None, (*remarks, reason))
    return MultiError(complete, weighted, total, remarks)
