"""How an observation is linearised: at first estimates, or by sigma points.

Whatever the way, what is left of it is a *sight* per landmark, so that one update serves all
(statistical linear regression: Lefebvre, Bruyninckx, De Schutter, IEEE T-AC 47, 2002): range and
bearing at which the landmark is due, their derivatives, and what linearising cannot tell.

A sight is a row of eleven: range, bearing; a, b, c, d, the derivatives of both with respect to the
landmark, as `slam.observation.jacobian` has them (minus this to the car); the excess covariance rr,
rb, bb; the derivatives of range and bearing with respect to the heading. A *placing*, of an
observation that becomes a landmark, is a row of seven: offset x, y from the car, its derivative
with respect to the heading, covariance xx, xy, yy of its own.
"""

from __future__ import annotations

import math

import numpy as np

from geometry import Floats
from slam.kernels import kernel, wrapped
from slam.observation import MIN_RANGE_M, expected, jacobian, variances

SPREAD = math.sqrt(3.0)
"""Sigma points lie this many sigmas off: n + kappa = 3, exact for Gaussians up to the fourth
moment of each coordinate (Julier, Uhlmann, Durrant-Whyte, IEEE T-AC 45, 2000). With it a coordinate
that enters linearly needs no points: they would add nothing, whatever the number of them."""
LEAST_SPREAD_M = 1e-6
"""The points of a place known exactly keep this much apart: their differences are derivatives."""


@kernel
def first_estimate_sights(x: Floats, first: Floats, n: int) -> Floats:
    """(n, 11): what is due by the state x, derivatives with the landmarks where they first stood.

    Both arrays are laid out like the state; the pose is that of x.
    """
    sights = np.zeros((n, 11))
    for slot in range(n):
        j = 3 + 2 * slot
        sights[slot, 0], sights[slot, 1], _, _ = expected(x, x[j], x[j + 1])
        range_m, _, dx, dy = expected(x, first[j], first[j + 1])
        sights[slot, 2], sights[slot, 3], sights[slot, 4], sights[slot, 5] = jacobian(
            range_m, dx, dy
        )
        sights[slot, 10] = -1.0
    return sights


@kernel
def sigma_sights(x: Floats, P: Floats, n: int) -> Floats:
    """(n, 11): by sigma points over where each landmark is from the car, as the car sees it.

    Nothing else is observed, whatever the frame of the map. That offset errs by the difference of
    the two places, less what a turn of the car and the map together moves both: of two coordinates,
    five points do what 2 (3 + 2n) + 1 would.
    """
    sights = np.empty((n, 11))
    for slot in range(n):
        j, s = 3 + 2 * slot, sights[slot]
        dx, dy = x[j] - x[0], x[j + 1] - x[1]
        xx, xy, yy, xh, yh = offset_covariance(P, j)
        xx += 2.0 * dy * xh + dy * dy * P[2, 2]
        xy += dy * yh - dx * xh - dx * dy * P[2, 2]
        yy += dx * dx * P[2, 2] - 2.0 * dx * yh
        # Lower Cholesky factor of the offset's covariance.
        l11 = max(math.sqrt(max(xx, 0.0)), LEAST_SPREAD_M)
        l21 = xy / l11
        l22 = max(math.sqrt(max(yy - l21 * l21, 0.0)), LEAST_SPREAD_M)
        _spread_out(s, dx, dy, x[2], l11, l21, l22)
        s[9], s[10] = s[2] * dy - s[3] * dx, s[4] * dy - s[5] * dx
    return sights


@kernel
def offset_covariance(P: Floats, j: int) -> tuple[float, float, float, float, float]:
    """Of the landmark at column j minus the car: xx, xy, yy, and with the heading, xh, yh."""
    return (
        P[j, j] - 2.0 * P[j, 0] + P[0, 0],
        P[j + 1, j] - P[j, 1] - P[j + 1, 0] + P[1, 0],
        P[j + 1, j + 1] - 2.0 * P[j + 1, 1] + P[1, 1],
        P[j, 2] - P[2, 0],
        P[j + 1, 2] - P[2, 1],
    )


