"""Drives with exact truth: what gyro and wheels of the car tell, and what the film shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calibration.clocks.motion import (
    CarMotion,
    FilmedMotion,
    counted_motion,
    filmed_distance,
    filmed_heading,
    gyro_motion,
)
from capture import GroundTruth, Imu, VescState
from geometry import Floats, Trajectory, wrap

OFFSET_S, SKEW = 0.4371, 15e-6
START_NS = 1_780_000_000_000_000_000
METRES_PER_COUNT = 10.0 / 4614.0


@dataclass(frozen=True)
class Drive:
    """A car that stands, drives for some seconds, and stands.

    kind : eight (curves of both hands), straight (one speed, no curve), stands. offset_s : car
    time minus film time in the middle of the film. slip : seconds^2/m by which wheels run ahead.
    """

    seed: int = 0
    kind: str = "eight"
    still_s: float = 2.0
    driven_s: float = 9.0
    offset_s: float = OFFSET_S
    skew: float = SKEW
    slip: float = 0.002
    heading_sigma_rad: float = math.radians(0.03)
    place_sigma_m: float = 3e-4
    film_hz: float = 30.0
    gap: bool = True

    @property
    def duration_s(self) -> float:
        return 2.0 * self.still_s + self.driven_s

    def course(self) -> tuple[Floats, Floats, Floats]:
        """Film time (1 kHz), speed, turn rate."""
        rng = np.random.default_rng(1000 + self.seed)
        t_s = np.arange(0.0, self.duration_s, 1e-3)
        driven = t_s - self.still_s
        ramp = np.clip(np.minimum(driven, self.driven_s - driven) / 0.8, 0.0, 1.0)
        speed = 1.2 * ramp**2 * (3.0 - 2.0 * ramp)
        curve = np.zeros(t_s.size)
        if self.kind == "stands":
            speed = np.zeros(t_s.size)
        elif self.kind == "straight":
            speed = np.full(t_s.size, 0.3)
        else:
            speed *= 1.0 + 0.25 * np.sin(1.1 * driven + rng.uniform(0, 6))
            for rate, most in ((0.35, 1.0), (0.8, 0.7), (1.7, 0.3)):
                curve += most * np.sin(rate * driven + rng.uniform(0, 6))
        return t_s, speed, curve * speed

    def car_s(self, film_s: Floats) -> Floats:
        """Car time of a film time, both in seconds since `START_NS`."""
        middle = 0.5 * self.duration_s
        return film_s + self.offset_s + self.skew * (film_s - middle)

    def truth(self) -> GroundTruth:
        """What was filmed, on the film's clock."""
        rng = np.random.default_rng(self.seed)
        t_s, x, y, heading, _ = self._moved()
        at_s = np.arange(0.0, self.duration_s - 0.01, 1.0 / self.film_hz)
        noise = rng.normal(size=(3, at_s.size))
        pose = np.stack([np.interp(at_s, t_s, one) for one in (x, y, heading)], axis=1)
        pose += (noise * [[self.place_sigma_m], [self.place_sigma_m], [self.heading_sigma_rad]]).T
        pose[:, 2] = wrap(pose[:, 2])
        covariance = np.diag([9e-8, 9e-8, self.heading_sigma_rad**2 + 1e-9])
        bridged = np.zeros(at_s.size, bool)
        kept = np.ones(at_s.size, bool)
        if self.gap:
            begin = int(rng.uniform(0.3, 0.6) * at_s.size)
            bridged[begin : begin + 8] = True
            kept[begin + 40 : begin + 62] = False
        t_ns = START_NS + np.rint(at_s * 1e9).astype(np.int64)
        path = Trajectory.from_poses(t_ns[kept], pose[kept])
        covariances = np.repeat(covariance[None], int(kept.sum()), axis=0)
        return GroundTruth(path, None, {}, covariances, bridged[kept])

    def imu(self) -> Imu:
        """A gyro with bias, a scale that is off, and noise; 200 Hz."""
        rng = np.random.default_rng(self.seed + 7)
        t_s, *_, rate = self._moved()
        car_s = self.car_s(t_s)
        at_s = np.arange(car_s[0] - 1.5, car_s[-1] + 1.0, 1.0 / 200.0)
        inside = (at_s >= car_s[0]) & (at_s <= car_s[-1])
        turn = np.where(inside, np.interp(at_s, car_s, rate), 0.0)
        told = turn * (1.0 + rng.normal(0, 0.01)) + rng.normal(0, 0.02)
        told = told + rng.normal(0, math.radians(0.15), at_s.size)
        angular = np.zeros((at_s.size, 3))
        angular[:, 2] = told
        return Imu(_ns(at_s), angular, np.zeros((at_s.size, 3)))

    def vesc(self) -> VescState:
        """A counter of whole counts that runs ahead where the car accelerates; 50 Hz."""
        rng = np.random.default_rng(self.seed + 13)
        t_s, speed, _ = self.course()
        car_s = self.car_s(t_s)
        distance = _summed(speed) + 0.5 * self.slip * speed**2
        at_s = np.arange(car_s[0] - 0.7, car_s[-1] + 1.2, 1.0 / 50.0)
        at_s += rng.normal(0, 2e-4, at_s.size)
        went = np.interp(at_s, car_s, distance) * (1.0 + rng.normal(0, 0.02))
        counts = np.floor(went / METRES_PER_COUNT + rng.uniform())
        nothing = np.zeros(at_s.size)
        return VescState(_ns(at_s), nothing, counts, nothing, nothing, nothing)

    def gyro(self) -> tuple[CarMotion, FilmedMotion]:
        return gyro_motion(self.imu()), filmed_heading(self.truth())

    def wheels(self) -> tuple[CarMotion, FilmedMotion]:
        return counted_motion(self.vesc(), METRES_PER_COUNT), filmed_distance(self.truth())

    def offset_at(self, film_ns: int) -> float:
        """The true offset in seconds at a film time."""
        film_s = (film_ns - START_NS) * 1e-9
        return self.offset_s + self.skew * (film_s - 0.5 * self.duration_s)

    def _moved(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        t_s, speed, rate = self.course()
        heading = 0.4 + _summed(rate)
        x = _summed(speed * np.cos(heading))
        y = _summed(speed * np.sin(heading))
        return t_s, x, y, heading, rate


def _summed(rate: Floats) -> Floats:
    """Integral at each millisecond, by the trapezium rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * 1e-3


def _ns(at_s: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return START_NS + np.rint(at_s * 1e9).astype(np.int64)
