"""Angles on the circle: counter-clockwise, in radians, wrapped to (-pi, pi]."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def wrap(angle_rad: npt.ArrayLike) -> Floats:
    """The same direction in (-pi, pi]; any shape, kept. An angle inside comes back exact."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    inside = np.abs(angle) < np.pi
    if inside.all():
        return angle.copy()
    turned: Floats = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    # A remainder that rounds up to a whole turn must stay in the half-open interval.
    turned = np.where(turned <= -np.pi, np.pi, turned)
    return np.where(inside, angle, turned)


def circular_mean(angle_rad: Floats, weights: Floats | None = None) -> float:
    """The direction of the mean unit vector, in (-pi, pi]; shape (n,), n >= 1, in, a number out.

    Directions that cancel (0 and pi) have no mean: what comes back is then arbitrary.
    """
    mean = np.average(np.exp(1j * angle_rad), weights=weights)
    return float(wrap(np.angle(mean)))
