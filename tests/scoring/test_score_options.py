from __future__ import annotations

from typing import Any

import pytest

from dialogue import UsageError
from scoring import ERROR_NAMES, PRESETS, ScoreOptions
from scoring.options import CHOICES, flag_of, unit_of


def test_the_default_is_the_thesis() -> None:
    options = ScoreOptions()
    assert options == PRESETS["thesis"]
    assert dict(zip(ERROR_NAMES, options.weights, strict=True)) == {
        "pose": 1.0,
        "max_pose": 1.0,
        "map": 1.0,
        "false_negatives": 0.3,
        "false_positives": 0.3,
        "distance": 1.0,
    }
    assert (options.cutoff_m, options.detection_range_m) == (0.3, 1.5)


def test_the_metric_cutoffs_follow_c_unless_given() -> None:
    assert ScoreOptions(cutoff_m=0.5).ospa_cutoff == 0.5
    assert ScoreOptions(cutoff_m=0.5).gospa_cutoff == 1.0
    assert ScoreOptions(cutoff_m=0.5, ospa_cutoff_m=0.2, gospa_cutoff_m=0.7).gospa_cutoff == 0.7


def test_weights_stay_when_the_cutoff_changes() -> None:
    assert ScoreOptions(cutoff_m=0.6).weights[3:5] == (0.3, 0.3)


def test_choices_hold_every_option_with_its_value_in_force() -> None:
    choices = ScoreOptions(cutoff_m=0.5).choices()
    assert choices["gospa_cutoff_m"] == 1.0
    assert choices["weights"] == [1.0, 1.0, 1.0, 0.3, 0.3, 1.0]
    assert set(CHOICES) < set(choices)
    assert choices["align"] == "origin"


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"max_gap_s": -1.0}, "--max-gap -1.0: expected a number at least 0"),
        ({"max_gap_s": float("nan")}, "--max-gap nan"),
        ({"offset_s": float("inf")}, "--offset inf: expected a finite number"),
        ({"cutoff_m": 0.0}, "--cutoff 0.0: expected a number above 0"),
        ({"min_poses": 0}, "--min-poses 0: expected a number at least 1"),
        ({"metric_order": 0.5}, "--metric-order 0.5: expected a number at least 1 and at most 100"),
        ({"weights": (1.0, 1.0)}, "--weights has 2 values, expected 6: pose, max_pose"),
        ({"weights": (1.0, -1.0, 1.0, 1.0, 1.0, 1.0)}, "--weights -1.0"),
        ({"align": "pathh"}, "--align 'pathh': did you mean 'path'"),
        ({"rpe_unit": "f", "rpe_delta": 0.5}, "--rpe-delta 0.5: expected a whole number"),
        ({"distance_at": "add", "distance_time": "first"}, "--distance-at add with"),
        ({"space": "3d", "align": "map"}, "--align map with --space 3d"),
    ],
)
def test_what_cannot_be_is_named_with_its_limits(given: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError) as caught:
        ScoreOptions(**given)
    assert text in str(caught.value)


def test_flags_are_named_without_units() -> None:
    assert [flag_of("max_gap_s"), flag_of("cutoff_m"), flag_of("weights")] == [
        "--max-gap",
        "--cutoff",
        "--weights",
    ]
    assert [unit_of("max_gap_s"), unit_of("cutoff_m"), unit_of("align")] == ["s", "m", ""]
