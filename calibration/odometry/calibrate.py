"""Odometry from lines and circles: speed gain, steering, wheelbase, and what each rests on."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from calibration.driven import Driven, stacked_clusters
from calibration.errors import CalibrationError
from calibration.estimation import Priors, RobustFit, robust_fit
from calibration.lever.model import forward_m, per_count_m, spinning
from calibration.odometry.excitation import (
    distance_faults,
    lateral_m_s2,
    slow_windows,
    steering_faults,
)
from calibration.odometry.model import (
    NAMES,
    SPEED_NAMES,
    Model,
    joined_distances,
    joined_turns,
)
from calibration.odometry.result import OdometryLimits, OdometryResult, Tape, made_calibration
from drivers.vesc import VescCalibration
from geometry import Floats

UNKNOWN_WHEELBASE = 0.2
"""Without a tape the rig's wheelbase is taken to this share of itself."""
CLOCK_SIGMA_S, SIDE_SIGMA_M = 0.02, 0.003
UNDERSTEER_SIGMA = 0.02
"""Front and rear tyres are of one rubber: f1tenth_gym's car has 0.011 s^2/m^2."""
LAG_SIGMA_S, LINKAGE_SIGMA = 0.1, 0.05
MAX_LAG_S = 0.3
LEAST_DISTANCE_M, LEAST_TURN_RAD = 5e-4, 1.5e-3
"""No window is better: a bicycle is not a car, and a servo has play."""


def calibrate_odometry(
    drives: Sequence[Driven],
    old: VescCalibration,
    tape: Tape | None = None,
    *,
    speed_only: bool = False,
    how: Mapping[str, object] | None = None,
    limits: OdometryLimits = OdometryLimits(),  # noqa: B008  frozen
) -> OdometryResult:
    """The calibration that explains the drives best, with a verdict.

    old : what was believed while driving; gives only `low_speed_erpm`, and what is not calibrated.
    Raises `CalibrationError`, saying what to drive, where the drives do not show what is asked.
    """
    faults = [
        f"{drive.name}: has no tachometer (/vesc/state); record the motor controller"
        for drive in drives
        if drive.counts is None
    ]
    if not faults:
        faults = distance_faults(drives, old.low_speed_erpm, limits.drive)
    if not speed_only:
        faults += steering_faults(drives, limits.drive)
    if faults:
        raise CalibrationError("the drive does not show the odometry:\n  " + "\n  ".join(faults))
    kept = [_usable(drive, old, limits, speed_only) for drive in drives]
    names = SPEED_NAMES if speed_only else NAMES
    priors = _priors(old, tape, names)
    fit = _fitted(kept, names, _start(kept, old, tape, speed_only), priors)
    return made_calibration(kept, names, fit, priors, old, tape, limits, how or {})


def _usable(
    drive: Driven, old: VescCalibration, limits: OdometryLimits, speed_only: bool
) -> Driven:
    """The drive without windows that are too slow, too fast, or before the first command."""
    good = ~slow_windows(drive, old.low_speed_erpm) & ~spinning(drive)
    if not speed_only:
        good &= lateral_m_s2(drive) <= limits.max_lateral_m_s2
        good &= drive.t_s[drive.pairs[:, 0]] >= drive.servo_t_s[0] + MAX_LAG_S
    return dataclasses.replace(drive, pairs=drive.pairs[good])


def _start(
    drives: Sequence[Driven], old: VescCalibration, tape: Tape | None, speed_only: bool
) -> Floats:
    """Near the solution, whatever was believed before: ratios and a straight line."""
    metres = np.concatenate([forward_m(drive) for drive in drives])
    moving = np.abs(metres) > 0.3 * np.median(np.abs(metres))
    per_count = per_count_m(drives)
    if speed_only:
        return np.array([per_count, 0.0, 0.0])
    wheelbase = old.wheelbase_m if tape is None else tape.wheelbase_m
    straight = Model(per_count, 0.0, 0.0, wheelbase_m=wheelbase)
    servo = np.concatenate([_servo(drive) for drive in drives])
    turn = np.concatenate([drive.turn_rad for drive in drives])
    angle = np.arctan(straight.wheelbase_m * turn / metres)
    gain, offset = np.polyfit(angle[moving], servo[moving], 1)
    return np.array([per_count, 0.0, 0.0, gain, offset, wheelbase, 0.0, 0.03, 0.0])


def _servo(drive: Driven) -> Floats:
    means = drive.servo_means(0.0)
    return np.array([means[i:j].mean() for i, j in drive.pairs.tolist()])


def _priors(old: VescCalibration, tape: Tape | None, names: Sequence[str]) -> Priors:
    wheelbase = (old.wheelbase_m, UNKNOWN_WHEELBASE * old.wheelbase_m)
    if tape is not None:
        wheelbase = (tape.wheelbase_m, tape.sigma_m)
    known = {
        "clock_s": (0.0, CLOCK_SIGMA_S),
        "side_m": (0.0, SIDE_SIGMA_M),
        "wheelbase_m": wheelbase,
        "understeer_s2_per_m2": (0.0, UNDERSTEER_SIGMA),
        "servo_lag_s": (0.03, LAG_SIGMA_S),
        "linkage_per_rad2": (0.0, LINKAGE_SIGMA),
    }
    pairs = [known.get(name, (0.0, np.inf)) for name in names]
    return Priors(np.array([mean for mean, _ in pairs]), np.array([sigma for _, sigma in pairs]))


def _fitted(
    drives: Sequence[Driven], names: Sequence[str], start: Floats, priors: Priors
) -> RobustFit:
    scale = np.abs(start[0])

    def model(x: Floats) -> Model:
        return Model(x[0] * scale, *x[1:].tolist())

    def residuals(x: Floats) -> Floats:
        now = model(x)
        along = joined_distances(drives, now)
        if len(names) == len(SPEED_NAMES):
            return along
        return np.concatenate([along, joined_turns(drives, now)])

    windows = sum(len(drive.pairs) for drive in drives)
    kinds = 1 if len(names) == len(SPEED_NAMES) else 2
    groups: npt.NDArray[np.int64] = np.repeat(np.arange(kinds), windows)
    clusters = np.tile(stacked_clusters(drives), kinds)
    first = np.concatenate([[start[0] / scale], start[1:]])
    least = np.array([LEAST_DISTANCE_M, LEAST_TURN_RAD])[:kinds]
    fit = robust_fit(residuals, first, priors, groups, clusters, least)
    size = np.ones(len(names))
    size[0] = scale
    return dataclasses.replace(
        fit,
        values=fit.values * size,
        covariance=fit.covariance * np.outer(size, size),
    )
