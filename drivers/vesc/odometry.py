"""Where the wheels say the car went: tachometer differences, and the servo or a gyro for turning.

Differences of the tachometer lose no slow motion and survive lost packets, as samples of ERPM do
not. Sign and gains belong to the car and are calibrated. (reference B.11)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from drivers.errors import ProtocolError
from drivers.vesc.values import VescValues

COUNTS = 1 << 32
ERPM_PER_COUNT_S = 10.0
"""Six counts per electrical turn, sixty seconds a minute."""


@dataclass(frozen=True, kw_only=True)
class VescCalibration:
    """What ties a VESC's numbers to the motion of the car it drives.

    speed_to_erpm_gain : ERPM per m/s, without sign; direction : 1, or -1 where the tachometer
    counts down when the car goes forward; servo = gain * steering angle (counter-clockwise, rad) +
    offset; wheelbase_m; low_speed_erpm : below it a motor without sensors only guesses its speed
    and direction. Raises `ValueError` for values that no car has.
    """

    speed_to_erpm_gain: float
    steering_angle_to_servo_gain: float
    steering_angle_to_servo_offset: float
    wheelbase_m: float
    direction: int = 1
    low_speed_erpm: float = 700.0

    def __post_init__(self) -> None:
        """Check what is divided by."""
        if not self.speed_to_erpm_gain > 0 or not self.wheelbase_m > 0:
            raise ValueError("speed_to_erpm_gain and wheelbase_m must be more than 0")
        if self.direction not in (1, -1):
            raise ValueError(f"direction is 1 or -1, not {self.direction}")
        if self.steering_angle_to_servo_gain == 0:
            raise ValueError("steering_angle_to_servo_gain must not be 0")

    @property
    def metres_per_count(self) -> float:
        """Forward distance for each count up; negative where the tachometer counts backwards."""
        return self.direction * ERPM_PER_COUNT_S / self.speed_to_erpm_gain

    def speed_m_s(self, erpm: float) -> float:
        """Forward speed."""
        return self.direction * erpm / self.speed_to_erpm_gain

    def steering_angle_rad(self, servo: float) -> float:
        """Counter-clockwise angle of the front wheels that a servo value stands for."""
        return (servo - self.steering_angle_to_servo_offset) / self.steering_angle_to_servo_gain

    def curvature_per_m(self, servo: float) -> float:
        """Counter-clockwise turning per metre driven (Ackermann steering, no slip)."""
        return math.tan(self.steering_angle_rad(servo)) / self.wheelbase_m


@dataclass(frozen=True)
class VescOdometry:
    """The pose of the car in the frame where it began, and how it moves.

    step_m : forward distance since the last one, distance_m : of all steps together, signed;
    speed_m_s : forward, of the ERPM. Where nobody says how a moving car turns, yaw_rate_rad_s is
    NaN and so, from then on, are x_m, y_m and heading_rad: distance and speed stay true.
    low_speed : tachometer and speed may be noise here; restarted : the tachometer began anew, what
    was driven meanwhile is unknown and counted as 0.
    """

    t_ns: int
    x_m: float
    y_m: float
    heading_rad: float
    speed_m_s: float
    yaw_rate_rad_s: float
    step_m: float
    distance_m: float
    low_speed: bool
    restarted: bool
    tachometer: int
    tachometer_abs: int | None


def begin_odometry(values: VescValues, calibration: VescCalibration) -> VescOdometry:
    """Odometry at its origin."""
    tachometer = _tachometer(values)
    return VescOdometry(
        values.t_ns,
        *(0.0, 0.0, 0.0),
        speed_m_s=calibration.speed_m_s(values.erpm),
        yaw_rate_rad_s=math.nan,
        step_m=0.0,
        distance_m=0.0,
        low_speed=_is_low(values.erpm, calibration),
        restarted=False,
        tachometer=tachometer,
        tachometer_abs=values.tachometer_abs,
    )


def advance_odometry(
    before: VescOdometry,
    values: VescValues,
    calibration: VescCalibration,
    *,
    servo: float | None = None,
    yaw_rate_rad_s: float | None = None,
) -> VescOdometry:
    """Odometry at the next state of the VESC.

    servo : in force since `before` (0 to 1), which tells the curvature; yaw_rate_rad_s : mean of a
    gyro over the step, which is better and wins: it sees slip, the servo's lag and its play.
    The heading in the middle of the step serves for all of it. Raises `ProtocolError` where the
    values hold no tachometer (it is not in the mask).
    """
    tachometer = _tachometer(values)
    counts = count_difference(before.tachometer, tachometer)
    restarted = _restarted(before, values, counts)
    step_m = 0.0 if restarted else counts * calibration.metres_per_count
    speed_m_s = calibration.speed_m_s(values.erpm)
    if yaw_rate_rad_s is not None:
        turn_rad = yaw_rate_rad_s * ((values.t_ns - before.t_ns) * 1e-9)
    else:
        curvature = math.nan if servo is None else calibration.curvature_per_m(servo)
        # What stands does not turn, whatever its wheels point at.
        turn_rad = curvature * step_m if step_m else 0.0
        yaw_rate_rad_s = curvature * speed_m_s if speed_m_s else 0.0
    middle_rad = before.heading_rad + 0.5 * turn_rad
    return replace(
        before,
        t_ns=values.t_ns,
        x_m=before.x_m + step_m * math.cos(middle_rad),
        y_m=before.y_m + step_m * math.sin(middle_rad),
        heading_rad=_wrapped(before.heading_rad + turn_rad),
        speed_m_s=speed_m_s,
        yaw_rate_rad_s=yaw_rate_rad_s,
        step_m=step_m,
        distance_m=before.distance_m + step_m,
        low_speed=_is_low(values.erpm, calibration),
        restarted=restarted,
        tachometer=tachometer,
        tachometer_abs=values.tachometer_abs,
    )


def count_difference(before: int, after: int) -> int:
    """Counts from one reading of a 32-bit counter to the next, over its wrap the short way."""
    return (after - before + COUNTS // 2) % COUNTS - COUNTS // 2


def _restarted(before: VescOdometry, values: VescValues, counts: int) -> bool:
    """Whether the counters disagree: net counts are never more than those of both directions."""
    if before.tachometer_abs is None or values.tachometer_abs is None:
        return False
    return count_difference(before.tachometer_abs, values.tachometer_abs) < abs(counts)


def _tachometer(values: VescValues) -> int:
    if values.tachometer is None:
        raise ProtocolError("these values of a VESC hold no tachometer; add bit 13 to the mask")
    return values.tachometer


def _wrapped(angle_rad: float) -> float:
    """The same direction in (-pi, pi]."""
    angle = math.remainder(angle_rad, math.tau)
    return math.pi if angle <= -math.pi else angle


def _is_low(erpm: float, calibration: VescCalibration) -> bool:
    return not abs(erpm) >= calibration.low_speed_erpm
