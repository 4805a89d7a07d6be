"""Overlapping Allan deviation, and the noise that it shows.

IEEE Std 952-1997, annex C; Riley, NIST SP 1065, section 5.2.4 (overlapping estimate). White noise
of density N gives N / sqrt(tau), bias instability B a floor of sqrt(2 ln 2 / pi) B, a random walk
of the rate K sqrt(tau / 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats

FLOOR = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
POINTS_PER_DECADE = 8
LEAST_CLUSTERS = 9
"""A tau is told while the log holds so many of it."""
WHITE_FROM_S, WHITE_TO_S = 0.1, 1.0
"""Above the filters of the chip, below the drift: there the noise is white."""


@dataclass(frozen=True)
class NoiseModel:
    """white : density, unit / sqrt(Hz); instability : unit; walk : unit / s / sqrt(Hz).

    The latter two are None where the log is too short to show them, or shows none.
    """

    white: float
    instability: float | None
    walk: float | None


def allan_deviation(values: Floats, period_s: float) -> tuple[Floats, Floats]:
    """Tau (k,) and the overlapping Allan deviation (k, axes) of evenly spaced values (n, axes)."""
    n = len(values)
    most = n // LEAST_CLUSTERS
    if most < 1:
        return np.zeros(0), np.zeros((0, values.shape[1]))
    decades = np.log10(most)
    sizes = np.unique(
        np.rint(np.logspace(0.0, decades, int(decades * POINTS_PER_DECADE) + 1)).astype(np.int64)
    )
    angle = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)]) * period_s
    deviations = []
    for m in sizes.tolist():
        second = angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]
        deviations.append(np.sqrt(0.5 * np.mean(second**2, axis=0)) / (m * period_s))
    tau_s: Floats = np.asarray(sizes * period_s, np.float64)
    return tau_s, np.array(deviations)


def noise_of(tau_s: Floats, deviation: Floats) -> NoiseModel:
    """The noise of one axis by its Allan deviation (k,)."""
    white_rows = (tau_s >= WHITE_FROM_S) & (tau_s <= WHITE_TO_S)
    if not white_rows.any():
        white_rows = np.ones(tau_s.size, bool)
    white = float(np.sqrt(np.median(deviation[white_rows] ** 2 * tau_s[white_rows])))
    if tau_s.size == 0 or tau_s[-1] <= 2.0 * WHITE_TO_S:
        return NoiseModel(white, None, None)
    return _with_drift(tau_s, deviation, white)


def _with_drift(tau_s: Floats, deviation: Floats, white: float) -> NoiseModel:
    """Non-negative least squares of the variances, each over its own size and certainty."""
    from scipy.optimize import nnls

    rows = tau_s >= WHITE_FROM_S
    tau, variance = tau_s[rows], deviation[rows] ** 2
    # An overlapping estimate of k clusters is known to about 1 / sqrt(k).
    weight = np.sqrt(tau_s[-1] * LEAST_CLUSTERS / tau) / variance
    columns = np.stack([1.0 / tau, np.full(tau.size, FLOOR**2), tau / 3.0], axis=1)
    found, _ = nnls(columns * weight[:, None], variance * weight)
    # What lies below the white noise everywhere is not seen.
    lowest = float(deviation[rows].min())
    seen = [float(np.sqrt(share)) for share in found]
    instability = seen[1] if seen[1] * FLOOR > 0.3 * lowest else None
    walk = seen[2] if seen[2] * np.sqrt(tau[-1] / 3.0) > 0.5 * lowest else None
    return NoiseModel(white, instability, walk)
