"""Inertial measurement units: rotation rate, acceleration, magnetic field, whatever the board.

`mpu9250` is the bare chip on I2C, `razor` SparkFun's Razor on a serial line with either of its
firmwares. Both are a `Device[ImuSample]` in the frame of the accelerometer; `bias` tells what the
gyro reads at rest. Nothing here corrects a measurement: raw data stays raw.
"""

from drivers.imu.bias import StillBias, still_bias
from drivers.imu.sample import (
    STANDARD_GRAVITY_M_S2,
    ImuSample,
    Motion,
    Source,
    Vector,
    at_rest,
    vector,
)

__all__ = [
    "STANDARD_GRAVITY_M_S2",
    "ImuSample",
    "Motion",
    "Source",
    "StillBias",
    "Vector",
    "at_rest",
    "still_bias",
    "vector",
]
