from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from capture import TextFileError
from dialogue import UsageError
from slam.algorithms import Request
from trackside.tuning.plan import planned, seed_matters
from trackside.tuning.space import Range, Values, draws, grid, parsed_space


def test_lists_and_ranges_are_understood() -> None:
    assert parsed_space(
        [
            "a=1,2.5",
            "b=[robust, 3]",
            "c={min: 1, max: 4}",
            "d={min: 1e-3, max: 0.1, scale: log}",
            "e=7",
        ]
    ) == {
        "a": Values(("1", "2.5")),
        "b": Values(("robust", "3")),
        "c": Range(1.0, 4.0),
        "d": Range(1e-3, 0.1, log=True),
        "e": Values(("7",)),
    }


def test_a_file_is_understood_and_words_after_it_replace_its(tmp_path: Path) -> None:
    file = tmp_path / "space.yaml"
    file.write_text("a: [1, 2, true]\nb: {min: 0.5, max: 2}\nc: .inf\n")
    assert parsed_space([str(file), "a=9"]) == {
        "a": Values(("9",)),
        "b": Range(0.5, 2.0),
        "c": Values((".inf",)),
    }
    with pytest.raises(TextFileError, match=r"no\.yaml"):
        parsed_space([str(tmp_path / "no.yaml")])


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("accept_gate", "expected FILE.yaml or KEY=LIST"),
        ("=3", "expected FILE.yaml or KEY=LIST"),
        ("a=", "expected a list of values"),
        ("a=[[1, 2]]", "expected a list of values"),
        ("a=[1", "not a list of values"),
        ("a={min: 1}", "needs the numbers min and max"),
        ("a={min: 1, max: x}", "needs the numbers min and max"),
        ("a={min: 1, max: 2, scal: log}", "did you mean 'scale'"),
        ("a={min: 1, max: 2, scale: lin}", "expected linear or log"),
        ("a={min: 2, max: 1}", "expected min below max"),
        ("a={min: 0, max: 1, scale: log}", "both above 0"),
    ],
)
def test_a_word_that_cannot_be_is_told(word: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        parsed_space(["b=1", word])


def test_all_wrong_words_are_told_at_once() -> None:
    with pytest.raises(UsageError) as told:
        parsed_space(["a", "b={min: 1}"])
    assert len(str(told.value).splitlines()) == 2


def test_a_grid_holds_every_combination_and_no_range() -> None:
    space = parsed_space(["a=1,2", "b=x,y,z"])
    assert len(list(grid(space))) == 6
    assert {"a": "2", "b": "y"} in list(grid(space))
    with pytest.raises(UsageError, match="c: a range has no end of values; give --runs"):
        list(grid(parsed_space(["a=1", "c={min: 1, max: 2}"])))


def test_draws_fill_their_ranges() -> None:
    space = parsed_space(
        ["a={min: 1, max: 3}", "b={min: 1e-4, max: 1, scale: log}", "c={min: 2, max: 4}", "d=x,y"]
    )
    whole = {"a": False, "b": False, "c": True, "d": False}
    found = [next(draws(space, whole, 7, number)) for number in range(400)]
    a, b = (np.array([float(one[key]) for one in found]) for key in "ab")
    assert (a.min(), a.max()) == (pytest.approx(1.0, abs=0.02), pytest.approx(3.0, abs=0.02))
    assert np.mean(b < 1e-2) == pytest.approx(0.5, abs=0.08)
    assert {one["c"] for one in found} == {"2", "3", "4"}
    assert {one["d"] for one in found} == {"x", "y"}
    assert found[3] == next(draws(space, whole, 7, 3))
    assert found[3] != next(draws(space, whole, 8, 3))


EKF, FASTSLAM = Request(), Request(algorithm="fastslam")


def test_the_preset_itself_is_always_tried() -> None:
    plan = planned(parsed_space(["accept_gate=6,9"]), [EKF, FASTSLAM], None, 0)
    assert [(t.request.algorithm, t.number, dict(t.parameters)) for t in plan.trials] == [
        (name, number, parameters)
        for name in ("ekf", "fastslam")
        for number, parameters in enumerate([{}, {"accept_gate": "6"}, {"accept_gate": "9"}])
    ]
    assert plan.trials[1].request.settings == ("accept_gate=6",)


def test_a_parameter_of_one_algorithm_is_left_out_for_the_others() -> None:
    plan = planned(parsed_space(["particles=50,60", "accept_gate=6"]), [EKF, FASTSLAM], None, 0)
    found = [(t.request.algorithm, t.request.settings) for t in plan.trials]
    assert found == [
        ("ekf", ()),
        ("ekf", ("accept_gate=6",)),
        ("fastslam", ()),
        ("fastslam", ("accept_gate=6", "particles=50")),
        ("fastslam", ("accept_gate=6", "particles=60")),
    ]


def test_a_longer_search_begins_as_a_shorter_one() -> None:
    space = parsed_space(["accept_gate={min: 4, max: 16}", "min_seen={min: 1, max: 4}"])
    short, long = (planned(space, [EKF], runs, 5).trials for runs in (4, 9))
    assert long[: len(short)] == short
    assert len(long) == 10
    assert all("." not in trial.parameters["min_seen"] for trial in long[1:])


def test_values_that_contradict_each_other_are_drawn_again_or_counted() -> None:
    """A gate for new landmarks below that for known ones cannot be."""
    space = parsed_space(["accept_gate={min: 1, max: 40}", "spawn_gate={min: 1, max: 40}"])
    drawn = planned(space, [EKF], 30, 0)
    assert (len(drawn.trials), drawn.impossible) == (31, 0)
    listed = planned(parsed_space(["accept_gate=5,30", "spawn_gate=10,40"]), [EKF], None, 0)
    assert (len(listed.trials), listed.impossible) == (4, 1)
    with pytest.raises(UsageError, match="contradict each other"):
        planned(parsed_space(["accept_gate=30"]), [EKF], None, 0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["accept_gat=6"], "accept_gat: no such parameter; did you mean 'accept_gate'"),
        (["range_sigma_m=6"], "did you mean cones.*range_sigma_m or .*observation.range_sigma_m"),
        (["cones.max_rang_m=6"], "did you mean 'cones.max_range_m'"),
        (["odometry.wheelbas_m=6"], "did you mean 'odometry.wheelbase_m'"),
        (["accept_gate=6,-1"], r"accept_gate=-1: .*at least 0"),
        (["accept_gate={min: -1, max: 5}"], r"accept_gate=-1"),
        (["min_seen=1.5"], r"min_seen=1\.5"),
        (["cones.centre={min: 1, max: 2}"], "is no number"),
        (["observation=6"], "no such parameter"),
    ],
)
def test_a_wrong_parameter_is_told_before_any_run(words: list[str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        planned(parsed_space(["accept_gate=7", *words]), [EKF, FASTSLAM], 3, 0)


def test_all_unknown_parameters_are_told_at_once() -> None:
    with pytest.raises(UsageError) as told:
        planned(parsed_space(["a=1", "b=1", "accept_gate=6"]), [EKF], None, 0)
    assert re.findall(r"^\w", str(told.value), re.MULTILINE) == ["a", "b"]


def test_seeds_matter_to_who_draws() -> None:
    assert not seed_matters(EKF, "nearest")
    assert seed_matters(Request(algorithm="fastslam", settings=("particles=20",)), "likelihood")
