"""The tests of the thesis' hypothesis, against cases that can be counted by hand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from scoring.comparison import COLUMNS, Bootstrap, Comparison, Run, Runs, compare
from scoring.comparison.hypothesis import corrected_contrasts, disagreement, effects
from scoring.comparison.statistics import holm, share_interval

QUICK = Bootstrap(resamples=300)


def run(algorithm: str, name: str, power: str, trial: int, pose: float, total: float) -> Run:
    weighted = {**dict.fromkeys(COLUMNS, 0.1), "pose": pose, "total": total}
    return Run(name, power, str(trial), algorithm, weighted, Path("by hand"))


def made(runs: Sequence[Run]) -> Comparison:
    return compare(Runs(tuple(runs)), how=QUICK)


def two_maps() -> list[Run]:
    """FastSLAM's Total is 1 m more; its pose error is less on the two trials of high power."""
    runs = []
    for name, base in (("turn", 1.0), ("loop", 3.0)):
        for power, more in (("Low", 0.0), ("High", 0.5)):
            for trial in (1, 2):
                total = base + more + 0.01 * trial
                runs.append(run("ekf", name, power, trial, 0.2, total))
                pose = 0.1 if power == "High" else 0.3
                runs.append(run("fastslam", name, power, trial, pose, total + 1.0))
    return runs


def test_holm_by_hand() -> None:
    # 0.01 * 3, then the larger of that and 0.03 * 2, then of that and 0.04.
    assert holm([0.04, 0.01, 0.03]) == pytest.approx((0.06, 0.03, 0.06))
    assert holm([0.5, None, 0.9]) == (1.0, None, 1.0)
    assert holm([]) == ()


@pytest.mark.parametrize(
    ("count", "n", "low", "high"),
    # Of 0 of n the upper end is z^2 / (n + z^2).
    [(4, 26, 0.0615, 0.3353), (0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0)],
)
def test_the_interval_of_a_share(count: int, n: int, low: float, high: float) -> None:
    found = share_interval(count, n)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-4)


def test_a_share_of_nothing_has_no_interval() -> None:
    assert share_interval(0, 0) is None
    alone = disagreement(made([run("ekf", "turn", "Low", 1, 0.1, 1.0)]))
    assert (alone.count, alone.n, alone.share, alone.interval) == (0, 0, None, None)


def test_wrong_orders_are_counted() -> None:
    found = disagreement(made(two_maps()))
    assert (found.count, found.n, found.share) == (4, 8, 0.5)
    assert found.interval == share_interval(4, 8)


def test_p_values_are_corrected_over_the_maps_only() -> None:
    comparison = made(two_maps())
    found = {(c.contrast.group, c.contrast.column): c for c in corrected_contrasts(comparison)}
    assert len(found) == len(comparison.contrasts)
    total = found["turn", "total"]
    # Four equal differences: 2 of 16 sign patterns are as extreme; two maps.
    assert total.contrast.p_value == pytest.approx(0.125)
    assert total.p_value == pytest.approx(0.25)
    everything = found["all", "total"]
    assert everything.p_value == everything.contrast.p_value == pytest.approx(2 / 256)


def test_effects_of_power_and_map() -> None:
    found = {(e.algorithm, e.column, e.what, e.against): e for e in effects(made(two_maps()))}
    assert len(found) == 2 * 2 * 2
    power = found["ekf", "total", "high", "low"]
    assert power.n == 4
    assert power.mean == pytest.approx(0.5)
    assert power.interval is not None
    assert power.interval.low == pytest.approx(power.interval.high)
    assert power.p_value == pytest.approx(0.125)
    assert found["fastslam", "pose", "high", "low"].mean == pytest.approx(-0.2)
    assert found["fastslam", "total", "loop", "turn"].mean == pytest.approx(2.0)


def test_a_pair_that_lacks_one_does_not_count() -> None:
    runs = two_maps()
    lost = Run("turn", "Low", "1", "ekf", dict.fromkeys(COLUMNS), Path("by hand"))
    left = [
        lost if (r.map, r.dataset, r.algorithm) == ("turn", "Low-1", "ekf") else r for r in runs
    ]
    found = {(e.algorithm, e.column, e.what): e for e in effects(made(left))}
    assert found["ekf", "total", "high"].n == 3
    assert found["ekf", "total", "loop"].n == 3
    assert found["fastslam", "total", "high"].n == 4
    only_low = [r for r in runs if r.power == "Low" and r.map == "turn"]
    assert effects(made(only_low)) == ()
