"""Figures over hand-made runs, each known in closed form."""

from __future__ import annotations

from dataclasses import replace

import pytest
from comparison_runs import make_run

from dialogue import UsageError
from scoring import ScoringError
from scoring.comparison import Bootstrap, Run, Runs, Summary, compare

QUICK = Bootstrap(resamples=200)


def runs_of(*runs: Run) -> Runs:
    return Runs(tuple(runs))


def summary(runs: Runs, group: str, algorithm: str, column: str) -> Summary:
    found = compare(runs, how=QUICK).summaries
    return next(s for s in found if (s.group, s.algorithm, s.column) == (group, algorithm, column))


BOTH = runs_of(
    make_run("ekf", "turn Low 1", 1.0),
    make_run("ekf", "turn Low 2", 2.0),
    make_run("ekf", "turn Low 3", 3.0),
    make_run("ekf", "loop Low 1", 8.0),
    make_run("fast", "turn Low 1", 2.0),
    make_run("fast", "turn Low 2", 4.0),
    make_run("fast", "turn Low 3", 9.0),
    make_run("fast", "loop Low 1", 4.0),
)


def test_mean_and_sample_deviation_per_group() -> None:
    turn = summary(BOTH, "turn", "ekf", "pose")
    assert (turn.n, turn.mean, turn.std) == (3, 2.0, 1.0)
    assert summary(BOTH, "all", "ekf", "pose").mean == 3.5
    loop = summary(BOTH, "loop", "ekf", "pose")
    assert (loop.mean, loop.std, loop.interval) == (8.0, None, None)


def test_an_undefined_value_is_counted_and_never_zero() -> None:
    runs = runs_of(*BOTH.runs, make_run("ekf", "turn High 1", 6.0, map=None))
    found = summary(runs, "turn", "ekf", "map")
    assert (found.n, found.undefined, found.mean) == (3, 1, 2.0)
    assert summary(runs, "turn", "ekf", "pose").mean == 3.0


def test_a_missing_run_counts_nowhere_but_is_kept() -> None:
    gone = make_run("ekf", "turn High 1", 0.0)
    gone = replace(gone, weighted=dict.fromkeys(gone.weighted, None))
    found = compare(runs_of(*BOTH.runs, gone), how=QUICK)
    assert sum(run.missing for run in found.runs) == 1
    assert found.summaries == compare(BOTH, how=QUICK).summaries


def test_ratio_is_over_the_data_sets_of_both() -> None:
    runs = runs_of(*BOTH.runs, make_run("fast", "turn High 1", 100.0))
    found = next(c for c in compare(runs, how=QUICK).contrasts if c.column == "total")
    assert (found.group, found.algorithm, found.n) == ("turn", "fast", 3)
    assert found.mean == pytest.approx(30.0)
    assert found.baseline_mean == pytest.approx(12.0)
    assert found.ratio == pytest.approx(2.5)
    assert found.p_value == 2 / 2**3


def test_undefined_pairs_leave_the_ratio_undefined() -> None:
    runs = runs_of(make_run("ekf", "a b 1", 1.0, map=None), make_run("fast", "a b 1", 1.0))
    found = next(c for c in compare(runs, how=QUICK).contrasts if c.column == "map")
    assert (found.n, found.ratio, found.interval, found.p_value) == (0, None, None, None)


def test_group_without_the_baseline_has_an_empty_contrast() -> None:
    runs = runs_of(*BOTH.runs, make_run("fast", "hall Low 1", 1.0))
    found = [c for c in compare(runs, how=QUICK).contrasts if c.group == "hall"]
    assert {(c.n, c.ratio) for c in found} == {(0, None)}


def test_baseline_is_the_first_or_the_named() -> None:
    assert compare(BOTH, how=QUICK).baseline == "ekf"
    found = compare(BOTH, baseline="fast", how=QUICK)
    assert {c.algorithm for c in found.contrasts} == {"ekf"}
    with pytest.raises(UsageError, match="--baseline 'ekg': did you mean 'ekf'"):
        compare(BOTH, baseline="ekg")


def test_rank_disagreement_needs_different_winners() -> None:
    found = compare(
        runs_of(
            make_run("ekf", "a x 1", 1.0),
            make_run("fast", "a x 1", 2.0),
            make_run("ekf", "a x 2", 1.0, total=9.0),
            make_run("fast", "a x 2", 2.0, total=3.0),
            make_run("ekf", "a x 3", 1.0, total=9.0),
            make_run("fast", "a x 3", 1.0, total=3.0),
            make_run("ekf", "a x 4", 1.0),
            make_run("ekf", "a x 5", 1.0, total=None),
            make_run("fast", "a x 5", 2.0),
        ),
        how=QUICK,
    )
    assert [(r.dataset, r.disagrees) for r in found.rankings] == [
        ("x-1", False),
        ("x-2", True),
        ("x-3", False),
    ]
    assert found.rankings[2].lowest_pose == ("ekf", "fast")


def test_correlation_takes_runs_with_both_values() -> None:
    runs = runs_of(*BOTH.runs, make_run("ekf", "turn High 1", 5.0, total=None))
    found = next(c for c in compare(runs, how=QUICK).correlations if c.group == "turn")
    assert found.n == 3
    assert found.pearson == pytest.approx(1.0)


def test_two_runs_correlate_with_nothing() -> None:
    found = compare(runs_of(*BOTH.runs[:2]), how=QUICK).correlations[0]
    assert (found.n, found.pearson, found.spearman) == (2, None, None)


def test_groups_follow_the_choice_and_end_with_all() -> None:
    assert compare(BOTH, how=QUICK).groups == ("turn", "loop", "all")
    assert compare(BOTH, group_by="power", how=QUICK).groups == ("Low",)
    assert compare(BOTH, group_by="none", how=QUICK).groups == ("all",)


def test_runs_stand_low_medium_high_within_their_map() -> None:
    runs = runs_of(
        make_run("ekf", "turn High 1", 1.0),
        make_run("ekf", "turn Medium 1", 1.0),
        make_run("ekf", "loop Low 1", 1.0),
        make_run("ekf", "turn Low 1", 1.0),
    )
    found = [(run.map, run.power) for run in compare(runs, how=QUICK).runs]
    assert found == [("turn", "Low"), ("turn", "Medium"), ("turn", "High"), ("loop", "Low")]


def test_different_choices_are_remarked() -> None:
    first, second = BOTH.runs[:2]
    runs = runs_of(
        replace(first, choices={"align": "origin", "cutoff_m": 0.3}),
        replace(second, choices={"align": "path", "cutoff_m": 0.3}),
    )
    assert compare(runs, how=QUICK).remarks == (
        "the runs were scored with different align: origin, path; their numbers do not compare",
    )


def test_only_missing_runs_cannot_be_compared() -> None:
    gone = replace(BOTH.runs[0], weighted=dict.fromkeys(BOTH.runs[0].weighted, None))
    with pytest.raises(ScoringError, match="every run is missing"):
        compare(runs_of(gone))
