from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dialogue import UsageError
from slam.cones.config import cone_config
from slam.cones.geometry import (
    d_certain,
    d_possible,
    detection_probability,
    explain_range,
    near_certain,
    near_possible,
    subtense_rad,
)

RADIUS_M, DEGREE = 0.05, math.radians(1.0)


def struck(distance_m: float, radius_m: float, spacing_rad: float, phase: float) -> int:
    """Beams of a lidar, the first at `phase` spacings, that strike a cone straight ahead."""
    beams = (np.arange(-400, 400) + phase) * spacing_rad
    ahead = np.abs(beams) < math.pi / 2
    return int(np.count_nonzero(np.abs(distance_m * np.sin(beams[ahead])) < radius_m))


def test_the_limits_of_four_to_ten_hits_on_the_cone_of_the_thesis() -> None:
    assert near_possible(10, RADIUS_M, DEGREE) == pytest.approx(0.522, abs=5e-4)
    assert near_certain(10, RADIUS_M, DEGREE) == pytest.approx(0.574, abs=5e-4)
    assert d_certain(4, RADIUS_M, DEGREE) == pytest.approx(1.433, abs=5e-4)
    assert d_possible(4, RADIUS_M, DEGREE) == pytest.approx(1.910, abs=5e-4)


def test_appendix_a_gives_where_five_hits_end_and_not_where_they_are_certain() -> None:
    printed_m = 0.1 / 2 / math.tan(math.radians(2.0))
    assert d_possible(5, RADIUS_M, DEGREE) == pytest.approx(printed_m, abs=1.5e-3)
    assert d_certain(5, RADIUS_M, DEGREE) == pytest.approx(1.146, abs=5e-4)


@pytest.mark.parametrize(
    ("distance_m", "hits", "expected"),
    [
        (1.43, (5, 800), 0.007),
        (1.25, (5, 800), 0.59),
        (1.15, (5, 800), 0.98),
        (1.5, (4, 10), 0.82),
        (1.7, (4, 10), 0.37),
        (1.9, (4, 10), 0.015),
        (1.0, (4, 10), 1.0),
        (1.92, (4, 10), 0.0),
        (0.52, (4, 10), 0.0),
    ],
)
def test_probabilities_of_the_reference(
    distance_m: float, hits: tuple[int, int], expected: float
) -> None:
    got = detection_probability(distance_m, RADIUS_M, DEGREE, *hits)
    assert got == pytest.approx(expected, abs=6e-3)


@given(st.floats(0.06, 4.0), st.floats(0.01, 0.05), st.floats(0.3, 2.0), st.floats(0.0, 1.0))
def test_beams_strike_as_often_as_foretold(
    distance_m: float, radius_m: float, spacing_deg: float, phase: float
) -> None:
    spacing = math.radians(spacing_deg)
    hits = struck(distance_m, radius_m, spacing, phase)
    expected = math.floor(subtense_rad(distance_m, radius_m) / spacing)
    assert hits in (expected, expected + 1)
    if distance_m < d_certain(expected, radius_m, spacing) - 1e-9:
        assert hits >= expected
    assert distance_m <= d_possible(hits, radius_m, spacing) + 1e-9
    assert distance_m >= near_possible(hits, radius_m, spacing) - 1e-9


def test_the_probability_is_the_share_of_phases_that_strike_so_often() -> None:
    phases = np.linspace(0.0, 1.0, 2000, endpoint=False)
    for distance_m in (0.55, 0.8, 1.5, 1.7):
        hits = np.array([struck(distance_m, RADIUS_M, DEGREE, phase) for phase in phases])
        share = float(np.mean((hits >= 4) & (hits <= 10)))
        expected = detection_probability(distance_m, RADIUS_M, DEGREE, 4, 10)
        assert share == pytest.approx(expected, abs=2e-3)


def test_limits_that_no_distance_meets() -> None:
    assert d_possible(1, RADIUS_M, DEGREE) == math.inf
    assert d_certain(200, RADIUS_M, DEGREE) == RADIUS_M
    assert near_possible(100_000, RADIUS_M, DEGREE) == RADIUS_M
    assert subtense_rad(0.01, RADIUS_M) == math.pi


def test_the_table_of_the_thesis() -> None:
    table = explain_range(cone_config("thesis"), DEGREE)
    detected = {row[0]: row[3] for row in table.rows}
    assert detected[1.0] == 1.0
    assert detected[1.5] == pytest.approx(0.82, abs=5e-3)
    assert detected[0.5] == detected[2.0] == 0.0
    assert "certain from 0.574 to 1.433 m, nil below 0.522 m and beyond 1.910 m" in table.note
    assert "4-10 hits" in table.title
    assert "3-4" in table.render("table")


def test_the_table_knows_the_range_filter() -> None:
    table = explain_range(cone_config("robust", ["max_range_m=1.25"]), math.radians(0.45))
    assert "certain from 0.200 to 1.250 m, nil below 0.200 m and beyond 1.250 m" in table.note
    assert [row[3] for row in table.rows if row[0] in (0.2, 1.2, 1.3)] == [1.0, 1.0, 0.0]
    assert "3 or more hits" in table.title
    assert "certain nowhere" in explain_range(cone_config("thesis"), 5 * DEGREE).note


def test_a_configuration_that_can_find_nothing_is_refused() -> None:
    with pytest.raises(UsageError, match="thesis"):
        cone_config("thesi")
    with pytest.raises(UsageError, match=r"min_range_m 3\.0 is above max_range_m 2\.0"):
        cone_config("thesis", ["min_range_m=3"])
    with pytest.raises(UsageError, match="min_hits 11 is above max_hits 10"):
        cone_config("thesis", ["min_hits=11"])
    with pytest.raises(UsageError, match="centre"):
        cone_config("robust", ["centre=middle"])
    assert cone_config("robust", ["mounting.x_m=0.2"]).mounting.x_m == 0.2
