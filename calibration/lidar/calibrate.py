"""The pose of the lidar on the car: cones where they are known to stand, from where the car was.

Unknown besides the pose: a bias of the ranges, how late the lidar's stamps are, and where each cone
really stands, within what its truth claims. Rows are range and bearing of every detection.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from calibration.errors import CalibrationError
from calibration.estimation import Priors, RobustFit, rests_on, robust_fit
from calibration.lever.assumed import assumed_rings
from calibration.lidar.detections import Seen, best_yaw, nearest_cones, seen_in
from capture import MeasuredCalibration, Parameter, Session, now_utc
from geometry import Floats, compose, wrap
from tracking import CarRings

NAMES = ("x_m", "y_m", "yaw_rad", "range_bias_m", "late_s")
RANGE_BIAS_SIGMA_M, LATE_SIGMA_S, CONE_SIGMA_M = 0.02, 0.05, 0.001
FIRST_GATES_M = (0.5, 0.3, 0.2, 0.15)
"""How far a detection may be from its cone, round by round."""
LEAST_RANGE_M, LEAST_BEARING_RAD = 1e-3, 1e-3


@dataclass(frozen=True, kw_only=True)
class LidarLimits:
    """When a pose is accepted, and what a drive must have shown."""

    max_position_sigma_m: float = field(default=0.003, metadata={"min": 0.0})
    max_yaw_sigma_rad: float = field(default=float(np.radians(0.3)), metadata={"min": 0.0})
    least_cones: int = field(default=3, metadata={"min": 2})
    least_detections: int = field(default=100, metadata={"min": 10})
    least_share: float = field(default=0.3, metadata={"min": 0.0, "max": 1.0})
    """Of all detections, that must be cones that are known."""


@dataclass(frozen=True, eq=False)
class LidarResult:
    """A calibration; what its picture shows: detections with their cones, both mountings."""

    calibration: MeasuredCalibration
    seen: Sequence[Seen]
    cones: Sequence[npt.NDArray[np.int64]]
    before: Floats
    mounting: Floats
    late_s: float
    fit: RobustFit


def calibrate_lidar(
    sessions: Sequence[Session],
    before: Floats,
    radius_m: float = 0.05,
    how: Mapping[str, object] | None = None,
    limits: LidarLimits = LidarLimits(),
) -> LidarResult:
    """`pose_base_lidar` that explains what the lidar saw, with a verdict.

    before : (3,) what was in force; only drawn. Raises `CalibrationError`, saying what to do, where
    the sessions do not show it, `MissingStreamError` without truth or scans.
    """
    for session in sessions:
        if session.ground_truth().landmarks is None:
            raise CalibrationError(
                f"{session.folder}: its ground truth has no cones; let trackside track measure them"
            )
    scans = [session.scans() for session in sessions]
    guess = np.zeros(5)
    first = [seen_in(s, guess[:3], 0.0, radius_m, r) for s, r in zip(sessions, scans, strict=True)]
    if not any(one.t_ns.size for one in first):
        raise CalibrationError(
            "no cone was seen in any scan; is --cone-radius right, did it drive?"
        )
    guess[2] = best_yaw(max(first, key=lambda one: one.t_ns.size), guess[:3], FIRST_GATES_M[0])
    seen = first
    for turn, gate_m in enumerate(FIRST_GATES_M):
        if turn:
            seen = [
                seen_in(s, guess[:3], guess[4], radius_m, r)
                for s, r in zip(sessions, scans, strict=True)
            ]
        cones = [nearest_cones(one, guess[:3], guess[4], gate_m) for one in seen]
        faults = _faults(seen, cones, limits)
        if faults:
            raise CalibrationError(
                "the scans do not show where the lidar is:\n  " + "\n  ".join(faults)
            )
        fit, priors = _fitted(seen, cones, guess)
        guess = fit.values[:5].copy()
        guess[2] = float(wrap(guess[2]))
    rings = assumed_rings(sessions[0])
    return _made(seen, cones, before, rings, fit, priors, limits, how or {})


def _faults(
    seen: Sequence[Seen], cones: Sequence[npt.NDArray[np.int64]], limits: LidarLimits
) -> list[str]:
    known = sum(int((which >= 0).sum()) for which in cones)
    total = sum(which.size for which in cones)
    different = {
        (one.name, k) for one, w in zip(seen, cones, strict=True) for k in set(w.tolist()) - {-1}
    }
    faults = []
    if len(different) < limits.least_cones:
        faults.append(
            f"{len(different)} known cones were seen, expected {limits.least_cones}: drive among "
            "the cones, within 2 m of several, to all sides of the car"
        )
    if known < limits.least_detections:
        faults.append(
            f"{known} detections are known cones, expected {limits.least_detections}: drive longer"
        )
    if total and known < limits.least_share * total:
        faults.append(
            f"{100 * known / total:.0f} % of {total} detections are known cones: were the cones "
            "moved after the film, is the truth on the car's clock (trackside join)?"
        )
    return faults


def _fitted(
    seen: Sequence[Seen], cones: Sequence[npt.NDArray[np.int64]], guess: Floats
) -> tuple[RobustFit, Priors]:
    """Parameters: those of `NAMES`, then x and y of every cone's displacement."""
    rows = [which >= 0 for which in cones]
    kept = [
        dataclasses.replace(s, t_ns=s.t_ns[r], range_m=s.range_m[r], bearing_rad=s.bearing_rad[r])
        for s, r in zip(seen, rows, strict=True)
    ]
    which = [w[r] for w, r in zip(cones, rows, strict=True)]
    firsts = np.concatenate([[0], np.cumsum([len(one.cones) for one in kept])])
    poses = [one.poses(float(guess[4])) for one in kept]
    rates = [(one.poses(float(guess[4]) - 0.02), one.poses(float(guess[4]) + 0.02)) for one in kept]

    def residuals(x: Floats) -> Floats:
        moved = x[5:].reshape(-1, 2)
        found_range, found_bearing = [], []
        for k, one in enumerate(kept):
            after, before = rates[k]
            step = after - before
            step[:, 2] = wrap(step[:, 2])
            # Late stamps show where the car was before.
            pose = poses[k] - step / 0.04 * (x[4] - guess[4])
            place = one.cones.positions[which[k]] + moved[firsts[k] + which[k]]
            lidar = compose(pose, x[:3])
            dx, dy = (place - lidar[:, :2]).T
            found_range.append(one.range_m - np.hypot(dx, dy) - x[3])
            found_bearing.append(wrap(one.bearing_rad - np.arctan2(dy, dx) + lidar[:, 2]))
        return np.concatenate([*found_range, *found_bearing])

    priors = _priors(seen)
    size = sum(w.size for w in which)
    groups: npt.NDArray[np.int64] = np.repeat(np.arange(2), size)
    start = priors.mean.copy()
    start[:5] = guess
    clusters, first = [], 0
    for one in kept:
        clusters.append(one.clusters + first)
        first = int(clusters[-1].max(initial=first)) + 1
    both = np.tile(np.concatenate(clusters), 2)
    least = np.array([LEAST_RANGE_M, LEAST_BEARING_RAD])
    return robust_fit(residuals, start, priors, groups, both, least), priors


