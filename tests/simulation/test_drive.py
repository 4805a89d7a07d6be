"""The virtual car: its motion against closed forms, and what power does to it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from dialogue import UsageError
from simulation.car import GRAVITY_M_S2, CarModel, CarState, Command, advanced
from simulation.drive import Drive, driven
from simulation.driver import POWERS, power
from simulation.tracks import SIDE_M, TRACKS, track

CAR = CarModel()
AT_REST = CarState(0, 0, 0, 0, 0, 0, 0, 0, 0)


def after(state: CarState, command: Command, seconds: float, dt_s: float = 1e-3) -> CarState:
    for _ in range(round(seconds / dt_s)):
        state = advanced(CAR, state, command, dt_s)
    return state


def drive(map_name: str, setting: str, seed: int = 3) -> Drive:
    return driven(track(map_name), power(setting), CAR, np.random.default_rng(seed))


def test_a_car_that_is_not_driven_stands() -> None:
    assert after(AT_REST, Command(0.0, 0.3), 1.0)[:7] == (0.0,) * 7


def test_straight_wheels_drive_straight_and_count_a_little_more_than_was_driven() -> None:
    end = after(AT_REST, Command(0.6, 0.0), 4.0)
    assert end.y_m == 0.0
    assert end.heading_rad == 0.0
    assert 1.0 < end.counted_m / end.x_m < 1.05


@pytest.mark.parametrize("steering", [0.1, 0.3, -0.2])
def test_a_slow_turn_is_ackermanns(steering: float) -> None:
    end = after(AT_REST, Command(0.25, steering), 6.0)
    rear_aside = end.aside_m_s - CAR.com_m * end.turn_rad_s
    curvature = end.turn_rad_s / end.ahead_m_s
    assert curvature == pytest.approx(math.tan(steering) / CAR.wheelbase_m, rel=0.02)
    assert abs(rear_aside) < 0.01 * end.ahead_m_s


def test_a_spinning_wheel_pulls_as_hard_as_the_floor_lets_it() -> None:
    spinning = AT_REST._replace(wheel_m_s=5.0)
    end = after(spinning, Command(5.0, 0.0), 0.2)
    share = (CAR.wheelbase_m - CAR.com_m) / CAR.wheelbase_m
    assert 0.5 < end.ahead_m_s / 0.2 / (CAR.friction * GRAVITY_M_S2 * share) <= 1.0


def test_smaller_steps_give_the_same_drive() -> None:
    command = Command(1.5, 0.25)
    one = after(AT_REST, command, 1.0, 1e-3)
    other = after(AT_REST, command, 1.0, 2.5e-4)
    assert np.allclose(one, other, atol=1e-5)


@pytest.mark.parametrize("name", [name for name in TRACKS if name != "figures"])
def test_a_map_has_13_to_16_cones_within_the_square_beside_its_line(name: str) -> None:
    layout = track(name)
    assert 13 <= len(layout.cones) <= 16
    assert layout.cones.min() > 0.2
    assert layout.cones.max() < SIDE_M - 0.2
    gaps = np.linalg.norm(layout.cones[:, None] - layout.line[None], axis=2).min(axis=1)
    assert gaps.min() > 0.4
    assert np.hypot(*np.diff(layout.line, axis=0).T).max() < 0.011


@pytest.mark.parametrize(("name", "setting"), list(itertools.product(TRACKS, POWERS)))
def test_every_drive_follows_its_line_hits_nothing_and_ends_at_rest(
    name: str, setting: str
) -> None:
    layout, made = track(name), drive(name, setting)
    off = np.linalg.norm(made.rows[::10, None, :2] - layout.line[None, ::5], axis=2).min(axis=1)
    assert off.max() < 0.2
    to_cones = np.linalg.norm(made.rows[::10, None, :2] - layout.cones[None], axis=2).min()
    assert to_cones > 0.25
    assert abs(made.rows[-1, 3]) < 0.01
    assert np.linalg.norm(made.rows[-1, :2] - layout.line[-1]) < 0.15
    if name != "figures":
        assert 5.0 < made.end_ns * 1e-9 - 3.2 < 14.0


def test_high_power_drifts_without_being_much_faster() -> None:
    def sideslip_deg(made: Drive) -> float:
        moving = made.rows[:, 3] > 0.2
        return float(
            np.degrees(np.abs(np.arctan2(made.rows[moving, 4], made.rows[moving, 3])).max())
        )

    low, high = drive("turn", "low"), drive("turn", "high")
    assert sideslip_deg(low) < 1.5
    assert sideslip_deg(high) > 8.0
    assert 0.7 < high.end_ns / low.end_ns < 1.0


def test_a_moment_between_two_rows_lies_between_them() -> None:
    made = drive("turn", "low")
    middle = made.at(5_000_500_000)
    assert np.allclose(middle, (made.rows[5000] + made.rows[5001]) / 2.0)
    assert made.at(-1)[:3] == tuple(made.rows[0, :3])
    assert made.at(10**15)[:3] == tuple(made.rows[-1, :3])


def test_one_seed_one_drive() -> None:
    assert np.array_equal(drive("loop", "high", 4).rows, drive("loop", "high", 4).rows)
    assert not np.array_equal(
        drive("loop", "high", 4).rows[:9000], drive("loop", "high").rows[:9000]
    )


def test_names_that_are_none_are_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"scurve.*s-curve"):
        track("scurve")
    with pytest.raises(UsageError, match=r"hihg.*high"):
        power("hihg")
