"""What the emulated devices of the car are moved by: lidar, motor controller, IMU.

Each is a function of world time (nanoseconds since the drive's first row) and adds the noise that
it states. Noise is drawn in the order in which a device asks: in simulated time one seed gives one
recording.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.imu import Motion, vector
from drivers.vesc import VescCalibration, VescValues, counter_reading
from geometry import Floats, compose
from simulation.car import GRAVITY_M_S2
from simulation.drive import Drive
from simulation.surfaces import Surroundings


@dataclass(frozen=True, kw_only=True)
class LidarNoise:
    """Of an RPLidar A2 at a few metres (reference/protocols.md A.5: 1 % of the range).

    lost : share of echoes that never come (dark cloth, sun); grazing_cos : below this cosine
    between beam and surface's normal nothing comes back; stray : share of beams that tell a
    distance at which nothing is.
    """

    sigma_m: float = 0.006
    sigma_per_m: float = 0.004
    lost: float = 0.02
    grazing_cos: float = 0.17
    stray: float = 0.002


class LidarWorld:
    """Ranges of beams, each from where the lidar is at its own time; a lidar emulator's source.

    pose_base_lidar : (3,) on the car; zero_ns : world time 0 on the emulator's clock.
    """

    def __init__(
        self,
        drive: Drive,
        around: Surroundings,
        pose_base_lidar: Floats,
        zero_ns: int,
        rng: np.random.Generator,
        noise: LidarNoise | None = None,
    ) -> None:
        self._drive, self._around, self._mounting = drive, around, pose_base_lidar
        self._zero_ns, self._rng, self._noise = zero_ns, rng, noise or LidarNoise()

    def __call__(
        self, t_ns: npt.NDArray[np.int64], bearing_rad: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Ranges (k,) in m, NaN where no echo comes."""
        lidar = compose(self._drive.poses(t_ns - self._zero_ns), self._mounting)
        exact_m, cosine = self._around.distances(
            lidar[:, 0], lidar[:, 1], lidar[:, 2] + bearing_rad
        )
        noise, rng = self._noise, self._rng
        sigma = noise.sigma_m + noise.sigma_per_m * np.where(np.isfinite(exact_m), exact_m, 0.0)
        measured = exact_m + sigma * rng.standard_normal(exact_m.size)
        chance = rng.random(exact_m.size)
        unseen = (chance < noise.lost) | (cosine < noise.grazing_cos) | ~np.isfinite(exact_m)
        measured[unseen] = np.nan
        stray = chance > 1.0 - noise.stray
        measured[stray] = rng.uniform(0.2, 5.0, int(stray.sum()))
        return measured


@dataclass(frozen=True, kw_only=True)
class ImuNoise:
    """Of an MPU-9250 on a car; bias_rad_s : as of the real one in ../shared/data/imu, at most.

    Densities per root hertz, at `rate_hz`; vibration_m_s2 : at 1 m/s.
    """

    rate_hz: float = 200.0
    gyro_density: float = math.radians(0.01)
    accel_density: float = 300e-6 * GRAVITY_M_S2
    bias_rad_s: float = math.radians(1.5)
    vibration_m_s2: float = 0.6
    vibration_rad_s: float = math.radians(0.8)
    tilt_sigma_rad: float = math.radians(0.7)


class ImuWorld:
    """What an IMU at the centre of mass feels; an IMU emulator's source. gain : of its gyro."""

    def __init__(
        self,
        drive: Drive,
        zero_ns: int,
        rng: np.random.Generator,
        noise: ImuNoise | None = None,
        gain: float = 1.0,
    ) -> None:
        self._drive, self._zero_ns, self._rng = drive, zero_ns, rng
        self.noise, self.gain = noise or ImuNoise(), gain
        self.bias_rad_s = rng.uniform(-1.0, 1.0, 3) * self.noise.bias_rad_s
        self._tilt = self.noise.tilt_sigma_rad * rng.standard_normal(2)
        self._gyro_sigma = self.noise.gyro_density * math.sqrt(self.noise.rate_hz / 2.0)
        self._accel_sigma = self.noise.accel_density * math.sqrt(self.noise.rate_hz / 2.0)

    def __call__(self, t_ns: int) -> Motion:
        """The motion at a time of the emulator's clock."""
        here, noise = self._drive.at(t_ns - self._zero_ns), self.noise
        shake = abs(here.wheel_m_s)
        gyro = self._gyro_sigma * self._rng.standard_normal(3)
        gyro += noise.vibration_rad_s * shake * self._rng.standard_normal(3)
        pull = self._accel_sigma * self._rng.standard_normal(3)
        pull += noise.vibration_m_s2 * shake * self._rng.standard_normal(3)
        turning = self.gain * np.array([0.0, 0.0, here.turn_rad_s]) + self.bias_rad_s + gyro
        level = np.array([here.pulled_ahead_m_s2, here.pulled_aside_m_s2, GRAVITY_M_S2])
        level[:2] += GRAVITY_M_S2 * self._tilt
        field = _field_t(here.heading_rad)
        attitude = (here.heading_rad, 0.0, 0.0)
        return Motion(vector(turning), vector(level + pull), field, 25.0, attitude)


def _field_t(heading_rad: float) -> tuple[float, float, float]:
    """The earth's field in Stockholm, x of the world to the east, as a car with iron feels it."""
    north, down = 15e-6, 49e-6
    x, y = north * math.sin(heading_rad), north * math.cos(heading_rad)
    return (1.08 * x + 4e-6, 0.95 * y - 7e-6, -down + 3e-6)


class VescWorld:
    """The state of the motor controller; the source of a `drivers.vesc.SourceMotor`.

    calibration : what truly ties its numbers to this car.
    """

    def __init__(self, drive: Drive, calibration: VescCalibration, zero_ns: int) -> None:
        self._drive, self._calibration, self._zero_ns = drive, calibration, zero_ns

    def __call__(self, t_ns: int) -> VescValues:
        """The state at a time of the emulator's clock."""
        here, tied = self._drive.at(t_ns - self._zero_ns), self._calibration
        erpm = tied.direction * tied.speed_to_erpm_gain * here.wheel_m_s
        tachometer = counter_reading(here.counted_m / tied.metres_per_count)
        return VescValues(
            t_ns,
            0,
            fet_celsius=31.0,
            motor_current_a=2.0 * here.wheel_m_s,
            duty=erpm / 48_000.0,
            erpm=float(round(erpm)),
            input_voltage_v=11.6 - 0.1 * here.wheel_m_s,
            tachometer=tachometer,
            tachometer_abs=abs(tachometer),
            fault=0,
        )
