"""What the rarer questions answer: the vehicle as the VESC's own settings see it, and its IMU.

GET_VALUES_SETUP trusts wheel, gears and poles as stored in the VESC: good for a check, not for
odometry. Only VESCs of the 6 family have an IMU, a 4.12 has none. (reference B.7)
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from drivers.errors import ProtocolError
from drivers.vesc.layout import DEGREES, PER_HOUR, Field, fitting, masked
from drivers.vesc.requests import ReadId

NAN = math.nan
STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class VescSetupValues:
    """The vehicle in SI units; NaN or None where firmware or mask leaves a field out.

    Currents, charges and energies are those of all VESCs on the bus together. uptime_s wraps after
    49 days.
    """

    fet_celsius: float = NAN
    motor_celsius: float = NAN
    motor_current_a: float = NAN
    input_current_a: float = NAN
    duty: float = NAN
    erpm: float = NAN
    speed_m_s: float = NAN
    input_voltage_v: float = NAN
    battery_level: float = NAN
    charge_drawn_coulomb: float = NAN
    charge_regained_coulomb: float = NAN
    energy_drawn_joule: float = NAN
    energy_regained_joule: float = NAN
    distance_m: float = NAN
    distance_abs_m: float = NAN
    position_rad: float = NAN
    fault: int | None = None
    controller_id: int | None = None
    vescs: int | None = None
    energy_left_joule: float = NAN
    odometer_m: float = NAN
    uptime_s: float = NAN


SETUP_GROUPS: tuple[tuple[Field, ...], ...] = tuple(
    (Field(*entry),)
    for entry in (
        ("fet_celsius", "h", 10.0),
        ("motor_celsius", "h", 10.0),
        ("motor_current_a", "i", 100.0),
        ("input_current_a", "i", 100.0),
        ("duty", "h", 1e3),
        ("erpm", "i", 1.0),
        ("speed_m_s", "i", 1e3),
        ("input_voltage_v", "h", 10.0),
        ("battery_level", "h", 1e3),
        ("charge_drawn_coulomb", "i", 1e4 * PER_HOUR),
        ("charge_regained_coulomb", "i", 1e4 * PER_HOUR),
        ("energy_drawn_joule", "i", 1e4 * PER_HOUR),
        ("energy_regained_joule", "i", 1e4 * PER_HOUR),
        ("distance_m", "i", 1e3),
        ("distance_abs_m", "i", 1e3),
        ("position_rad", "i", 1e6 / DEGREES),
        ("fault", "B", None),
        ("controller_id", "B", None),
        ("vescs", "B", None),
        ("energy_left_joule", "i", 1e3 * PER_HOUR),
        ("odometer_m", "I", 1.0),
        ("uptime_s", "I", 1e3),
    )
)


def decode_setup(payload: bytes) -> VescSetupValues:
    """The vehicle in a reply to GET_VALUES_SETUP or its selective form. Raises `ProtocolError`."""
    number = payload[0] if payload else -1
    layout, start = None, 1
    if number == ReadId.SETUP:
        layout = fitting(SETUP_GROUPS, len(payload) - start)
    elif number == ReadId.SETUP_SELECTIVE and len(payload) >= 5:
        start = 5
        layout = masked(SETUP_GROUPS, int.from_bytes(payload[1:5], "big"))
        layout = layout if len(payload) == start + layout.size else None
    if layout is None:
        raise ProtocolError(f"no setup values of a VESC: {payload.hex(' ')}")
    return VescSetupValues(**layout.named(payload, start))


@dataclass(frozen=True)
class VescImu:
    """The IMU of a VESC in its own axes and SI units; NaN where the mask leaves a field out.

    Acceleration is sent in g and the gyro in deg/s; both are converted. The unit of the
    magnetometer is not documented and stays as sent.
    """

    roll_rad: float = NAN
    pitch_rad: float = NAN
    yaw_rad: float = NAN
    acceleration_x_m_s2: float = NAN
    acceleration_y_m_s2: float = NAN
    acceleration_z_m_s2: float = NAN
    gyro_x_rad_s: float = NAN
    gyro_y_rad_s: float = NAN
    gyro_z_rad_s: float = NAN
    magnetometer_x: float = NAN
    magnetometer_y: float = NAN
    magnetometer_z: float = NAN
    quaternion_w: float = NAN
    quaternion_x: float = NAN
    quaternion_y: float = NAN
    quaternion_z: float = NAN
    controller_id: int | None = None


_IMU_NAMES = tuple(VescImu.__dataclass_fields__)[:16]
_IMU_FACTORS = (1.0,) * 3 + (STANDARD_GRAVITY_M_S2,) * 3 + (DEGREES,) * 3 + (1.0,) * 7


def decode_imu(payload: bytes) -> VescImu:
    """The readings in a reply to GET_IMU_DATA. Raises `ProtocolError`.

    `float32_auto` of the firmware is IEEE 754 single precision, subnormals sent as zero.
    """
    mask = int.from_bytes(payload[1:3], "big")
    bits = [bit for bit in range(16) if mask >> bit & 1]
    end = 3 + 4 * len(bits)
    if len(payload) < max(end, 3) or payload[0] != ReadId.IMU:
        raise ProtocolError(f"no IMU data of a VESC: {payload.hex(' ')}")
    numbers: tuple[float, ...] = struct.unpack_from(f">{len(bits)}f", payload, 3)
    values = {
        _IMU_NAMES[bit]: number * _IMU_FACTORS[bit]
        for bit, number in zip(bits, numbers, strict=True)
    }
    return VescImu(**values, controller_id=payload[end] if len(payload) > end else None)
