"""A car as a single-track model whose tyres slip, and what it is made of.

Tyres push against their slip, a vector: what a spinning wheel gives ahead it lacks to the side, so
the rear slides where power is high. (Rajamani, Vehicle Dynamics and Control, 2nd ed., chapter 2 and
13: single track, combined slip; tyre curve of Pacejka's form sin(C atan(B s)).)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, kw_only=True)
class CarModel:
    """A 1:10 car driven at the rear, on a dusty floor.

    com_m : of the centre of mass ahead of the rear axle; slow_m_s : the speed below which slip is
    no longer divided by the speed, which would be none; lags are of first order.
    """

    mass_kg: float = 3.6
    yaw_inertia_kg_m2: float = 0.055
    wheelbase_m: float = 0.26
    com_m: float = 0.125
    friction: float = 0.40
    stiffness: float = 9.0
    shape: float = 1.5
    slow_m_s: float = 0.12
    rolling_per_s: float = 0.25
    servo_lag_s: float = 0.06
    servo_rate_rad_s: float = 7.0
    steering_limit_rad: float = 0.44
    motor_lag_s: float = 0.08


class CarState(NamedTuple):
    """Where the centre of mass is, how it moves (in the car's frame), wheels and steering.

    wheel_m_s : speed at which the driven wheels roll; counted_m : its integral.
    """

    x_m: float
    y_m: float
    heading_rad: float
    ahead_m_s: float
    aside_m_s: float
    turn_rad_s: float
    wheel_m_s: float
    steering_rad: float
    counted_m: float


class Command(NamedTuple):
    """What the driver wants of the wheels' speed and of the steering."""

    wheel_m_s: float
    steering_rad: float


def rates(car: CarModel, state: CarState, command: Command) -> CarState:
    """The time derivative of a state."""
    front_m = car.wheelbase_m - car.com_m
    front_n = car.mass_kg * GRAVITY_M_S2 * car.com_m / car.wheelbase_m
    rear_n = car.mass_kg * GRAVITY_M_S2 - front_n
    cos_steer, sin_steer = math.cos(state.steering_rad), math.sin(state.steering_rad)
    front_aside = state.aside_m_s + front_m * state.turn_rad_s
    rolls = state.ahead_m_s * cos_steer + front_aside * sin_steer
    slides = front_aside * cos_steer - state.ahead_m_s * sin_steer
    _, front_force = _tyre(car, front_n, 0.0, -slides, abs(rolls))
    speed = max(abs(state.wheel_m_s), abs(state.ahead_m_s))
    rear_aside = state.aside_m_s - car.com_m * state.turn_rad_s
    spin = state.wheel_m_s - state.ahead_m_s
    rear_ahead, rear_force = _tyre(car, rear_n, spin, -rear_aside, speed)
    ahead_force = rear_ahead - front_force * sin_steer - _drag(car, state)
    aside_force = rear_force + front_force * cos_steer
    torque = front_m * front_force * cos_steer - car.com_m * rear_force
    cos, sin = math.cos(state.heading_rad), math.sin(state.heading_rad)
    limit = car.servo_rate_rad_s
    return CarState(
        state.ahead_m_s * cos - state.aside_m_s * sin,
        state.ahead_m_s * sin + state.aside_m_s * cos,
        state.turn_rad_s,
        ahead_force / car.mass_kg + state.turn_rad_s * state.aside_m_s,
        aside_force / car.mass_kg - state.turn_rad_s * state.ahead_m_s,
        torque / car.yaw_inertia_kg_m2,
        (command.wheel_m_s - state.wheel_m_s) / car.motor_lag_s,
        min(max((command.steering_rad - state.steering_rad) / car.servo_lag_s, -limit), limit),
        state.wheel_m_s,
    )


def advanced(car: CarModel, state: CarState, command: Command, dt_s: float) -> CarState:
    """The state a step later: the classical Runge-Kutta method of fourth order."""
    k1 = rates(car, state, command)
    k2 = rates(car, _moved(state, k1, dt_s / 2), command)
    k3 = rates(car, _moved(state, k2, dt_s / 2), command)
    k4 = rates(car, _moved(state, k3, dt_s), command)
    return CarState(
        *(
            value + dt_s / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            for value, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True)
        )
    )


def _moved(state: CarState, rate: CarState, dt_s: float) -> CarState:
    return CarState(*(value + dt_s * change for value, change in zip(state, rate, strict=True)))


def _tyre(
    car: CarModel, load_n: float, ahead: float, aside: float, speed: float
) -> tuple[float, float]:
    """Force of an axle's tyres along their slip velocity (ahead, aside), in N."""
    size = math.hypot(ahead, aside)
    if size == 0.0:
        return 0.0, 0.0
    slip = size / max(speed, car.slow_m_s)
    force = car.friction * load_n * math.sin(car.shape * math.atan(car.stiffness * slip))
    return force * ahead / size, force * aside / size


def _drag(car: CarModel, state: CarState) -> float:
    return car.rolling_per_s * car.mass_kg * state.ahead_m_s
