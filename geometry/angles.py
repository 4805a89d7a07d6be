"""Angles on the circle: counter-clockwise, in radians, wrapped to (-pi, pi]."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def wrap(angle_rad: npt.ArrayLike) -> Floats:
    """The same direction in (-pi, pi]; any shape, kept."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    wrapped: Floats = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    # A sum that rounds to a whole turn must stay in the half-open interval.
    return np.where(wrapped <= -np.pi, np.pi, wrapped)


def circular_mean(angle_rad: Floats, weights: Floats | None = None) -> float:
    """The direction of the mean unit vector, in (-pi, pi]; shape (n,) in, a number out."""
    mean = np.average(np.exp(1j * angle_rad), weights=weights)
    return float(np.angle(mean))
