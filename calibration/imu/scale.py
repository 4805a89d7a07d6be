"""The scale of the gyro's z axis against known turns: by the overhead truth, or by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.errors import CalibrationError
from calibration.imu.still import StillPart, glitch_rows, still_rows
from calibration.turning import GyroFit
from capture import Imu

HAND_SIGMA_RAD = float(np.deg2rad(2.0))
"""How well a car is put back on its mark by hand."""
LEAST_TURN_RAD = float(np.pi)


@dataclass(frozen=True)
class Scale:
    """true rate = value * measured rate; late_s of the stamps where the truth told it."""

    value: float
    sigma: float
    source: str
    late_s: float | None = None
    late_sigma_s: float | None = None


def scale_of_fits(fits: Sequence[GyroFit]) -> Scale:
    """The weighted mean of fits to the truths of sessions."""
    weight = np.array([1.0 / fit.covariance[0, 0] for fit in fits])
    late_weight = np.array([1.0 / fit.covariance[2, 2] for fit in fits])
    turned = sum(fit.turned_rad for fit in fits)
    return Scale(
        float(np.average([fit.scale for fit in fits], weights=weight)),
        float(1.0 / np.sqrt(weight.sum())),
        f"data: the film, {np.degrees(turned):.0f} deg turned",
        float(np.average([fit.late_s for fit in fits], weights=late_weight)),
        float(1.0 / np.sqrt(late_weight.sum())),
    )


def scale_of_turns(imu: Imu, still: StillPart, turns: float) -> Scale:
    """From full turns by hand on the floor, beginning and ending at rest on one mark.

    Raises `CalibrationError` where it did not lie still before and after, or turned by another
    number of turns.
    """
    glitches = glitch_rows(np.hstack([imu.angular_velocity_rad_s, imu.linear_acceleration_m_s2]))
    rest = np.flatnonzero(still_rows(imu, glitches, still.period_s))
    moving = np.diff(rest) > 1
    if not moving.any():
        raise CalibrationError(
            "it was not turned between two rests: let it lie for 5 s, turn it by hand, let it lie "
            "for 5 s on the same mark"
        )
    first = int(rest[np.argmax(moving)])
    last = int(rest[moving.size - int(np.argmax(moving[::-1]))])
    rows = np.arange(first, last + 1)
    rows = rows[~glitches[rows]]
    t_s = (imu.t_ns[rows] - imu.t_ns[first]) * 1e-9
    rate = imu.angular_velocity_rad_s[rows, 2] - still.mean[2]
    total = float(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s)))
    known = 2.0 * np.pi * abs(turns)
    if not abs(abs(total) / known - 1.0) < 0.2:
        raise CalibrationError(
            f"the gyro saw {abs(total) / (2 * np.pi):.2f} turns about z, not "
            f"{abs(turns):g}: is it level, were other turns meant, is its full scale right?"
        )
    white = float(np.std(still.values[:, 2])) * np.sqrt(still.period_s * t_s[-1])
    drift = float(still.sigma[2]) * float(t_s[-1])
    sigma = np.sqrt(2.0 * HAND_SIGMA_RAD**2 + white**2 + drift**2) / known
    return Scale(known / abs(total), float(sigma), f"data: {abs(turns):g} turns by hand")
