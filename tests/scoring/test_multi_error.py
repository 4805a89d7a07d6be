from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from score_scenes import landmark_map

from scoring import ERROR_NAMES, PRESETS, ScoreOptions
from scoring.distance_error import DistanceError
from scoring.multi_error import landmark_errors, path_errors, weigh
from scoring.pairing import pair_landmarks

ERRORS = dict(zip(ERROR_NAMES, (0.2, 0.5, 0.1, 2.0, 3.0, 0.4), strict=True))


def test_pose_and_maximum_pose_error() -> None:
    assert path_errors(np.array([0.1, 0.2, 0.6])) == pytest.approx({"pose": 0.3, "max_pose": 0.6})


def test_figure_3_3_four_landmarks_five_estimates_three_pairs() -> None:
    truth = landmark_map([(0, 0), (2, 0), (0, 2), (2, 2)])
    estimate = landmark_map([(0.1, 0), (2.2, 2), (2, 2.3), (0, 2.3), (5, 0)])
    pairs = pair_landmarks(truth.positions, estimate.positions, "saturated", 0.5)
    errors = landmark_errors(pairs, 4, 5, DistanceError(0.4, 1))
    assert errors == pytest.approx(
        {"map": 0.2, "false_negatives": 1.0, "false_positives": 2.0, "distance": 0.4}
    )


def test_the_total_is_equation_3_1() -> None:
    result = weigh(ERRORS, ScoreOptions())
    assert result.total == pytest.approx(0.2 + 0.5 + 0.1 + 0.6 + 0.9 + 0.4)
    assert result.errors == ERRORS
    assert result.weighted["false_positives"] == pytest.approx(0.9)
    assert result.remarks == ()


def test_weights_count_once_each() -> None:
    weights = (1.0, 10.0, 100.0, 1e3, 1e4, 1e5)
    total = weigh(ERRORS, ScoreOptions(weights=weights)).total
    assert total == pytest.approx(0.2 + 5 + 10 + 2e3 + 3e4 + 0.4e5)


def test_the_printed_total_has_the_pose_error_in_place_of_the_map_error() -> None:
    result = weigh(ERRORS, PRESETS["thesis-print"])
    assert result.total == pytest.approx(2 * 0.2 + 0.5 + 0.6 + 0.9 + 0.4)
    assert result.errors["map"] == 0.1
    assert "as printed in the thesis" in result.remarks[0]


def test_undefined_errors_add_nothing_or_forbid_the_total() -> None:
    partial = {**ERRORS, "map": None, "distance": None}
    result = weigh(partial, ScoreOptions())
    assert result.total == pytest.approx(0.2 + 0.5 + 0.6 + 0.9)
    assert result.weighted["map"] is None
    assert result.total is not None
    strict = weigh(partial, ScoreOptions(strict=True))
    assert strict.total is None
    assert strict.remarks == ("no Total under --strict: undefined map, distance",)
    assert weigh(ERRORS, ScoreOptions(strict=True)).total == result.total + 0.1 + 0.4


def test_errors_not_given_are_undefined() -> None:
    result = weigh({"pose": 0.2, "max_pose": 0.5}, ScoreOptions())
    assert result.total == pytest.approx(0.7)
    assert tuple(result.errors) == ERROR_NAMES
    assert result.errors["false_negatives"] is None


@pytest.mark.realdata
def test_the_preset_reproduces_the_totals_that_the_thesis_printed(data_dir: Path) -> None:
    columns = ("ep1", "ep2", "emap", "efn", "efp", "edist")
    options = ScoreOptions(total_formula="thesis-print", weights=(1.0,) * 6)
    off = []
    for file in sorted((data_dir / "thesis_tables").glob("table_*.csv")):
        with file.open() as stream:
            for row in csv.DictReader(stream):
                if row["total"]:
                    values = (float(row[column]) for column in columns)
                    total = weigh(dict(zip(ERROR_NAMES, values, strict=True)), options).total
                    assert total is not None
                    off.append(abs(total - float(row["total"])))
    assert len(off) == 52
    assert np.count_nonzero(np.array(off) <= 0.003 + 1e-9) == 49