@kernel
def _spread_out(
    sight: Floats, dx: float, dy: float, heading: float, l11: float, l21: float, l22: float
) -> None:
    """Fill one sight from the points offset, offset +- SPREAD times a column of the factor."""
    range_m = max(math.hypot(dx, dy), MIN_RANGE_M)
    bearing = math.atan2(dy, dx)
    mean_r, mean_b, rr, rb, bb = 0.0, 0.0, 0.0, 0.0, 0.0
    slope = np.empty((2, 2))
    for column in range(2):
        east, north = (l11, l21) if column == 0 else (0.0, l22)
        east, north = SPREAD * east, SPREAD * north
        r0 = math.hypot(dx + east, dy + north) - range_m
        b0 = wrapped(math.atan2(dy + north, dx + east) - bearing)
        r1 = math.hypot(dx - east, dy - north) - range_m
        b1 = wrapped(math.atan2(dy - north, dx - east) - bearing)
        mean_r += (r0 + r1) / 6.0
        mean_b += (b0 + b1) / 6.0
        rr += (r0 * r0 + r1 * r1) / 6.0
        rb += (r0 * b0 + r1 * b1) / 6.0
        bb += (b0 * b0 + b1 * b1) / 6.0
        slope[0, column], slope[1, column] = (r0 - r1) / (2.0 * SPREAD), (b0 - b1) / (2.0 * SPREAD)
    sight[0], sight[1] = range_m + mean_r, wrapped(bearing + mean_b - heading)
    # The derivatives are `slope` times the inverse of the factor, and explain slope slope^T.
    sight[3], sight[5] = slope[0, 1] / l22, slope[1, 1] / l22
    sight[2], sight[4] = (slope[0, 0] - sight[3] * l21) / l11, (slope[1, 0] - sight[5] * l21) / l11
    sight[6] = max(rr - mean_r * mean_r - slope[0, 0] ** 2 - slope[0, 1] ** 2, 0.0)
    sight[8] = max(bb - mean_b * mean_b - slope[1, 0] ** 2 - slope[1, 1] ** 2, 0.0)
    between = rb - mean_r * mean_b - slope[0, 0] * slope[1, 0] - slope[0, 1] * slope[1, 1]
    most = math.sqrt(sight[6] * sight[8])
    sight[7] = min(max(between, -most), most)


@kernel
def expectations(P: Floats, sights: Floats) -> Floats:
    """(n, 5) as `slam.association.expectations` gives it: what is due, and how uncertain it is."""
    due = np.empty((sights.shape[0], 5))
    for slot in range(sights.shape[0]):
        s, hh = sights[slot], P[2, 2]
        a, b, c, d, turn_r, turn_b = s[2], s[3], s[4], s[5], s[9], s[10]
        xx, xy, yy, xh, yh = offset_covariance(P, 3 + 2 * slot)
        rh, bh = a * xh + b * yh, c * xh + d * yh
        due[slot, 0], due[slot, 1] = s[0], s[1]
        due[slot, 2] = a * a * xx + 2.0 * a * b * xy + b * b * yy + s[6]
        due[slot, 2] += 2.0 * turn_r * rh + turn_r * turn_r * hh
        due[slot, 3] = a * c * xx + (a * d + b * c) * xy + b * d * yy + s[7]
        due[slot, 3] += turn_b * rh + turn_r * bh + turn_r * turn_b * hh
        due[slot, 4] = c * c * xx + 2.0 * c * d * xy + d * d * yy + s[8]
        due[slot, 4] += 2.0 * turn_b * bh + turn_b * turn_b * hh
    return due


@kernel
def placings(
    heading: float, range_m: Floats, bearing_rad: Floats, noise: Floats, by_sigma: bool
) -> Floats:
    """(m, 7): where observations see a landmark, by derivatives or by sigma points.

    The points lie over range and bearing; the heading turns car and landmark alike. Their moments
    have a closed form: with s the spread of the bearing, the offset shortens to 2/3 + cos(s) / 3,
    across it remains sin(s) / s, and along it 2/9 (1 - cos(s))^2 is left over.
    """
    rows = np.empty((range_m.size, 7))
    for i in range(range_m.size):
        var_r, var_b = variances(range_m[i], noise)
        spread = SPREAD * math.sqrt(var_b) if by_sigma else 0.0
        shorter = (2.0 + math.cos(spread)) / 3.0
        slope = math.sin(spread) / spread if spread > 1e-6 else 1.0
        along = var_r + 2.0 / 9.0 * (1.0 - math.cos(spread)) ** 2 * range_m[i] ** 2
        across = slope * slope * var_b * range_m[i] ** 2
        direction = heading + bearing_rad[i]
        cos, sin = math.cos(direction), math.sin(direction)
        rows[i, 0], rows[i, 1] = shorter * range_m[i] * cos, shorter * range_m[i] * sin
        rows[i, 2], rows[i, 3] = -rows[i, 1], rows[i, 0]
        rows[i, 4] = cos * cos * along + sin * sin * across
        rows[i, 5] = sin * cos * (along - across)
        rows[i, 6] = sin * sin * along + cos * cos * across
    return rows
