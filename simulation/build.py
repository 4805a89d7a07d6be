"""The virtual car as it is drawn, and as it was really built: what a calibration has to find."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from drivers.vesc import VescCalibration
from simulation.car import CarModel
from simulation.overhead import CarPlan

LIDAR_HEIGHT_M = 0.16


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where something sits on the car: a planar pose on `base_link`, and its height."""

    x_m: float
    y_m: float = 0.0
    yaw_rad: float = 0.0
    height_m: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Build:
    """Everything that a person measures on a car, or calibrates.

    gyro_gain : what the gyro tells for 1 rad/s. (The ZED's place: `simulation.stereo`.)
    """

    model: CarModel = field(default_factory=CarModel)
    vesc: VescCalibration
    lidar: Place
    rings: CarPlan
    gyro_gain: float = 1.0


AS_DRAWN = Build(
    vesc=VescCalibration(
        speed_to_erpm_gain=4614.0,
        steering_angle_to_servo_gain=-1.2135,
        steering_angle_to_servo_offset=0.5304,
        wheelbase_m=0.26,
    ),
    lidar=Place(x_m=0.13, height_m=LIDAR_HEIGHT_M),
    rings=CarPlan(front_x_m=0.25, rear_x_m=0.05, height_m=0.2),
)
"""F1TENTH's figures for the motor (reference/protocols.md B.11); the rest is a plan's."""

AS_BUILT = Build(
    vesc=VescCalibration(
        speed_to_erpm_gain=4614.0 * 1.031,
        steering_angle_to_servo_gain=-1.2135 * 0.955,
        steering_angle_to_servo_offset=0.5304 + 0.014,
        wheelbase_m=CarModel().wheelbase_m,
    ),
    lidar=Place(x_m=0.134, y_m=-0.003, yaw_rad=math.radians(1.2), height_m=LIDAR_HEIGHT_M),
    rings=CarPlan(front_x_m=0.2506, rear_x_m=0.0503, height_m=0.2005),
    gyro_gain=1.006,
)
"""Where screws and wheels ended up; nobody on the track knows these numbers."""
