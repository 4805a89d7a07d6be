"""What a session gives when it is read: one frozen record of columns per stream.

All stamps are measurement times in nanoseconds UTC (int64), increasing; all units SI; all angles
counter-clockwise in radians. n is the number of messages.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps


@dataclass(frozen=True, eq=False)
class Odometry:
    """Dead-reckoned motion of the car as one source tells it.

    t_ns : (n,); pose_odom_base : (n, 3), x y heading of the car in the frame the source began in;
    speed_m_s, yaw_rate_rad_s : (n,), forward speed and turn rate; lost_t_ns : stamps of messages in
    which the source said that it does not know how the car moved (they are no samples).
    """

    source: str
    t_ns: Stamps
    pose_odom_base: Floats
    speed_m_s: Floats
    yaw_rate_rad_s: Floats
    lost_t_ns: Stamps = field(default_factory=lambda: np.zeros(0, np.int64))


@dataclass(frozen=True, eq=False)
class UncertainOdometry:
    """Odometry and how well it is known.

    pose_covariance : (n, 3, 3) of x, y, heading in the frame the source began in;
    twist_covariance : (n, 3, 3) of the speeds ahead and to the left, and the turn rate.
    """

    odometry: Odometry
    pose_covariance: Floats
    twist_covariance: Floats


@dataclass(frozen=True, eq=False)
class Scans:
    """Lidar revolutions, beams in one row of columns.

    t_ns : (n,) time of the first beam; starts : (n + 1,), revolution k owns beams
    `starts[k]:starts[k + 1]`; beam_t_ns, range_m, bearing_rad, intensity : (beams,), in the lidar
    frame. A beam without echo has range NaN; intensity is NaN where the lidar gives none.
    """

    t_ns: Stamps
    starts: npt.NDArray[np.int64]
    beam_t_ns: Stamps
    range_m: Floats
    bearing_rad: Floats
    intensity: Floats


@dataclass(frozen=True, eq=False)
class Imu:
    """Inertial measurements in the IMU frame.

    t_ns : (n,); angular_velocity_rad_s, linear_acceleration_m_s2 : (n, 3), the latter with gravity.
    """

    t_ns: Stamps
    angular_velocity_rad_s: Floats
    linear_acceleration_m_s2: Floats


@dataclass(frozen=True, eq=False)
class MagneticField:
    """The magnetic field in the axes of the accelerometer.

    t_ns : (n,); field_t : (n, 3), tesla.
    """

    t_ns: Stamps
    field_t: Floats


@dataclass(frozen=True, eq=False)
class VescState:
    """Telemetry of the motor controller.

    t_ns : (n,); speed_erpm : electrical turns per minute; tachometer : counts, six per electrical
    turn; voltage_v, motor_current_a, duty : (n,).
    """

    t_ns: Stamps
    speed_erpm: Floats
    tachometer: Floats
    voltage_v: Floats
    motor_current_a: Floats
    duty: Floats


@dataclass(frozen=True, eq=False)
class Drive:
    """What the car was told to do.

    t_ns : (n,); steering_rad : (n,) angle of the front wheels, left positive; speed_m_s : (n,).
    """

    t_ns: Stamps
    steering_rad: Floats
    speed_m_s: Floats


@dataclass(frozen=True, eq=False)
class Observations:
    """Range and bearing of landmarks as seen from the car.

    t_ns : (m,), one per observation, non-decreasing, equal within one scan;
    landmark_id : (m,) int64, -1 where the sensor does not know; range_m, bearing_rad : (m,).
    """

    t_ns: Stamps
    landmark_id: npt.NDArray[np.int64]
    range_m: Floats
    bearing_rad: Floats

    @property
    def batch_starts(self) -> npt.NDArray[np.int64]:
        """(k + 1,): observations of scan j are `batch_starts[j]:batch_starts[j + 1]`."""
        first = np.flatnonzero(np.diff(self.t_ns, prepend=self.t_ns[:1] - 1))
        return np.append(first, self.t_ns.size).astype(np.int64)


Samples = TypeVar("Samples", Odometry, Imu, VescState, Drive)
"""Streams with one row in every column for each of their samples."""


def joined(one: Samples, other: Samples) -> Samples:
    """The samples of one and then of the other."""
    both: dict[str, Any] = {
        name: np.concatenate([getattr(one, name), column])
        for name, column in _columns(other).items()
    }
    return replace(other, **both)


def split(samples: Samples, row: int) -> tuple[Samples, Samples]:
    """The samples before a row, and those from it on."""
    size = samples.t_ns.size
    until_ns = samples.t_ns[row] if row < size else np.iinfo(np.int64).max
    head: dict[str, Any] = {}
    tail: dict[str, Any] = {}
    for name, column in _columns(samples).items():
        at = int(np.searchsorted(column, until_ns)) if name == "lost_t_ns" else row
        head[name], tail[name] = column[:at], column[at:]
    return replace(samples, **head), replace(samples, **tail)


def extended(known: Samples, new: Samples | None) -> Samples:
    """The known samples and the new ones; those that come too late to stand after them are lost."""
    if new is None:
        return known
    if not known.t_ns.size:
        return joined(known, new)
    return joined(known, split(new, int(np.searchsorted(new.t_ns, known.t_ns[-1], "right")))[1])


def _columns(samples: Samples) -> dict[str, Any]:
    values = {part.name: getattr(samples, part.name) for part in fields(samples)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
