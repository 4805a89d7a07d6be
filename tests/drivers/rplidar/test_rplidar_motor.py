from __future__ import annotations

import math

from drivers.rplidar.motor import LARGEST_STEP, SLOWEST_PWM, Motor, MotorMethod
from drivers.rplidar.protocol import PWM_MAX, pwm_request

PERIOD_NS = 100_000_000


def steps(motor: Motor, period_s: float, turns: int) -> list[bytes]:
    """What is sent while the motor turns at a rate that nothing changes."""
    sent = [motor.correct(period_s, place * PERIOD_NS) for place in range(turns)]
    return [step for step in sent if step is not None]


def test_a_motor_that_does_not_follow_is_driven_to_its_limits_and_no_further() -> None:
    slow = Motor(MotorMethod.PWM, 10.0, None)
    sent = steps(slow, 1.0 / 8.0, 1000)
    assert sent[-1] == pwm_request(PWM_MAX)
    assert len(sent) == math.ceil((PWM_MAX - 600) / LARGEST_STEP)
    fast = Motor(MotorMethod.PWM, 10.0, None)
    assert steps(fast, 1.0 / 30.0, 1000)[-1] == pwm_request(SLOWEST_PWM)


def test_steps_are_small_and_seldom() -> None:
    motor = Motor(MotorMethod.PWM, 10.0, None)
    assert steps(motor, 1.0 / 9.0, 19) == []
    assert steps(motor, 1.0 / 9.0, 22) == [pwm_request(600 + round(0.5 * 600 / 9))]


def test_what_is_near_enough_is_left_alone() -> None:
    assert steps(Motor(MotorMethod.PWM, 10.0, None), 1.0 / 9.92, 200) == []


def test_what_has_no_pwm_or_a_fixed_one_is_left_alone() -> None:
    assert steps(Motor(MotorMethod.PWM, 10.0, 500), 1.0 / 5.0, 200) == []
    assert steps(Motor(MotorMethod.DTR, 10.0, None), 1.0 / 5.0, 200) == []
    assert steps(Motor(MotorMethod.RPM, 10.0, None), 1.0 / 5.0, 200) == []


def test_a_turn_without_a_period_says_nothing() -> None:
    assert steps(Motor(MotorMethod.PWM, 10.0, None), math.nan, 200) == []
