"""Every choice behind a score, with its default, its limits and its line of help.

The default is the thesis (F. Caesar, KTH 2019): Table 4.1 for c, d and the weights, section 3.1 for
the rest; where it leaves two readings open, each is an option. The command line, the checks and the
`choices` stored with a result all come from this one table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from types import MappingProxyType
from typing import Literal, TypeVar, get_args, get_type_hints

from dialogue import UsageError, nearest_names
from scoring.result import ERROR_NAMES

T = TypeVar("T")


def _option(default: T, group: str, text: str, **limits: float) -> T:
    """A dataclass field with its help and its limits: `above` (exclusive), `low`, `high`."""
    return field(default=default, metadata={"group": group, "help": text, **limits})


@dataclass(frozen=True, kw_only=True)
class ScoreOptions:
    """All choices of one scoring; lengths in metres, times in seconds, angles in radians.

    Raises `UsageError` naming option, value and limits. Weights stand in the order of
    `ERROR_NAMES`; the two for missed and false landmarks stay 0.3 when only the cut-off changes.
    """

    space: Literal["2d", "3d"] = _option(
        "2d", "Time", "2d: a car on a floor; 3d: a path in space, without a map."
    )
    sync: Literal["interpolate", "nearest"] = _option(
        "interpolate",
        "Time",
        "interpolate: truth at the stamps of the estimate; nearest: stamps that are each "
        "other's nearest, each used once.",
    )
    max_gap_s: float = _option(
        0.25, "Time", "interpolate: no pose inside a longer gap of the truth.", low=0.0
    )
    max_diff_s: float = _option(
        0.05, "Time", "nearest: largest difference of two paired stamps.", low=0.0
    )
    offset_s: float = _option(0.0, "Time", "Added to the stamps of the estimate.")
    min_poses: int = _option(
        10, "Time", "Fewer paired poses are refused: a chance overlap of two clocks.", low=1
    )
    align: Literal["origin", "none", "path", "map"] = _option(
        "origin",
        "Alignment",
        "One rigid transform of path and map: from the first paired pose with its heading, none, "
        "least squares of the path, or of the paired landmarks. Never scale.",
    )
    pairing: Literal["saturated", "max-pairs", "assign-then-cut", "greedy"] = _option(
        "saturated",
        "Landmarks",
        "Which landmarks are one: least sum of min(distance, cut-off); most pairs, then least sum; "
        "least sum of all, then cut; nearest first.",
    )
    cutoff_m: float = _option(
        0.3, "Landmarks", "c: two landmarks farther apart are no pair.", above=0.0
    )
    weights: tuple[float, ...] = _option(
        (1.0, 1.0, 1.0, 0.3, 0.3, 1.0),
        "Multi-error",
        f"w1..w6 of {', '.join(ERROR_NAMES)}. Changing --cutoff leaves the weights as they are.",
        low=0.0,
    )
    total_formula: Literal["eq-3.1", "thesis-print"] = _option(
        "eq-3.1",
        "Multi-error",
        "eq-3.1: sum of the weighted errors; thesis-print: as the printed Totals were made, the "
        "pose error once more in the place of the map error.",
    )
    strict: bool = _option(
        False, "Multi-error", "No Total when a part is undefined (otherwise it adds 0)."
    )
    detection_range_m: float = _option(
        1.5, "Multi-error", "d: farthest distance at which a landmark can be added.", above=0.0
    )
    distance_at: Literal["final", "add", "truth"] = _option(
        "final",
        "Multi-error",
        "Distance car to landmark at adding: to the final map, as estimated then, or true.",
    )
    distance_time: Literal["added", "first"] = _option(
        "added",
        "Multi-error",
        "added: when the surviving landmark entered the map; first: when any landmark first stood "
        "there.",
    )
    move_threshold_m: float = _option(
        0.05,
        "Multi-error",
        "The car moves once it is farther from its start; landmarks added before do not count.",
        low=0.0,
    )
    metric_order: float = _option(1.0, "Metrics", "p of OSPA, GOSPA and COLA.", low=1.0, high=100.0)
    ospa_cutoff_m: float | None = _option(
        None, "Metrics", "Cut-off of OSPA and COLA (default: --cutoff).", above=0.0
    )
    gospa_cutoff_m: float | None = _option(
        None, "Metrics", "Cut-off of GOSPA (default: twice --cutoff).", above=0.0
    )
    rpe_delta: float = _option(
        1.0, "Metrics", "Step of the relative pose error, consecutive steps.", above=0.0
    )
    rpe_unit: Literal["f", "m", "s"] = _option(
        "f", "Metrics", "Unit of that step: frames, metres (estimated path) or seconds."
    )

    def __post_init__(self) -> None:
        for name, valid in CHOICES.items():
            value = getattr(self, name)
            if value not in valid:
                raise UsageError(f"{flag_of(name)} {value!r}: {nearest_names(str(value), valid)}")
        for entry in fields(self):
            self._check_limits(entry.name, entry.metadata)
        self._check_combinations()

    def _check_limits(self, name: str, limits: Mapping[str, float]) -> None:
        value = getattr(self, name)
        for number in value if isinstance(value, tuple) else (value,):
            if number is None or isinstance(number, str | bool):
                continue
            low, high = limits.get("low", -math.inf), limits.get("high", math.inf)
            good = math.isfinite(number) and low <= number <= high
            if not (good and number > limits.get("above", -math.inf)):
                raise UsageError(f"{flag_of(name)} {number}: expected {_limits_text(limits)}")

    def _check_combinations(self) -> None:
        if len(self.weights) != len(ERROR_NAMES):
            raise UsageError(
                f"--weights has {len(self.weights)} values, expected {len(ERROR_NAMES)}: "
                f"{', '.join(ERROR_NAMES)}"
            )
        if self.min_poses != int(self.min_poses):
            raise UsageError(f"--min-poses {self.min_poses}: expected a whole number of poses")
        if self.rpe_unit == "f" and self.rpe_delta != int(self.rpe_delta):
            raise UsageError(
                f"--rpe-delta {self.rpe_delta}: expected a whole number of frames "
                "(or --rpe-unit m or s)"
            )
        if self.distance_at == "add" and self.distance_time == "first":
            raise UsageError(
                "--distance-at add with --distance-time first: the range is known at the adding "
                "of the surviving landmark only; use --distance-at final or truth"
            )
        if self.space == "3d" and self.align == "map":
            raise UsageError("--align map with --space 3d: a path in space has no map; use path")

    @property
    def ospa_cutoff(self) -> float:
        """Cut-off of OSPA and COLA in metres: c unless it was given."""
        return self.cutoff_m if self.ospa_cutoff_m is None else self.ospa_cutoff_m

    @property
    def gospa_cutoff(self) -> float:
        """Cut-off of GOSPA in metres: 2 c unless given, so that a missed landmark weighs c."""
        return 2.0 * self.cutoff_m if self.gospa_cutoff_m is None else self.gospa_cutoff_m

    def choices(self) -> dict[str, object]:
        """Every option in force, by name, as it is stored with the result."""
        in_force = replace(self, ospa_cutoff_m=self.ospa_cutoff, gospa_cutoff_m=self.gospa_cutoff)
        return {**asdict(in_force), "weights": list(self.weights)}


def flag_of(name: str) -> str:
    """The flag of an option: its name without the unit, `max_gap_s` -> `--max-gap`."""
    return "--" + name.removesuffix("_s").removesuffix("_m").replace("_", "-")


def unit_of(name: str) -> str:
    """The unit in an option's name: s, m or nothing."""
    return {"_s": "s", "_m": "m"}.get(name[-2:], "")


def _limits_text(limits: Mapping[str, float]) -> str:
    words = {"above": "above", "low": "at least", "high": "at most"}
    bounds = [f"{words[name]} {limits[name]:g}" for name in words if name in limits]
    return "a number " + " and ".join(bounds) if bounds else "a finite number"


CHOICES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        name: get_args(hint)
        for name, hint in get_type_hints(ScoreOptions).items()
        if get_args(hint) and all(isinstance(word, str) for word in get_args(hint))
    }
)
"""The words that each option of words may take."""

PRESETS: Mapping[str, ScoreOptions] = MappingProxyType(
    {"thesis": ScoreOptions(), "thesis-print": ScoreOptions(total_formula="thesis-print")}
)
"""Named sets of choices; `thesis` is the default."""