def _priors(seen: Sequence[Seen]) -> Priors:
    sigma = [np.array([np.inf, np.inf, np.inf, RANGE_BIAS_SIGMA_M, LATE_SIGMA_S])]
    for one in seen:
        spread = one.cones.covariances
        if spread is None:
            sigma.append(np.full(2 * len(one.cones), CONE_SIGMA_M))
        else:
            own = np.sqrt(np.diagonal(spread, axis1=1, axis2=2)).ravel()
            sigma.append(np.maximum(own, 1e-4))
    whole = np.concatenate(sigma)
    return Priors(np.zeros(whole.size), whole)


def _made(
    seen: Sequence[Seen],
    cones: Sequence[npt.NDArray[np.int64]],
    before: Floats,
    rings: CarRings,
    fit: RobustFit,
    priors: Priors,
    limits: LidarLimits,
    how: Mapping[str, object],
) -> LidarResult:
    """The calibration of a fit, with its verdict.

    rings : of the truth; where their line points on the car is as uncertain as their places, which
    is told beside, for it is the same for every session.
    """
    values, covariance = fit.values[:5].copy(), fit.covariance[:5, :5].copy()
    values[2] = float(wrap(values[2]))
    # Where the rings are wrong on the car, the lidar is wrong by as much.
    covariance[[0, 1], [0, 1]] += rings.lever_sigma_m**2
    sigma = np.sqrt(np.diag(covariance))
    half = fit.residuals.size // 2
    counted = fit.weight > 0
    reasons = []
    for k, name in enumerate(("x", "y")):
        if not sigma[k] <= limits.max_position_sigma_m:
            reasons.append(
                f"{name} is known to {1e3 * sigma[k]:.1f} mm only, at most "
                f"{1e3 * limits.max_position_sigma_m:g} mm: let it see cones on all sides, and near"
            )
    if not sigma[2] <= limits.max_yaw_sigma_rad:
        reasons.append(
            f"yaw is known to {np.degrees(sigma[2]):.2f} deg only, at most "
            f"{np.degrees(limits.max_yaw_sigma_rad):.2f} deg: drive longer among the cones"
        )
    calibration = MeasuredCalibration(
        kind="lidar",
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        parameters=tuple(
            Parameter(name, float(values[k]), float(sigma[k]), rests_on(fit, priors, k))
            for k, name in enumerate(NAMES)
        ),
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        residuals={
            "range_rms_m": float(np.sqrt(np.mean(fit.residuals[:half][counted[:half]] ** 2))),
            "bearing_rms_rad": float(np.sqrt(np.mean(fit.residuals[half:][counted[half:]] ** 2))),
        },
        how={
            **how,
            "detections": half,
            "no_known_cone": sum(int((which < 0).sum()) for which in cones),
            "left_out": int(np.count_nonzero(~counted[:half] | ~counted[half:])),
            "before": before,
            "rings": rings,
            "rings_yaw_sigma_rad": float(np.sqrt(2.0)) * rings.lever_sigma_m / rings.span_m,
            "limits": limits,
        },
    )
    return LidarResult(calibration, seen, cones, before, values[:3], float(values[4]), fit)
