"""Where a car was while nobody saw it: a smoother across short gaps.

State of each of x, y and heading: value, speed, acceleration; driven by white jerk. A Kalman filter
forwards, then the fixed-interval smoother (Saerkkae, Bayesian Filtering and Smoothing, 2013,
theorem 8.2).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps

JERK_DENSITY = (60.0, 60.0, 600.0)
"""Of x, y (m^2/s^5) and heading (rad^2/s^5): a 1:10 car that brakes and turns hard."""
_UNKNOWN = (1.0, 25.0, 400.0)


def bridge(
    t_ns: Stamps, poses: Floats, covariances: Floats, seen: npt.NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Poses (n, 3) and covariances (n, 3, 3), diagonal, at all times; heading without jumps.

    seen : (n,) where poses and covariances (n, 3, 3) were measured; elsewhere they are not read.
    """
    values = poses.copy()
    values[seen, 2] = np.unwrap(poses[seen, 2])
    variances = np.where(seen[:, None], np.diagonal(covariances, axis1=1, axis2=2), 1.0)
    n = len(t_ns)
    steps_s = np.diff(t_ns) * 1e-9
    mean, spread = np.zeros((n, 3, 3)), np.zeros((n, 3, 3, 3))
    ahead_mean, ahead_spread = np.zeros((n, 3, 3)), np.zeros((n, 3, 3, 3))
    first = int(np.argmax(seen))
    x = np.zeros((3, 3))
    x[:, 0] = values[first]
    P = np.broadcast_to(np.diag(_UNKNOWN), (3, 3, 3)).copy()
    for k in range(n):
        if k:
            F = _transition(steps_s[k - 1])
            x, P = x @ F.T, F @ P @ F.T + _noise(steps_s[k - 1])
        ahead_mean[k], ahead_spread[k] = x, P
        if seen[k]:
            gain = P[:, :, 0] / (P[:, 0, 0] + variances[k])[:, None]
            x = x + gain * (values[k] - x[:, 0])[:, None]
            P = P - gain[:, :, None] * P[:, None, 0, :]
        mean[k], spread[k] = x, P
    for k in range(n - 2, -1, -1):
        F = _transition(steps_s[k])
        gains = spread[k] @ F.T @ np.linalg.inv(ahead_spread[k + 1])
        mean[k] += np.einsum("aij,aj->ai", gains, mean[k + 1] - ahead_mean[k + 1])
        change = spread[k + 1] - ahead_spread[k + 1]
        spread[k] += gains @ change @ gains.transpose(0, 2, 1)
    smoothed = np.zeros((n, 3, 3))
    smoothed[:, range(3), range(3)] = np.maximum(spread[:, :, 0, 0], 0.0)
    return mean[:, :, 0], smoothed


def _transition(dt: float) -> Floats:
    return np.array([[1.0, dt, dt * dt / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def _noise(dt: float) -> Floats:
    """(3, 3, 3): of each of x, y, heading."""
    one = np.array(
        [
            [dt**5 / 20.0, dt**4 / 8.0, dt**3 / 6.0],
            [dt**4 / 8.0, dt**3 / 3.0, dt**2 / 2.0],
            [dt**3 / 6.0, dt**2 / 2.0, dt],
        ]
    )
    return np.asarray(np.array(JERK_DENSITY)[:, None, None] * one)
