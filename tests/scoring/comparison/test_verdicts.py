"""What is said of the thesis follows from the numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from scoring.comparison import COLUMNS, Bootstrap, Comparison, Run, Runs, compare
from scoring.comparison.overview import landmarks_a_run, overview
from scoring.comparison.verdicts import verdicts

QUICK = Bootstrap(resamples=500)
WEIGHTS = {"weights": [1.0, 1.0, 1.0, 0.3, 0.3, 1.0]}


def made(ekf: list[tuple[float, float]], fastslam: list[tuple[float, float]]) -> Comparison:
    """Of (pose, Total) of each data set."""
    runs = []
    for name, values in (("ekf", ekf), ("fastslam", fastslam)):
        for trial, (pose, total) in enumerate(values, start=1):
            weighted = {**dict.fromkeys(COLUMNS, 0.6), "pose": pose, "total": total}
            runs.append(Run("turn", "Low", str(trial), name, weighted, Path("made"), WEIGHTS))
    return compare(Runs(tuple(runs)), how=QUICK)


def words(comparison: Comparison) -> list[str]:
    return [verdict.word for verdict in verdicts(comparison)]


NEAR = [(0.10 + 0.01 * k, 2.6 + 0.1 * k) for k in range(10)]
FAR = [(0.20 + 0.01 * ((3 * k) % 10), 6.1 + 0.1 * k) for k in range(10)]


def test_what_is_as_in_the_thesis_agrees() -> None:
    found = verdicts(made(NEAR, FAR))
    assert [v.word for v in found][:3] == ["level", "level", "agrees"]
    assert "3.05 m" in found[0].text
    assert "in the thesis it was 3.09 m" in found[0].text
    assert "Here too." in found[2].text
    # Perfectly correlated is more than the thesis found.
    assert [v.word for v in found][3] == "disagrees"
    assert "r = 1.00" in found[3].text
    assert "FastSLAM correlate" in found[4].text


def test_the_other_order_disagrees_and_the_same_ranking_speaks_against_the_hypothesis() -> None:
    found = verdicts(made(FAR, NEAR))
    assert [v.word for v in found][:3] == ["higher", "lower", "disagrees"]
    assert "Here it is better." in found[2].text
    assert found[-1].word == "disagrees"
    assert "0 of 10 data sets, 0%" in found[-1].text
    assert "speaks against the hypothesis" in found[-1].text


def test_what_is_not_known_is_open() -> None:
    mixed = [(0.1 + 0.01 * k, 3.0 + (1 if k % 2 else -1)) for k in range(10)]
    other = [(0.1 + 0.01 * k, 3.0 - (1 if k % 2 else -1)) for k in range(10)]
    assert words(made(mixed, other))[2] == "open"
    few = verdicts(made(NEAR[:2], FAR[:2]))
    assert [v.word for v in few][:3] == ["open", "open", "open"]
    assert "Too few runs" in few[0].text


def test_one_data_set_ranked_otherwise_keeps_the_hypothesis() -> None:
    swapped = [(0.9, NEAR[0][1]), *NEAR[1:]]
    last = verdicts(made(swapped, FAR))[-1]
    assert last.word == "agrees"
    assert "1 of 10 data sets, 10% (2% to 40%); in the thesis on 4 of 26" in last.text


def test_of_other_algorithms_the_thesis_says_nothing() -> None:
    run = Run("turn", "Low", "1", "graph", dict.fromkeys(COLUMNS, 1.0), Path("made"))
    assert verdicts(compare(Runs((run,)), how=QUICK)) == ()
    (row,) = overview({"mine": compare(Runs((run,)), how=QUICK)}).rows
    assert row[:5] == ("mine", "graph", 1, 0, 1.0)
    assert row[-4:] == (None,) * 4


def test_counts_are_errors_over_their_weights() -> None:
    comparison = made(NEAR, FAR)
    assert landmarks_a_run(comparison, "ekf", "false_negatives") == pytest.approx(2.0)
    row = overview({"thesis": comparison}).rows[1]
    assert row[:4] == ("thesis", "fastslam", 10, 0)
    assert row[7:9] == pytest.approx((2.0, 2.0))
    assert row[-4:] == pytest.approx((6.542, 8.064, 8.923, 0.244), abs=2e-3)
