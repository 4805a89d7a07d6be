"""A score: the numbers, the choices behind them, and what a report draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from geometry import Floats, LandmarkMap, Stamps

FORMAT = 1

ERROR_NAMES = ("pose", "max_pose", "map", "false_negatives", "false_positives", "distance")
"""The six errors of the multi-error function, in the order of the weights w1..w6 (Eq. 3.1)."""

ERROR_UNITS = {
    "pose": "m",
    "max_pose": "m",
    "map": "m",
    "false_negatives": "",
    "false_positives": "",
    "distance": "m",
}


@dataclass(frozen=True)
class Alignment:
    """The one rigid transform that brought path and map of the estimate into the frame of truth.

    mode : how it was found; x, y [m], heading [rad] : pose of the estimate's frame in `world`
    (in space: heading is None, matrix is set); heading_observed : whether the data fixed it.
    """

    mode: str
    x: float
    y: float
    heading: float | None
    heading_observed: bool = True
    matrix: tuple[tuple[float, ...], ...] | None = None


@dataclass(frozen=True, eq=False)
class PathErrors:
    """Errors at each paired pose, for plots and `--errors`.

    t_ns : (n,); truth, estimate : (n, d) aligned positions; position_m, along_m, cross_m,
    heading_rad : (n,). Along and cross track (left positive) and heading are NaN in space.
    """

    t_ns: Stamps
    truth: Floats
    estimate: Floats
    position_m: Floats
    along_m: Floats
    cross_m: Floats
    heading_rad: Floats


@dataclass(frozen=True, eq=False)
class MapErrors:
    """Which estimated landmark was taken for which true one.

    truth, estimate : both maps in `world`; pairs : (q, 2) row of truth, row of estimate;
    distance_m : (q,); cutoff_m : the pairing distance c.
    """

    truth: LandmarkMap
    estimate: LandmarkMap
    pairs: npt.NDArray[np.int64]
    distance_m: Floats
    cutoff_m: float

    @property
    def missed(self) -> npt.NDArray[np.int64]:
        """Rows of truth without a pair: the false negatives."""
        return np.setdiff1d(np.arange(len(self.truth)), self.pairs[:, 0])

    @property
    def false(self) -> npt.NDArray[np.int64]:
        """Rows of the estimate without a pair: the false positives."""
        return np.setdiff1d(np.arange(len(self.estimate)), self.pairs[:, 1])


@dataclass(frozen=True, eq=False)
class Score:
    """One estimate against the truth.

    total : Eq. 3.1, None where a part is undefined under `--strict`;
    errors, weighted : by `ERROR_NAMES`, None where undefined; counts, metrics : by name;
    choices : every option in force; provenance : how the estimate says that it was made;
    remarks : what a reader must know (undefined parts, drops);
    path, map, true_path : what a report draws, not part of the JSON.
    """

    name: str
    total: float | None
    errors: Mapping[str, float | None]
    weighted: Mapping[str, float | None]
    counts: Mapping[str, float]
    metrics: Mapping[str, float | None]
    alignment: Alignment
    choices: Mapping[str, object]
    provenance: Mapping[str, object] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    path: PathErrors | None = None
    map: MapErrors | None = None
    true_path: Floats | None = None


def to_json(scores: Sequence[Score]) -> dict[str, object]:
    """What `trackside score --format json` prints and `scores/NAME.json` holds (`docs/formats.md`).

    NaN and infinity become null, so that every JSON reader takes it.
    """
    from capture import software

    return {
        "format": FORMAT,
        "software": software(),
        "scores": [_score_to_json(score) for score in scores],
    }


def _score_to_json(score: Score) -> dict[str, object]:
    alignment: dict[str, object] = {
        "mode": score.alignment.mode,
        "x": score.alignment.x,
        "y": score.alignment.y,
        "heading": score.alignment.heading,
        "heading_observed": score.alignment.heading_observed,
    }
    if score.alignment.matrix is not None:
        alignment["matrix"] = [list(row) for row in score.alignment.matrix]
    return {
        "name": score.name,
        "total": finite(score.total),
        "errors": {k: finite(v) for k, v in score.errors.items()},
        "weighted": {k: finite(v) for k, v in score.weighted.items()},
        "counts": dict(score.counts),
        "metrics": {k: finite(v) for k, v in score.metrics.items()},
        "alignment": alignment,
        "choices": json_ready(score.choices),
        "provenance": json_ready(score.provenance),
        "remarks": list(score.remarks),
    }


def finite(value: float | None) -> float | None:
    """The value, or None where JSON has no word for it."""
    return value if value is None or math.isfinite(value) else None


def json_ready(value: object) -> object:
    """The same value in words that JSON has: numbers that are not finite as text, all keys text."""
    if isinstance(value, Mapping):
        return {str(key): json_ready(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, str | int | float) else str(value)
