"""While it lies still: rows without glitches, the bias and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calibration.errors import CalibrationError
from capture import Imu
from geometry import Floats

Mask = npt.NDArray[np.bool_]
WINDOW_S = 0.5
LEAST_S = 1.5
QUIET_RAD_S, NOISY_RAD_S = float(np.deg2rad(0.3)), float(np.deg2rad(1.0))
SHAKEN_M_S2 = 0.1
"""A car that rolls shakes its accelerometer by more, or by more than twice what rest does."""
SAME_RAD_S = float(np.deg2rad(0.5))
GLITCH_SIGMAS = 30.0


@dataclass(frozen=True, eq=False)
class StillPart:
    """Rows at rest: values (n, 6) of gyro [rad/s] and accelerometer [m/s^2], glitches left out.

    longest : (m, 6) of the longest stretch, evenly spaced, glitches bridged; period_s; seconds of
    all; glitches : how many rows of the whole log were left out; mean, sigma : (6,).
    """

    values: Floats
    longest: Floats
    period_s: float
    seconds: float
    glitches: int
    mean: Floats
    sigma: Floats


def glitch_rows(values: Floats) -> Mask:
    """(n,) rows far from the median of the five around them, in any column: slipped bytes."""
    if len(values) < 5:
        return np.zeros(len(values), bool)
    padded = np.concatenate([values[2:0:-1], values, values[-2:-4:-1]])
    around = np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0)
    away = np.abs(values - np.median(around, axis=-1))
    usual = 1.4826 * np.median(away, axis=0)
    spread = np.maximum(usual, 1e-6 + 0.2 * away.mean(axis=0))
    return np.asarray((away > GLITCH_SIGMAS * spread).any(axis=1))


def columns_of(imu: Imu) -> Floats:
    """(n, 6) gyro and accelerometer."""
    return np.hstack([imu.angular_velocity_rad_s, imu.linear_acceleration_m_s2])


def still_part(imu: Imu) -> StillPart:
    """What an IMU read while it lay still; raises `CalibrationError` where it never did."""
    values = columns_of(imu)
    period_s = float(np.median(np.diff(imu.t_ns))) * 1e-9
    glitches = glitch_rows(values)
    still = still_rows(imu, glitches, period_s) & ~glitches
    seconds = float(np.count_nonzero(still)) * period_s
    if seconds < LEAST_S:
        raise CalibrationError(
            f"it lay still for {seconds:.1f} s of {len(values) * period_s:.1f} s only, expected "
            f"{LEAST_S:g} s: leave the car alone with its motor off, for a minute or more"
        )
    rows = values[still]
    mean = rows.mean(axis=0)
    return StillPart(
        rows,
        _longest(imu, values, glitches, still, period_s),
        period_s,
        seconds,
        int(np.count_nonzero(glitches)),
        mean,
        _sigma_of_mean(rows, period_s),
    )


def still_rows(imu: Imu, glitches: Mask, period_s: float) -> Mask:
    """(n,) rows in windows that are quiet and in which the gyro reads about the same."""
    size = max(round(WINDOW_S / period_s), 3)
    values = columns_of(imu)
    starts = np.arange(0, len(values) - size + 1, size)
    std, mean = np.full((starts.size, 2), np.inf), np.full((starts.size, 3), np.inf)
    for k, start in enumerate(starts.tolist()):
        rows = values[start : start + size][~glitches[start : start + size]]
        if len(rows) > size // 2:
            spread = rows.std(axis=0)
            std[k], mean[k] = (spread[:3].max(), spread[3:].max()), rows[:, :3].mean(axis=0)
    quietest = std.min(axis=0) if len(std) else np.full(2, np.inf)
    turned = min(max(2.0 * float(quietest[0]), QUIET_RAD_S), NOISY_RAD_S)
    quiet = (std[:, 0] < turned) & (std[:, 1] < max(2.0 * float(quietest[1]), SHAKEN_M_S2))
    if not quiet.any():
        return np.zeros(len(values), bool)
    usual = np.median(mean[quiet], axis=0)
    quiet &= np.abs(mean - usual).max(axis=1) < SAME_RAD_S
    still = np.zeros(len(values), bool)
    for start in starts[quiet].tolist():
        still[start : start + size] = True
    return still


def _longest(imu: Imu, values: Floats, glitches: Mask, still: Mask, period_s: float) -> Floats:
    """Evenly spaced values (m, 6) of the longest stretch of rest without a gap."""
    whole = still | (glitches & np.roll(still, 1))
    broken = np.concatenate([[True], np.diff(imu.t_ns) > 3e9 * period_s]) | ~whole
    stretch = np.cumsum(broken)
    counts = np.bincount(stretch[whole])
    rows = np.flatnonzero(whole & (stretch == int(counts.argmax())))
    t_s = (imu.t_ns[rows] - imu.t_ns[rows[0]]) * 1e-9
    good = ~glitches[rows]
    even = np.arange(0.0, t_s[-1] + 0.5 * period_s, period_s)
    return np.stack([np.interp(even, t_s[good], column) for column in values[rows][good].T], axis=1)


def _sigma_of_mean(rows: Floats, period_s: float) -> Floats:
    """(6,) of the mean: from means of blocks of half a second, which sees slow noise, too."""
    size = max(round(WINDOW_S / period_s), 1)
    blocks = rows[: len(rows) // size * size].reshape(-1, size, rows.shape[1]).mean(axis=1)
    spread = blocks.std(axis=0, ddof=1) if len(blocks) > 1 else rows.std(axis=0)
    return np.asarray(spread / np.sqrt(max(len(blocks), 1)))
