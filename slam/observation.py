"""The range-bearing observation of a point landmark and its derivatives.

Thesis Eq. 3.10; Thrun, Burgard, Fox 2005, section 6.6.2 and Eq. 10.14 (the thesis cites chapter 5).
"""

from __future__ import annotations

import math

import numpy as np

from geometry import Floats
from slam.config import ObservationNoise
from slam.kernels import kernel, wrapped

MIN_RANGE_M = 1e-6
"""A landmark on the sensor itself has no bearing; it is taken to be this far away."""


def noise_array(noise: ObservationNoise) -> Floats:
    """The noise as the kernels take it: (3,), standard deviations m, rad, m per m."""
    return np.array([noise.range_sigma_m, noise.bearing_sigma_rad, noise.range_sigma_per_m])


@kernel
def variances(range_m: float, noise: Floats) -> tuple[float, float]:
    """Variance of the range [m2] and of the bearing [rad2] of an observation at this range."""
    proportional = noise[2] * range_m
    return noise[0] * noise[0] + proportional * proportional, noise[1] * noise[1]


@kernel
def expected(pose: Floats, x: float, y: float) -> tuple[float, float, float, float]:
    """Range and bearing at which a landmark at (x, y) is seen, and its offset dx, dy."""
    dx, dy = x - pose[0], y - pose[1]
    range_m = max(math.hypot(dx, dy), MIN_RANGE_M)
    return range_m, wrapped(math.atan2(dy, dx) - pose[2]), dx, dy


@kernel
def jacobian(range_m: float, dx: float, dy: float) -> tuple[float, float, float, float]:
    """d(range, bearing)/d(landmark) row by row; with respect to the pose it is minus this, and -1.

    Range: (-a, -b, 0 | a, b); bearing: (-c, -d, -1 | c, d), in the order x, y, heading | lx, ly.
    """
    return dx / range_m, dy / range_m, -dy / range_m**2, dx / range_m**2


@kernel
def innovation(
    pose: Floats, x: float, y: float, range_m: float, bearing_rad: float
) -> tuple[float, float, float, float, float]:
    """Observed minus expected range and (wrapped) bearing, then expected range and offset."""
    range_expected, bearing_expected, dx, dy = expected(pose, x, y)
    turn = wrapped(bearing_rad - bearing_expected)
    return range_m - range_expected, turn, range_expected, dx, dy
