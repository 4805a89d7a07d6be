"""What a gyro reads while the car stands still: its bias, if it did stand still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.imu.sample import STANDARD_GRAVITY_M_S2, Vector, vector

LEAST_S = 2.0
MOST_STD_RAD_S = float(np.deg2rad(0.3))
OUTLIER_SIGMAS = 8.0
MOST_OUTLIERS = 0.01
MOST_GRAVITY_ERROR = 0.15

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StillBias:
    """The bias of the gyro over a while at rest, and whether it may be used.

    bias_rad_s, std_rad_s : per axis, over the rows that count; gravity_m_s2 : mean size of the
    acceleration; temperature_c : mean, NaN if unknown (the bias drifts with it); duration_s;
    rows, outliers : how many came and how many of them do not belong (slipped bytes);
    faults : why it may not be used, empty if it may.
    """

    bias_rad_s: Vector
    std_rad_s: Vector
    gravity_m_s2: float
    temperature_c: float
    duration_s: float
    rows: int
    outliers: int
    faults: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        """Whether the car stood still and the rows are clean."""
        return not self.faults


def outlier_rows(values: Floats) -> npt.NDArray[np.bool_]:
    """(n,) rows of (n, k) with any value further than 8 sigma from the median of its column.

    Sigma is 1.4826 times the median deviation, so that the outliers have no say in it.
    """
    away = np.abs(values - np.median(values, axis=0))
    sigma = 1.4826 * np.median(away, axis=0)
    return np.asarray((away > OUTLIER_SIGMAS * np.maximum(sigma, 1e-12)).any(axis=1))


def still_bias(
    angular_velocity_rad_s: Floats,
    linear_acceleration_m_s2: Floats,
    duration_s: float,
    temperature_c: float = float("nan"),
) -> StillBias:
    """The bias of rows taken at rest, (n, 3) each, over a duration.

    Accepted with at least 2 s, a standard deviation below 0.3 deg/s on every axis, about 1 g, and
    at most 1 % of rows left out (reference protocols C.1). Without rows it is NaN and not accepted.
    """
    rows = len(angular_velocity_rad_s)
    if rows == 0:
        none = (np.nan, np.nan, np.nan)
        return StillBias(none, none, np.nan, temperature_c, duration_s, 0, 0, ("no rows came",))
    out = outlier_rows(np.hstack((angular_velocity_rad_s, linear_acceleration_m_s2)))
    gyro, accel = angular_velocity_rad_s[~out], linear_acceleration_m_s2[~out]
    mean, std = gyro.mean(axis=0), gyro.std(axis=0)
    gravity = float(np.linalg.norm(accel, axis=1).mean())
    outliers = int(np.count_nonzero(out))
    return StillBias(
        vector(mean),
        vector(std),
        gravity,
        temperature_c,
        duration_s,
        rows,
        outliers,
        tuple(_faults(std, gravity, duration_s, outliers / rows)),
    )


def _faults(
    std_rad_s: Floats, gravity_m_s2: float, duration_s: float, outliers: float
) -> list[str]:
    faults = []
    if duration_s < LEAST_S:
        faults.append(f"{duration_s:.1f} s are too short; stand still for {LEAST_S:.0f} s")
    for axis, std in zip("xyz", std_rad_s, strict=True):
        if std >= MOST_STD_RAD_S:
            faults.append(f"gyro {axis} varies by {np.rad2deg(std):.2f} deg/s: the car moved")
    if abs(gravity_m_s2 / STANDARD_GRAVITY_M_S2 - 1.0) > MOST_GRAVITY_ERROR:
        faults.append(
            f"the acceleration is {gravity_m_s2:.2f} m/s^2 at rest: wrong full scale, or it moved"
        )
    if outliers > MOST_OUTLIERS:
        faults.append(f"{100.0 * outliers:.1f} % of the rows do not belong: bad wires")
    return faults
