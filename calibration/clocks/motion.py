"""What two clocks have in common: how the car turned and how far it went, as each saw it.

A motion is kept as a level (angle turned, distance travelled), not as a rate: the film measures
levels, and nothing that is measured is differentiated for the fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from capture import GroundTruth, Imu, Odometry, VescState
from geometry import Floats, Stamps, wrap

Source = Literal["gyro", "wheels"]
Mask = npt.NDArray[np.bool_]

GAP_NS = 100_000_000
"""Between samples of the car that are further apart, nobody knows how it moved."""
FILM_GAP_NS = 200_000_000
RATE_WINDOW_S = 0.05
"""Half of the span over which rates are taken for the search, on both sides alike."""
GRID_S = 0.01
UNKNOWN_SIGMA_M, UNKNOWN_SIGMA_RAD = 1e-3, 2e-3


@dataclass(frozen=True, eq=False)
class CarMotion:
    """What a sensor on the car tells of its motion, on the car's clock.

    t_ns : (n,); level : (n,) angle turned in rad, counter-clockwise, or distance in m, forward;
    rate : (n,) its slope, rad/s or m/s. scale_known : whether it is in these units, about.
    """

    source: Source
    t_ns: Stamps
    level: Floats
    rate: Floats
    scale_known: bool = True

    @cached_property
    def piece(self) -> npt.NDArray[np.int64]:
        """(n,) samples without a gap between them have one number."""
        return _broken(self.t_ns, GAP_NS)


@dataclass(frozen=True, eq=False)
class FilmedMotion:
    """The same as the film shows it, on the film's clock; what was not seen is left out.

    t_ns : (m,); level : (m,) heading in rad, wrapped, or distance in m; sigma : (m,) how far the
    level scatters, as far as that is told.
    """

    source: Source
    t_ns: Stamps
    level: Floats
    sigma: Floats

    @cached_property
    def piece(self) -> npt.NDArray[np.int64]:
        """(m,) samples of one number have levels that belong together.

        A heading is whole over any gap; how far a car went that nobody saw is not known.
        """
        if self.source == "gyro":
            return np.zeros(self.t_ns.size, np.int64)
        return _broken(self.t_ns, FILM_GAP_NS)


@dataclass(frozen=True, eq=False)
class RateGrid:
    """A rate at every `GRID_S` from `start_ns` on; known : where it may be believed."""

    start_ns: int
    rate: Floats
    known: Mask


def gyro_motion(imu: Imu) -> CarMotion:
    """The angle that the gyro's z tells, by the trapezium rule."""
    rate = imu.angular_velocity_rad_s[:, 2]
    step = 0.5 * (rate[1:] + rate[:-1]) * np.diff(imu.t_ns) * 1e-9
    return CarMotion("gyro", imu.t_ns, np.concatenate([[0.0], np.cumsum(step)]), rate)


def counted_motion(state: VescState, metres_per_count: float | None) -> CarMotion:
    """The distance that the motor controller counted; None: in counts, whose length is unknown."""
    level = (state.tachometer - state.tachometer[0]) * (metres_per_count or 1.0)
    known = metres_per_count is not None
    return CarMotion("wheels", state.t_ns, level, _slope(state.t_ns, level), known)


def odometry_motion(odometry: Odometry) -> CarMotion:
    """The distance of a wheel odometry, its speed summed up."""
    speed = odometry.speed_m_s
    step = 0.5 * (speed[1:] + speed[:-1]) * np.diff(odometry.t_ns) * 1e-9
    return CarMotion("wheels", odometry.t_ns, np.concatenate([[0.0], np.cumsum(step)]), speed)


def filmed_heading(truth: GroundTruth) -> FilmedMotion:
    """The heading of the filmed car, where it was seen."""
    seen, path = _seen(truth), truth.path
    sigma = np.full(len(path), UNKNOWN_SIGMA_RAD)
    if truth.path_covariances is not None:
        sigma = np.sqrt(truth.path_covariances[:, 2, 2])
    return FilmedMotion("gyro", path.t_ns[seen], path.heading[seen], sigma[seen])


def filmed_distance(truth: GroundTruth) -> FilmedMotion:
    """How far the filmed car went forward.

    Each step is an arc, its chord taken along the mean heading: unlike the length of the path, that
    does not grow while a standing car's place scatters.
    """
    path = truth.path
    half = 0.5 * wrap(np.diff(path.heading))
    middle = path.heading[:-1] + half
    chord = np.diff(path.x) * np.cos(middle) + np.diff(path.y) * np.sin(middle)
    step = chord / np.sinc(half / np.pi)
    sigma = np.full(len(path), UNKNOWN_SIGMA_M)
    if truth.path_covariances is not None:
        sigma = np.sqrt(0.5 * np.trace(truth.path_covariances[:, :2, :2], axis1=1, axis2=2))
    seen, level = _seen(truth), np.concatenate([[0.0], np.cumsum(step)])
    return FilmedMotion("wheels", path.t_ns[seen], level[seen], sigma[seen])


def car_grid(motion: CarMotion) -> RateGrid:
    """The rate of the car's sensor, evenly over time."""
    return _grid(motion.t_ns, motion.level, GAP_NS)


def film_grid(motion: FilmedMotion) -> RateGrid:
    """The rate of the filmed motion, evenly over time; gaps of the film are unknown."""
    level = np.unwrap(motion.level) if motion.source == "gyro" else motion.level
    return _grid(motion.t_ns, level, FILM_GAP_NS)


def _seen(truth: GroundTruth) -> Mask:
    return np.ones(len(truth.path), bool) if truth.bridged is None else ~truth.bridged


def _grid(t_ns: Stamps, level: Floats, gap_ns: int) -> RateGrid:
    t_s = (t_ns - t_ns[0]) * 1e-9
    at = np.arange(RATE_WINDOW_S, t_s[-1] - RATE_WINDOW_S, GRID_S)
    early, late = at - RATE_WINDOW_S, at + RATE_WINDOW_S
    rate = (np.interp(late, t_s, level) - np.interp(early, t_s, level)) / (2.0 * RATE_WINDOW_S)
    in_gap = _broken(t_ns, gap_ns)
    # As many gaps have begun before both ends: none lies between.
    first = in_gap[np.searchsorted(t_s, early, side="right") - 1]
    last = in_gap[np.minimum(np.searchsorted(t_s, late, side="left"), t_s.size - 1)]
    start_ns = int(t_ns[0]) + round(RATE_WINDOW_S * 1e9)
    return RateGrid(start_ns, rate, np.asarray(first == last))


def _broken(t_ns: Stamps, gap_ns: int) -> npt.NDArray[np.int64]:
    """(n,) how many gaps came before each stamp."""
    breaks: npt.NDArray[np.int64] = np.cumsum(np.diff(t_ns, prepend=t_ns[:1]) > gap_ns)
    return breaks


def _slope(t_ns: Stamps, level: Floats) -> Floats:
    """Central differences over the window, which evens out the steps of a counter."""
    t_s = (t_ns - t_ns[0]) * 1e-9
    early = np.clip(t_s - RATE_WINDOW_S, 0.0, t_s[-1])
    late = np.clip(t_s + RATE_WINDOW_S, 0.0, t_s[-1])
    rise = np.interp(late, t_s, level) - np.interp(early, t_s, level)
    return np.asarray(rise / np.maximum(late - early, 1e-9))
