from __future__ import annotations

import csv
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import ProtocolError
from drivers.vesc import (
    VescCalibration,
    VescOdometry,
    VescValues,
    advance_odometry,
    begin_odometry,
)
from drivers.vesc.odometry import count_difference

# The defaults of f1tenth/vesc.
F1 = VescCalibration(
    speed_to_erpm_gain=4614.0,
    steering_angle_to_servo_gain=-1.2135,
    steering_angle_to_servo_offset=0.5304,
    wheelbase_m=0.25,
)


def state(
    t_s: float = 0.0,
    tachometer: int | None = 0,
    erpm: float = 4614.0,
    tachometer_abs: int | None = None,
) -> VescValues:
    return VescValues(
        round(t_s * 1e9), 0, erpm=erpm, tachometer=tachometer, tachometer_abs=tachometer_abs
    )


def test_the_reference_numbers_of_the_f1_defaults() -> None:
    """reference/protocols.md B.11 [computed]: ERPM 4614, servo 0.40."""
    step = advance_odometry(begin_odometry(state(), F1), state(0.02, 9), F1, servo=0.40)
    assert step.speed_m_s == 1.0
    assert F1.steering_angle_rad(0.40) == pytest.approx(0.107458, abs=5e-7)
    assert step.yaw_rate_rad_s == pytest.approx(0.431493, abs=5e-7)
    assert F1.metres_per_count == pytest.approx(2.167e-3, abs=5e-7)
    assert step.step_m == step.distance_m == pytest.approx(9 * 10 / 4614)


def test_a_circle_closes_and_has_the_radius_of_its_steering_angle() -> None:
    servo = 0.3
    radius_m = F1.wheelbase_m / math.tan(F1.steering_angle_rad(servo))
    counts = round(math.tau * radius_m / F1.metres_per_count)
    odometry, furthest_m = begin_odometry(state(), F1), 0.0
    for t, tachometer in enumerate(range(0, counts + 1, 4)):
        odometry = advance_odometry(odometry, state(0.02 * t, tachometer), F1, servo=servo)
        furthest_m = max(furthest_m, math.hypot(odometry.x_m, odometry.y_m))
    assert math.hypot(odometry.x_m, odometry.y_m) < 0.01
    assert furthest_m == pytest.approx(2 * radius_m, rel=1e-3)
    assert odometry.distance_m == pytest.approx(math.tau * radius_m, rel=2e-3)


def test_left_is_left_forward_and_backward() -> None:
    left = 0.5304 - 1.2135 * 0.2  # a positive, counter-clockwise angle
    forward = advance_odometry(begin_odometry(state(), F1), state(0.1, 100), F1, servo=left)
    assert (forward.x_m > 0, forward.y_m > 0, forward.heading_rad > 0) == (True, True, True)
    backward = advance_odometry(
        begin_odometry(state(), F1), state(0.1, -100, -4614.0), F1, servo=left
    )
    assert (backward.x_m < 0, backward.y_m > 0, backward.heading_rad < 0) == (True, True, True)
    assert backward.yaw_rate_rad_s == -forward.yaw_rate_rad_s


def test_the_sign_is_a_calibration() -> None:
    turned = replace(F1, direction=-1)
    step = advance_odometry(
        begin_odometry(state(), turned), state(0.1, -100, -4614.0), turned, servo=0.5304
    )
    assert step.speed_m_s == 1.0
    assert step.x_m == pytest.approx(100 * 10 / 4614)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31) + 1, 2**31 - 1))
def test_the_tachometer_may_wrap(before: int, driven: int) -> None:
    after = (before + driven + 2**31) % 2**32 - 2**31
    assert count_difference(before, after) == driven


def test_over_the_wrap_the_car_drives_on() -> None:
    odometry = begin_odometry(state(tachometer=2**31 - 3), F1)
    odometry = advance_odometry(odometry, state(0.02, -(2**31) + 2), F1, servo=0.5304)
    assert odometry.distance_m == pytest.approx(5 * F1.metres_per_count)


def test_who_does_not_know_the_servo_knows_the_distance_only() -> None:
    odometry = begin_odometry(state(erpm=0.0), F1)
    standing = advance_odometry(odometry, state(0.02, 0, 0.0), F1)
    assert (standing.yaw_rate_rad_s, standing.heading_rad) == (0.0, 0.0)  # what stands turns not
    moving = advance_odometry(standing, state(0.04, 461), F1)
    assert math.isnan(moving.yaw_rate_rad_s)
    assert all(map(math.isnan, (moving.x_m, moving.y_m, moving.heading_rad)))
    later = advance_odometry(moving, state(0.06, 922), F1, servo=0.5304)
    assert math.isnan(later.heading_rad)
    assert later.yaw_rate_rad_s == 0.0
    assert later.distance_m == pytest.approx(922 * 10 / 4614)


def test_a_gyro_wins_over_the_servo() -> None:
    step = advance_odometry(
        begin_odometry(state(), F1), state(0.1, 100), F1, servo=0.3, yaw_rate_rad_s=2.0
    )
    assert step.yaw_rate_rad_s == 2.0
    assert step.heading_rad == pytest.approx(0.2)
    assert math.atan2(step.y_m, step.x_m) == pytest.approx(0.1)  # the middle of the step


