"""The calibrations of a virtual car that somebody calibrated: the truth, off by what is usual."""

from __future__ import annotations

import math

import numpy as np

from capture import MeasuredCalibration, Parameter
from simulation.build import Build

MADE_UTC = "2019-05-14T09:00:00Z"
LIDAR_SIGMA_M, LIDAR_SIGMA_RAD = 0.0015, math.radians(0.1)
GAIN_SIGMA, GYRO_SCALE_SIGMA = 0.005, 0.0005
"""About what trackside calibrate reaches on the virtual track (benchmarks/virtual_track.py)."""


def car_calibrations(built: Build) -> list[MeasuredCalibration]:
    """Lidar, odometry and IMU of a car as it was built; the same errors for every run of a day."""
    off = np.random.default_rng(20190514).standard_normal(8).tolist()
    lidar = _calibration(
        "lidar",
        Parameter("x_m", built.lidar.x_m + LIDAR_SIGMA_M * off[0], LIDAR_SIGMA_M),
        Parameter("y_m", built.lidar.y_m + LIDAR_SIGMA_M * off[1], LIDAR_SIGMA_M),
        Parameter("yaw_rad", built.lidar.yaw_rad + LIDAR_SIGMA_RAD * off[2], LIDAR_SIGMA_RAD),
    )
    tied = built.vesc
    gain, steering = tied.speed_to_erpm_gain, tied.steering_angle_to_servo_gain
    odometry = _calibration(
        "odometry",
        _relative("speed_to_erpm_gain", gain, off[3]),
        _relative("steering_angle_to_servo_gain", steering, off[4]),
        Parameter("steering_angle_to_servo_offset", tied.steering_angle_to_servo_offset, 0.001),
        Parameter("wheelbase_m", tied.wheelbase_m + 0.001 * off[5], 0.002, "a tape measure"),
        Parameter("direction", float(tied.direction)),
        Parameter("low_speed_erpm", tied.low_speed_erpm),
    )
    scale = 1.0 / built.gyro_gain + GYRO_SCALE_SIGMA * off[6]
    imu = _calibration("imu", Parameter("gyro_scale", scale, GYRO_SCALE_SIGMA))
    return [lidar, odometry, imu]


def _relative(name: str, value: float, off: float) -> Parameter:
    return Parameter(name, value * (1.0 + GAIN_SIGMA * off), abs(value) * GAIN_SIGMA)


def _calibration(kind: str, *parameters: Parameter) -> MeasuredCalibration:
    return MeasuredCalibration(
        kind=kind,  # type: ignore[arg-type]  # one of its words, which the file's reader checks
        made_utc=MADE_UTC,
        accepted=True,
        parameters=parameters,
        how={"source": "trackside simulate: the truth, off by the sigmas"},
    )
