"""The odometry motion model: an increment of the odometry moves the car, with noise.

Thesis Eq. 3.8-3.9 (Thrun, Burgard, Fox 2005, table 5.6) with unprimed = previous, primed = current;
the thesis' text has them swapped, which would drive the car backwards. rot1, trans, rot2 of the
odometry, applied to the pose, are the SE(2) product `pose (+) increment`: that is what is computed,
so a reversing or a standing car needs no special case. rot1 and rot2 serve only the noise.

Within less than its own length a car cannot turn, drive and turn back: what atan2 says of such a
step is the odometry's jitter, and millimetres of it sideways would look like half a turn. A short
step therefore counts as an arc, which leaves the old heading by half the turn and meets the new one
by the other half; a long one counts as rot1, trans, rot2; `MANOEUVRE_M` is where both count alike.
"""

from __future__ import annotations

import math

import numpy as np

from geometry import Floats
from slam.config import MotionNoise
from slam.kernels import kernel, wrapped

STANDSTILL_M = 1e-9
STANDSTILL_RAD = 1e-9
MIN_TRANSLATION_M = 1e-4
"""Below this the direction of a translation is noise: rot1 is then taken as 0."""
MANOEUVRE_M = 0.3
"""About the length of the car."""


def noise_array(noise: MotionNoise) -> Floats:
    """The noise as the kernels take it: (7,), variances per second, alphas, at_rest as 0 or 1."""
    return np.array(
        [
            noise.xy_sigma_m_per_sqrt_s**2,
            noise.heading_sigma_rad_per_sqrt_s**2,
            noise.alpha1,
            noise.alpha2_rad2_per_m2,
            noise.alpha3,
            noise.alpha4_m2_per_rad2,
            float(noise.at_rest),
        ]
    )


@kernel
def rotations_and_translation(dx: float, dy: float, dheading: float) -> tuple[float, float, float]:
    """rot1, trans, rot2 of an increment given in the car's frame (thesis Eq. 3.8)."""
    trans = math.hypot(dx, dy)
    rot1 = math.atan2(dy, dx) if trans > MIN_TRANSLATION_M else 0.0
    return rot1, trans, dheading - rot1


@kernel
def folded(angle: float) -> float:
    """How far the wheels turned, in [0, pi/2]: a reversing car has not turned by pi."""
    turned = abs(wrapped(angle))
    return min(turned, math.pi - turned)


@kernel
def squared_turns(dx: float, dy: float, dheading: float) -> tuple[float, float, float]:
    """rot1 and rot2 squared, as the noise takes them, and how far the step is a manoeuvre, 0..1."""
    rot1, trans, rot2 = rotations_and_translation(dx, dy, dheading)
    # The fourth power: jitter counts times the step, so that it stays nothing in short ones.
    manoeuvre = trans**4 / (trans**4 + MANOEUVRE_M**4)
    arc = (1.0 - manoeuvre) * (0.5 * dheading) ** 2
    return (
        arc + manoeuvre * folded(rot1) ** 2,
        arc + manoeuvre * folded(rot2) ** 2,
        manoeuvre,
    )


@kernel
def increment_covariance(
    heading: float, dx: float, dy: float, dheading: float, dt_s: float, noise: Floats
) -> tuple[float, float, float, float, float, float]:
    """Covariance that one increment adds: xx, xy, yy, x-heading, y-heading, heading-heading.

    In the map frame, for a car at `heading` before the increment.
    """
    standing = abs(dx) + abs(dy) < STANDSTILL_M and abs(dheading) < STANDSTILL_RAD
    if standing and noise[6] == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xy, hh = noise[0] * dt_s, noise[1] * dt_s
    square = dx * dx + dy * dy
    turn1, turn2, manoeuvre = squared_turns(dx, dy, dheading)
    # Table 5.6 at one second of this motion, times the time taken: linear in dt, so that cutting
    # an increment in two adds up to the same.
    scale = 1.0 / max(dt_s, 1e-6)
    var_rot1 = (noise[2] * turn1 + noise[3] * square) * scale
    var_rot2 = (noise[2] * turn2 + noise[3] * square) * scale
    # V diag(var) V^T with V = d(x, y, heading)/d(rot1, trans, rot2), the translation as a vector:
    # where it is short it has no direction, and needs none. What turning adds to the way driven
    # lies along it, or along the chord of the arc.
    cos, sin = math.cos(heading), math.sin(heading)
    east, north = cos * dx - sin * dy, sin * dx + cos * dy
    slip = noise[5] * (turn1 + turn2) * scale
    stretch = noise[4] * scale + slip * square / (square * square + MANOEUVRE_M**4)
    chord = slip * (1.0 - manoeuvre)
    cos, sin = math.cos(heading + 0.5 * dheading), math.sin(heading + 0.5 * dheading)
    return (
        xy + north * north * var_rot1 + east * east * stretch + cos * cos * chord,
        east * north * (stretch - var_rot1) + sin * cos * chord,
        xy + east * east * var_rot1 + north * north * stretch + sin * sin * chord,
        -north * var_rot1,
        east * var_rot1,
        hh + var_rot1 + var_rot2,
    )


@kernel
def propagate(
    pose: Floats,
    covariance: Floats,
    increments: Floats,
    dt_s: Floats,
    noise: Floats,
    poses: Floats,
    covariances: Floats,
) -> tuple[float, float]:
    """Move a pose (3,) and its covariance (3, 3), in place, by increments (k, 3) over dt_s (k,).

    Fills poses (k, 3) and covariances (k, 3, 3). Gives the accumulated Jacobian with respect to the
    first pose as its only two free entries, F[0, 2] and F[1, 2]; the rest of F is the identity.
    """
    fx_all, fy_all = 0.0, 0.0
    for k in range(increments.shape[0]):
        dx, dy, dheading = increments[k, 0], increments[k, 1], increments[k, 2]
        heading = pose[2]
        cos, sin = math.cos(heading), math.sin(heading)
        fx, fy = -sin * dx - cos * dy, cos * dx - sin * dy
        qxx, qxy, qyy, qxh, qyh, qhh = increment_covariance(
            heading, dx, dy, dheading, dt_s[k], noise
        )
        xh, yh, hh = covariance[0, 2], covariance[1, 2], covariance[2, 2]
        covariance[0, 0] += 2.0 * fx * xh + fx * fx * hh + qxx
        covariance[0, 1] += fx * yh + fy * xh + fx * fy * hh + qxy
        covariance[1, 1] += 2.0 * fy * yh + fy * fy * hh + qyy
        covariance[0, 2] += fx * hh + qxh
        covariance[1, 2] += fy * hh + qyh
        covariance[2, 2] += qhh
        covariance[1, 0], covariance[2, 0] = covariance[0, 1], covariance[0, 2]
        covariance[2, 1] = covariance[1, 2]
        pose[0] += cos * dx - sin * dy
        pose[1] += sin * dx + cos * dy
        pose[2] = wrapped(heading + dheading)
        fx_all += fx
        fy_all += fy
        # Element by element: slices would double the time the kernels take to compile.
        for i in range(3):
            poses[k, i] = pose[i]
            for j in range(3):
                covariances[k, i, j] = covariance[i, j]
    return fx_all, fy_all