def test_headings_stay_in_the_half_open_turn() -> None:
    odometry = begin_odometry(state(), F1)
    for t in range(1, 100):
        odometry = advance_odometry(odometry, state(t), F1, yaw_rate_rad_s=-math.pi / 2)
        assert -math.pi < odometry.heading_rad <= math.pi
    half = advance_odometry(begin_odometry(state(), F1), state(1), F1, yaw_rate_rad_s=-math.pi)
    assert half.heading_rad == math.pi
    assert odometry.heading_rad == pytest.approx(math.pi / 2)  # 99 quarter turns clockwise


def test_slow_motion_counts_and_is_flagged() -> None:
    odometry = begin_odometry(state(erpm=100.0), F1)
    assert odometry.low_speed
    for t in range(1, 51):
        odometry = advance_odometry(odometry, state(t * 0.02, t // 5, 100.0), F1, servo=0.5304)
    assert odometry.low_speed
    assert odometry.distance_m == pytest.approx(10 * F1.metres_per_count)
    assert not advance_odometry(odometry, state(2.0, 10, 800.0), F1).low_speed


def test_a_tachometer_that_began_anew_is_no_motion() -> None:
    before = begin_odometry(state(tachometer=50_000, tachometer_abs=60_000), F1)
    after = advance_odometry(before, state(0.5, 0, tachometer_abs=0), F1, servo=0.5304)
    assert after.restarted
    assert (after.step_m, after.distance_m, after.x_m) == (0.0, 0.0, 0.0)
    onward = advance_odometry(after, state(0.52, 9, tachometer_abs=9), F1, servo=0.5304)
    assert not onward.restarted
    assert onward.distance_m == pytest.approx(9 * F1.metres_per_count)
    wrapped = advance_odometry(
        begin_odometry(state(tachometer=0, tachometer_abs=2**31 - 1), F1),
        state(0.02, -7, tachometer_abs=-(2**31) + 6),
        F1,
    )
    assert not wrapped.restarted


def test_values_without_a_tachometer_are_no_odometry() -> None:
    with pytest.raises(ProtocolError, match="bit 13"):
        begin_odometry(state(tachometer=None), F1)


@pytest.mark.parametrize(
    "change",
    [
        {"speed_to_erpm_gain": 0.0},
        {"speed_to_erpm_gain": -4614.0},
        {"wheelbase_m": math.nan},
        {"direction": 0},
        {"steering_angle_to_servo_gain": 0.0},
    ],
)
def test_calibrations_of_no_car(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(change))):
        replace(F1, **change)


@pytest.mark.realdata
def test_tachometer_and_erpm_of_a_real_car_agree(data_dir: Path) -> None:
    """data/vesc: six counts for each electrical turn, 2244 states at 50 Hz of firmware 2.18."""
    from rosbags.highlevel import AnyReader

    states: list[VescValues] = []
    with AnyReader([data_dir / "vesc" / "motor_servo_bag_2018-06-20-13-40-13.bag"]) as bag:
        topics = [topic for topic in bag.connections if topic.topic == "/sensors/core"]
        for topic, _, raw in bag.messages(connections=topics):
            message: Any = bag.deserialize(raw, topic.msgtype)
            stamp, told = message.header.stamp, message.state
            states.append(
                VescValues(
                    stamp.sec * 10**9 + stamp.nanosec,
                    0,
                    erpm=told.speed,
                    tachometer=int(told.displacement),
                    tachometer_abs=int(told.distance_traveled),
                )
            )
    odometry: list[VescOdometry] = [begin_odometry(states[0], F1)]
    for values in states[1:]:
        odometry.append(advance_odometry(odometry[-1], values, F1))
    assert len(odometry) == 2244
    assert not any(step.restarted for step in odometry)
    counts = odometry[-1].distance_m / F1.metres_per_count
    assert counts == pytest.approx(-3246)
    t_s = np.array([values.t_ns - states[0].t_ns for values in states]) * 1e-9
    turns = np.trapezoid([values.erpm for values in states], t_s) / 60
    assert counts / turns == pytest.approx(6.0, rel=2e-3)
    speed_integral_m = np.trapezoid([step.speed_m_s for step in odometry], t_s)
    assert odometry[-1].distance_m == pytest.approx(speed_integral_m, rel=2e-3)


def column(file: Path, *names: str) -> tuple[npt.NDArray[np.float64], ...]:
    with file.open(newline="") as text:
        rows = list(csv.DictReader(text))
    t_s = [int(row["s"]) - 1_651_608_966 + 1e-9 * int(row["ns"]) for row in rows]
    return np.array(t_s), *(np.array([float(row[name]) for row in rows]) for name in names)


@pytest.mark.realdata
def test_the_sign_and_gain_of_a_car_that_counts_backward(data_dir: Path) -> None:
    """frictionmaps DS5: v = -1.331e-4 * RPM, the slope of the car's own odometry over its ERPM."""
    car = replace(F1, speed_to_erpm_gain=1 / 1.331e-4, direction=-1)
    core_s, erpm = column(data_dir / "frictionmaps" / "DS5" / "coreData.csv", "RPM")
    odom_s, theirs = column(data_dir / "frictionmaps" / "DS5" / "odomData.csv", "vx")
    ours = np.array([car.speed_m_s(each) for each in erpm])
    theirs_then = np.interp(core_s, odom_s, theirs)
    slope = float(ours @ theirs_then / (ours @ ours))
    assert slope == pytest.approx(1.0, abs=2e-3)
    assert np.sqrt(np.mean((ours - theirs_then) ** 2)) < 0.05  # 0.30 m/s where their stamps lag
