"""How a point of the car moves that does not slip sideways: what lever arm and counts foretell.

The middle of the rear axle goes where the car points, but for the slip angle of its tyres, which
grows with the lateral acceleration v * omega (linear tyre: Rajamani, Vehicle Dynamics and Control,
2.4). The truth stands for a point that may be off by (ahead, left) and whose heading may be off by
a yaw: over each window its displacement must then differ from that of the axle by just this lever.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from calibration.driven import Driven, window_sums
from geometry import Floats

SLIP_MEAN, SLIP_SIGMA = 0.019, 0.006
"""Slip angle of the rear axle for each m/s^2 [rad s^2/m].

One over gravity and the cornering stiffness per load, which was identified on an F1TENTH car as
4.72 (front) and 5.46 (rear) per rad (f1tenth_gym, C_Sf, C_Sr): 0.0216 and 0.0187. Floors differ.
"""
SPIN_SHARE, SPIN_M = 0.06, 0.005
"""So far counts and film may differ in a window, by share of its way or in all."""


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


def spinning(drive: Driven) -> npt.NDArray[np.bool_]:
    """(w,) windows in which the wheels turned by other than the car went, and their neighbours.

    A tyre that spins gives way to the side, too: what holds of rolling ones does not hold there.
    """
    if drive.counts is None or not len(drive.pairs):
        return np.zeros(len(drive.pairs), bool)
    counted = np.diff(drive.counts[drive.pairs], axis=1)[:, 0]
    went = forward_m(drive)
    off = np.abs(counted * per_count_m([drive]) - went)
    apart = off > np.maximum(SPIN_SHARE * np.abs(went), SPIN_M)
    near: npt.NDArray[np.bool_] = apart.copy()
    near[1:] |= apart[:-1]
    near[:-1] |= apart[1:]
    return near


def per_count_m(drives: Sequence[Driven]) -> float:
    """Metres for each count, the median of all windows of drives with a tachometer; 1 without."""
    ratios = [np.zeros(0)]
    for drive in drives:
        if drive.counts is not None:
            counted = np.diff(drive.counts[drive.pairs], axis=1)[:, 0]
            ratios.append(forward_m(drive)[counted != 0] / counted[counted != 0])
    every = np.concatenate(ratios)
    return float(np.median(every)) if every.size else 1.0


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
