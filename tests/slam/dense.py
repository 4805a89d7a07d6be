"""The textbook's EKF-SLAM in dense matrices: slow, plain, and independent of our kernels."""

from __future__ import annotations

import numpy as np

from geometry import Floats, wrap


def observe(x: Floats, j: int) -> Floats:
    dx, dy = x[j] - x[0], x[j + 1] - x[1]
    return np.array([np.hypot(dx, dy), float(wrap(np.arctan2(dy, dx) - x[2]))])


def numeric_jacobian(function, x: Floats, step: float = 1e-6) -> Floats:  # type: ignore[no-untyped-def]
    """Central differences of a function of x, column by column."""
    columns = []
    for i in range(x.size):
        up, down = x.copy(), x.copy()
        up[i] += step
        down[i] -= step
        columns.append((function(up) - function(down)) / (2 * step))
    return np.stack(columns, axis=1)


def joseph_update(
    x: Floats, P: Floats, columns: list[int], observed: Floats, R: Floats
) -> tuple[Floats, Floats]:
    """One batch: observed (2m,) of the landmarks at state columns; covariance in Joseph form."""
    expected = np.concatenate([observe(x, j) for j in columns])
    H = np.concatenate([numeric_jacobian(lambda state, j=j: observe(state, j), x) for j in columns])
    nu = observed - expected
    nu[1::2] = wrap(nu[1::2])
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    keep = np.eye(x.size) - K @ H
    return x + K @ nu, keep @ P @ keep.T + K @ R @ K.T


def full(P: Floats, dimension: int) -> Floats:
    """The symmetric matrix whose lower half the kernels keep."""
    lower = np.tril(P[:dimension, :dimension])
    return lower + np.tril(lower, -1).T
