"""The lever arm of the rings from lines and circles: ahead, to the side, and their line's yaw."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.driven import Driven, stacked_clusters
from calibration.errors import CalibrationError
from calibration.estimation import Priors, RobustFit, rests_on, robust_fit
from calibration.lever.model import (
    SLIP_MEAN,
    SLIP_SIGMA,
    displacement_residuals,
    per_count_m,
    spinning,
)
from capture import MeasuredCalibration, Parameter, now_utc
from geometry import Floats
from tracking import CarRings

NAMES = ("ahead_m", "left_m", "yaw_rad", "slip_rad_s2_per_m", "metres_per_count")
AHEAD_SIGMA_M, SIDE_SIGMA_M, YAW_SIGMA_RAD = 0.1, 0.02, 0.1
"""How wrong an assumed lever arm may be."""
LEAST_M = 2e-4
MOST_SLIP_SIGMAS = 3.0
BEST_LEVER_M = 3e-4
"""No lever arm is claimed to be better: rings are glued on by hand, and a car flexes."""


@dataclass(frozen=True, kw_only=True)
class LeverLimits:
    """When a lever arm is accepted, and what a drive must have shown."""

    max_ahead_sigma_m: float = field(default=0.003, metadata={"min": 0.0})
    max_yaw_sigma_rad: float = field(default=0.006, metadata={"min": 0.0})
    max_lateral_m_s2: float = field(default=2.5, metadata={"min": 0.0})
    """Faster windows are left out: there the slip of the tyres is no longer linear."""
    least_windows: int = field(default=40, metadata={"min": 1})
    least_turn_rad: float = field(default=float(1.5 * np.pi), metadata={"min": 0.0})


@dataclass(frozen=True, eq=False)
class LeverResult:
    """A calibration; rings : as they are; what its picture shows: drives, fit, sideways before."""

    calibration: MeasuredCalibration
    rings: CarRings
    drives: Sequence[Driven]
    fit: RobustFit
    sideways_before_m: Floats
    sideways_m: Floats


def calibrate_lever(
    drives: Sequence[Driven],
    assumed: CarRings,
    how: Mapping[str, object] | None = None,
    limits: LeverLimits = LeverLimits(),
) -> LeverResult:
    """Where the rings are on the car whose truth was made with `assumed` ones, with a verdict.

    Raises `CalibrationError`, saying what to drive, where the drives do not show it.
    """
    kept = [_usable(drive, limits) for drive in drives]
    faults = _faults(kept, limits)
    if faults:
        raise CalibrationError("the drive does not show the lever arm:\n  " + "\n  ".join(faults))
    fit, priors = _fitted(kept)
    pose = fit.values[:3]
    rings = _moved(assumed, pose, float(fit.sigma[0]))
    windows = sum(len(drive.pairs) for drive in kept)
    sideways, counts = fit.residuals[:windows], fit.residuals.size > windows
    before = np.concatenate(
        [displacement_residuals(d, 0.0, 0.0, 0.0, 0.0, fit.values[4])[:, 1] for d in kept]
    )
    covariance = fit.covariance if counts else fit.covariance[:-1, :-1]
    reasons = _reasons(fit, limits)
    rested = [rests_on(fit, priors, k) for k in range(5)]
    if not counts:
        rested[1] = "prior: without a tachometer nothing tells the side"
    names = NAMES if counts else NAMES[:-1]
    found = [
        Parameter(name, float(fit.values[k]), float(fit.sigma[k]), rested[k])
        for k, name in enumerate(names)
    ]
    absolute = {"front_x_m": rings.front_x_m, "rear_x_m": rings.rear_x_m}
    found += [Parameter(n, value, float(fit.sigma[0])) for n, value in absolute.items()]
    found.append(Parameter("side_m", rings.side_m, float(fit.sigma[1]), rested[1]))
    calibration = MeasuredCalibration(
        kind="markers",
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        parameters=tuple(found),
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        residuals={
            "sideways_rms_before_m": _rms(before, fit.weight[:windows]),
            "sideways_rms_m": _rms(sideways, fit.weight[:windows]),
        },
        how={**(how or {}), "windows": windows, "assumed": assumed, "rings": rings,
             "limits": limits},
    )  # fmt: skip
    return LeverResult(calibration, rings, kept, fit, before, sideways)


def _usable(drive: Driven, limits: LeverLimits) -> Driven:
    period = np.diff(drive.t_s[drive.pairs], axis=1)[:, 0]
    lateral = drive.speed_m_s * np.abs(drive.turn_rad) / period
    good = (lateral <= limits.max_lateral_m_s2) & ~spinning(drive)
    return dataclasses.replace(drive, pairs=drive.pairs[good])


def _faults(drives: Sequence[Driven], limits: LeverLimits) -> list[str]:
    windows = sum(len(drive.pairs) for drive in drives)
    faults = []
    if windows < limits.least_windows:
        faults.append(
            f"it rolled gently in {windows} windows only, expected "
            f"{limits.least_windows}: drive slow circles for half a minute"
        )
    turns = np.concatenate([drive.turn_rad for drive in drives])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        turned = float((sign * turns)[sign * turns > 0].sum())
        if turned < limits.least_turn_rad:
            faults.append(
                f"it turned {np.degrees(turned):.0f} deg to the {side}; drive a full circle or "
                "more to either side, as slowly as it goes"
            )
    return faults


def _fitted(drives: Sequence[Driven]) -> tuple[RobustFit, Priors]:
    """Rows: what is left across the car; then, of drives with a tachometer, along it."""
    scale = np.array([1.0, 1.0, 1.0, 1.0, per_count_m(drives)])

    def residuals(x: Floats) -> Floats:
        left = [displacement_residuals(drive, *(x * scale).tolist()) for drive in drives]
        along = [one[:, 0] for one, d in zip(left, drives, strict=True) if d.counts is not None]
        return np.concatenate([one[:, 1] for one in left] + along)

    priors = Priors(
        np.array([0.0, 0.0, 0.0, SLIP_MEAN, 1.0]),
        np.array([AHEAD_SIGMA_M, SIDE_SIGMA_M, YAW_SIGMA_RAD, SLIP_SIGMA, 0.2]),
    )
    clusters = stacked_clusters(drives)
    with_counts = np.concatenate([np.full(len(d.pairs), d.counts is not None) for d in drives])
    groups = np.concatenate([np.zeros(clusters.size), np.ones(with_counts.sum())]).astype(np.int64)
    clusters = np.concatenate([clusters, clusters[with_counts]])
    least = np.full(int(groups.max()) + 1, LEAST_M)
    fit = robust_fit(residuals, priors.mean.copy(), priors, groups, clusters, least)
    done = dataclasses.replace(
        fit, values=fit.values * scale, covariance=fit.covariance * np.outer(scale, scale)
    )
    return done, Priors(priors.mean * scale, priors.sigma * np.abs(scale))


def _moved(assumed: CarRings, pose: Floats, sigma_m: float) -> CarRings:
    """The rings seen from the true base_link, which has that pose in the assumed one."""
    ahead, left, yaw = pose.tolist()
    middle = 0.5 * (assumed.front_x_m + assumed.rear_x_m) - ahead
    side = assumed.side_m - left
    x = np.cos(yaw) * middle + np.sin(yaw) * side
    y = -np.sin(yaw) * middle + np.cos(yaw) * side
    half = 0.5 * assumed.span_m
    return dataclasses.replace(
        assumed,
        front_x_m=float(x + half),
        rear_x_m=float(x - half),
        side_m=float(y),
        yaw_rad=float(assumed.yaw_rad - yaw),
        lever_sigma_m=max(sigma_m, BEST_LEVER_M),
    )


def _rms(values: Floats, weight: Floats) -> float:
    return float(np.sqrt(np.mean(values[weight > 0] ** 2)))


def _reasons(fit: RobustFit, limits: LeverLimits) -> list[str]:
    ahead, yaw, reasons = fit.sigma[0], fit.sigma[2], []
    if not ahead <= limits.max_ahead_sigma_m:
        reasons.append(
            f"the lever arm is known to {1e3 * ahead:.1f} mm only, at most "
            f"{1e3 * limits.max_ahead_sigma_m:g} mm: drive more circles to both sides, some as "
            "slowly as it goes and some at twice that, which tells the slip of the tyres"
        )
    slip = float(fit.values[3])
    if abs(slip - SLIP_MEAN) > MOST_SLIP_SIGMAS * SLIP_SIGMA:
        reasons.append(
            f"its tail slips by {1e3 * slip:.0f} mrad for each m/s^2, which no rolling tyre does "
            f"({1e3 * SLIP_MEAN:.0f} +- {1e3 * SLIP_SIGMA:.0f}): it drifted; drive gently"
        )
    if not yaw <= limits.max_yaw_sigma_rad:
        reasons.append(
            f"the yaw of the rings is known to {np.degrees(yaw):.2f} deg only, at most "
            f"{np.degrees(limits.max_yaw_sigma_rad):.2f}: drive longer, straight lines too"
        )
    return reasons


def scene_text(rings: CarRings) -> str:
    """The lines of `scene.yaml` for these rings."""
    return (
        f"car: {{front_x_m: {rings.front_x_m:.4f}, rear_x_m: {rings.rear_x_m:.4f}, "
        f"side_m: {rings.side_m:.4f}, yaw_rad: {rings.yaw_rad:.4f},\n"
        f"      height_m: {rings.height_m:g}, height_sigma_m: {rings.height_sigma_m:g}, "
        f"lever_sigma_m: {rings.lever_sigma_m:.4f}}}"
    )
