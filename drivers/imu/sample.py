"""What every IMU gives, whatever its chip, and what an emulated one is moved by."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

STANDARD_GRAVITY_M_S2 = 9.80665

Vector: TypeAlias = tuple[float, float, float]
"""x, y, z in the frame of the accelerometer."""


def vector(values: Iterable[float]) -> Vector:
    """Three numbers of an array as plain floats. Raises `ValueError` where they are not three."""
    x, y, z = (float(value) for value in values)
    return (x, y, z)


@dataclass(frozen=True)
class ImuSample:
    """One inertial measurement, in the frame of the accelerometer.

    device_ns : on the clock of the device that the reading's ticks tie to ours, for the gyro;
    epoch : of that clock; angular_velocity_rad_s; linear_acceleration_m_s2 : with gravity, so
    about +9.8 on the axis that points up; acceleration_lag_ns : by how much the acceleration is
    older than the angular velocity (their filters differ; negative: younger); magnetic_field_t,
    temperature_c, orientation_wxyz (unit quaternion, of the device in its own level frame, z up):
    None where this sample has none.

    Plain floats, one object a sample: what writes them out needs numbers, not arrays, and at 1 kHz
    making them is far below a percent of a core (benchmarks/imu_decoding.py).
    """

    device_ns: int
    angular_velocity_rad_s: Vector
    linear_acceleration_m_s2: Vector
    magnetic_field_t: Vector | None = None
    temperature_c: float | None = None
    orientation_wxyz: tuple[float, float, float, float] | None = None
    acceleration_lag_ns: int = 0
    epoch: int = 0


@dataclass(frozen=True)
class Motion:
    """What an emulated IMU feels at one moment; units and frame as in `ImuSample`.

    yaw_pitch_roll_rad : its attitude, z up, for the firmwares that compute one.
    """

    angular_velocity_rad_s: Vector = (0.0, 0.0, 0.0)
    linear_acceleration_m_s2: Vector = (0.0, 0.0, STANDARD_GRAVITY_M_S2)
    magnetic_field_t: Vector = (15e-6, -2e-6, -45e-6)
    temperature_c: float = 25.0
    yaw_pitch_roll_rad: Vector = (0.0, 0.0, 0.0)


Source: TypeAlias = Callable[[int], Motion]
"""What moves an emulated IMU: its motion at a time of the caller's clock in nanoseconds."""


def quaternion_wxyz(
    yaw_rad: float, pitch_rad: float, roll_rad: float
) -> tuple[float, float, float, float]:
    """The unit quaternion of a turn about z, then the new y, then the new x."""
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def at_rest(t_ns: int) -> Motion:
    """A level IMU that lies still, with a faint tremble so that no two lines are alike."""
    tremble = 1e-3 * math.sin(1e-9 * t_ns * 91.0)
    return Motion(
        angular_velocity_rad_s=(tremble, -tremble, 0.5 * tremble),
        linear_acceleration_m_s2=(10.0 * tremble, 0.0, STANDARD_GRAVITY_M_S2),
    )
