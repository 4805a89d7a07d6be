"""Least squares for what was driven: unknown noise, outliers, rows that are not independent.

Each group of rows (distances, turns, ...) gets the noise that its own residuals show, by their
median deviation; rows far out lose their weight (Huber, then none). The covariance is that of
clustered rows: H^-1 (sum over clusters of g g^T) H^-1 (Liang and Zeger 1986), because errors of a
second of film go together; it is never less than that of independent rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats

Rows = npt.NDArray[np.int64]
_HUBER, _GONE = 2.0, 8.0
_ROUNDS = 6
_LEAST_NOISE = 1e-9


@dataclass(frozen=True, eq=False)
class Priors:
    """What was known before: mean (p,), sigma (p,), infinite where nothing was."""

    mean: Floats
    sigma: Floats

    @property
    def information(self) -> Floats:
        """(p, p)."""
        return np.diag(self.sigma**-2.0)


@dataclass(frozen=True, eq=False)
class RobustFit:
    """What was found.

    values (p,) and covariance (p, p); residuals (n,) in their own units, weight (n,) 0 to 1;
    noise : standard deviation of each group's rows.
    """

    values: Floats
    covariance: Floats
    residuals: Floats
    weight: Floats
    noise: Floats

    @property
    def sigma(self) -> Floats:
        """(p,) standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def rests_on(fit: RobustFit, priors: Priors, k: int) -> str:
    """What parameter k rests on: "data", "prior" or both, by how much the data narrowed it."""
    share = float(fit.covariance[k, k] / priors.sigma[k] ** 2)
    return "data" if share < 0.1 else "prior" if share > 0.8 else "data and prior"


def robust_fit(
    residuals: Callable[[Floats], Floats],
    start: Floats,
    priors: Priors,
    groups: Rows,
    clusters: Rows,
    least_noise: Floats | None = None,
) -> RobustFit:
    """The parameters near `start` that explain rows (n,) best, together with the priors.

    groups : (n,) 0, 1, ...: rows of one noise; clusters : (n,) rows whose errors go together;
    least_noise : (groups,) what no row is better than, however well most of them fit (a model has
    its own error), None for nothing.
    """
    from scipy.optimize import least_squares

    values, known = start.astype(np.float64), np.isfinite(priors.sigma)
    kinds = int(groups.max(initial=0)) + 1
    least = np.full(kinds, _LEAST_NOISE) if least_noise is None else least_noise
    weight, noise = np.ones(groups.size), np.ones(kinds)
    for turn in range(_ROUNDS):
        left = residuals(values)
        if turn == 0:  # the start may be far: every row counts, by its group's spread
            noise = _noise(left, groups, weight, least)
        root = np.sqrt(weight) / noise[groups]

        def all_rows(x: Floats, root: Floats = root) -> Floats:
            prior = (x[known] - priors.mean[known]) / priors.sigma[known]
            return np.concatenate([root * residuals(x), prior])

        solved = least_squares(all_rows, values, x_scale=_scale(values, priors), jac="3-point")
        values = solved.x
        left = residuals(values)
        noise = _noise(left, groups, weight, least)
        weight = _weights(left / noise[groups])
    jacobian = _slopes(residuals, values, _scale(values, priors)) / noise[groups][:, None]
    return _with_covariance(values, jacobian, left, priors, groups, clusters, weight, noise)


def _with_covariance(
    values: Floats,
    jacobian: Floats,
    left: Floats,
    priors: Priors,
    groups: Rows,
    clusters: Rows,
    weight: Floats,
    noise: Floats,
) -> RobustFit:
    """The fit; `jacobian` (n, p) is of rows over their noise."""
    information = jacobian.T @ (weight[:, None] * jacobian)
    whole = information + priors.information
    scale = 1.0 / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    inverse = scale[:, None] * np.linalg.pinv(whole * np.outer(scale, scale)) * scale
    scores = jacobian * (weight * left / noise[groups])[:, None]
    names, row = np.unique(clusters, return_inverse=True)
    summed = np.zeros((names.size, values.size))
    np.add.at(summed, row, scores)
    # What the priors hold is no freedom that the data have used up.
    used = float(np.trace(inverse @ information))
    enough = names.size / max(names.size - used, 1.0)
    covariance = inverse @ (enough * summed.T @ summed + priors.information) @ inverse
    lift = np.sqrt(np.maximum(np.diag(inverse) / np.maximum(np.diag(covariance), 1e-300), 1.0))
    covariance = covariance * np.outer(lift, lift)
    return RobustFit(values, covariance, left, weight, noise)


def _slopes(residuals: Callable[[Floats], Floats], values: Floats, scale: Floats) -> Floats:
    """Slopes d residual / d parameter (n, p), by central differences."""
    steps = 1e-4 * np.diag(scale)
    return np.stack(
        [(residuals(values + h) - residuals(values - h)) / (2.0 * h.sum()) for h in steps], axis=1
    )


def _noise(left: Floats, groups: Rows, weight: Floats, least: Floats) -> Floats:
    """Per group, 1.4826 median deviations from zero of the rows that count."""
    found = []
    for group, at_least in enumerate(least.tolist()):
        rows = left[(groups == group) & (weight > 0)]
        spread = 1.4826 * float(np.median(np.abs(rows))) if rows.size else 1.0
        found.append(max(spread, at_least))
    return np.array(found)


def _weights(standardised: Floats) -> Floats:
    size = np.maximum(np.abs(standardised), 1e-12)
    return np.where(size > _GONE, 0.0, np.minimum(1.0, _HUBER / size))


def _scale(values: Floats, priors: Priors) -> Floats:
    """How large a step of each parameter is."""
    usual = np.maximum(np.abs(values), 1e-3)
    return np.where(np.isfinite(priors.sigma), np.minimum(priors.sigma, usual), usual)
