"""How a point of the car moves that does not slip sideways: what lever arm and counts foretell.

The middle of the rear axle goes where the car points, but for the slip angle of its tyres, which
grows with the lateral acceleration v * omega (linear tyre: Rajamani, Vehicle Dynamics and Control,
2.4). The truth stands for a point that may be off by (ahead, left) and whose heading may be off by
a yaw: over each window its displacement must then differ from that of the axle by just this lever.
"""

from __future__ import annotations

import numpy as np

from calibration.driven import Driven, window_sums
from geometry import Floats

SLIP_MEAN, SLIP_SIGMA = 0.015, 0.015
"""Slip angle of the rear axle for each m/s^2 [rad s^2/m]: rubber on carpet or asphalt 0 to 0.04."""


def displacement_residuals(
    drive: Driven, ahead_m: float, left_m: float, yaw_rad: float, slip: float, m_per_count: float
) -> Floats:
    """(w, 2) what is left of each window's displacement, along and across the car.

    (ahead, left, yaw) : pose of the true `base_link` in that of the truth. Without counts the
    distance is taken from the film and what is left along the car is about zero.
    """
    heading = drive.heading
    i, j = drive.pairs.T
    cos, sin = np.cos(heading), np.sin(heading)
    at = drive.xy + np.stack([cos * ahead_m - sin * left_m, sin * ahead_m + cos * left_m], axis=1)
    speed, period = drive.speed_m_s, drive.t_s[j] - drive.t_s[i]
    # Turning to the left the tail drifts to the right: v_y = -slip v omega |v|.
    drift = -slip * speed * drive.turn_rad / period
    direction = 0.5 * (heading[1:] + heading[:-1]) + yaw_rad
    u = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    if drive.counts is not None:
        gone = window_sums(drive.pairs, (m_per_count * np.diff(drive.counts))[:, None] * u)
    else:
        mean = window_sums(drive.pairs, np.diff(drive.t_s)[:, None] * u)
        gone = mean * (speed * np.sign(_forward(drive)))[:, None]
    left = at[j] - at[i] - _turned(gone, drift)
    return _turned(left, -0.5 * (heading[i] + heading[j]) - yaw_rad)


def _forward(drive: Driven) -> Floats:
    """(w,) how far each window went along the car, negative backwards."""
    i, j = drive.pairs.T
    middle = 0.5 * (drive.heading[i] + drive.heading[j])
    return np.asarray(_turned(drive.xy[j] - drive.xy[i], -middle)[:, 0])


def forward_m(drive: Driven) -> Floats:
    """(w,) how far the car went in each window by the film, negative backwards."""
    i, j = drive.pairs.T
    metres: Floats = np.copysign(drive.speed_m_s * (drive.t_s[j] - drive.t_s[i]), _forward(drive))
    return metres


def _turned(xy: Floats, angle_rad: Floats) -> Floats:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.stack([cos * xy[:, 0] - sin * xy[:, 1], sin * xy[:, 0] + cos * xy[:, 1]], axis=1)
