"""The fit of an odometry as a calibration: public names, what each rests on, the verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calibration.driven import Driven
from calibration.estimation import Priors, RobustFit, rests_on
from calibration.lever.model import SLIP_MEAN
from calibration.odometry.excitation import DriveLimits
from calibration.odometry.model import NAMES, Model, dead_reckoned
from capture import MeasuredCalibration, Parameter, now_utc
from drivers.vesc import VescCalibration
from geometry import Floats

ERPM_PER_COUNT_S = 10.0
NOT_CALIBRATED = "the rig, not calibrated"


@dataclass(frozen=True, kw_only=True)
class OdometryLimits:
    """When an odometry calibration is accepted: standard deviations, gains as shares."""

    max_speed_sigma: float = field(default=0.005, metadata={"min": 0.0})
    max_gain_sigma: float = field(default=0.015, metadata={"min": 0.0})
    max_wheelbase_sigma_m: float = field(default=0.005, metadata={"min": 0.0})
    max_lateral_m_s2: float = field(default=4.0, metadata={"min": 0.0})
    """Windows beyond are left out: there tyres are no longer linear."""
    max_turn_rms_rad: float = field(default=0.03, metadata={"min": 0.0})
    max_distance_rms_m: float = field(default=0.01, metadata={"min": 0.0})
    drive: DriveLimits = field(default_factory=DriveLimits)


@dataclass(frozen=True)
class Tape:
    """The wheelbase as somebody measured it."""

    wheelbase_m: float
    sigma_m: float


@dataclass(frozen=True, eq=False)
class OdometryResult:
    """A calibration, and what its picture shows.

    before, after : models of the old and the new calibration; paths_before, paths_after : (n, 2)
    for each drive, from counts and commands alone; None where the steering was not calibrated.
    """

    calibration: MeasuredCalibration
    drives: Sequence[Driven]
    fit: RobustFit
    paths_before: Sequence[Floats] | None
    paths_after: Sequence[Floats] | None


def made_calibration(
    drives: Sequence[Driven],
    names: Sequence[str],
    fit: RobustFit,
    priors: Priors,
    old: VescCalibration,
    tape: Tape | None,
    limits: OdometryLimits,
    how: Mapping[str, object],
) -> OdometryResult:
    """The calibration of a fit, with its verdict, and both paths."""
    parameters = _parameters(names, fit, priors, old, tape)
    steering = len(names) == len(NAMES)
    before = after = None
    residuals = _residuals(drives, fit, steering)
    if steering:
        believed = Model(
            old.metres_per_count,
            0.0,
            0.0,
            old.steering_angle_to_servo_gain,
            old.steering_angle_to_servo_offset,
            old.wheelbase_m,
        )
        before = [dead_reckoned(drive, believed) for drive in drives]
        after = [dead_reckoned(drive, Model(*fit.values.tolist())) for drive in drives]
        residuals["path_rms_before_m"] = _off(drives, before)
        residuals["path_rms_m"] = _off(drives, after)
    reasons = _reasons(names, fit, residuals, limits)
    calibration = MeasuredCalibration(
        kind="odometry",
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        parameters=parameters,
        covariance=_public_covariance(names, fit),
        residuals=residuals,
        how={
            **how,
            "windows": fit.residuals.size // (2 if steering else 1),
            "left_out": int(np.count_nonzero(fit.weight == 0)),
            "headings": ["film" if d.gyro is None else "gyro fitted to the film" for d in drives],
            "slip_rad_s2_per_m": SLIP_MEAN,
            "before": old,
            "limits": limits,
        },
    )
    return OdometryResult(calibration, drives, fit, before, after)


def _parameters(
    names: Sequence[str],
    fit: RobustFit,
    priors: Priors,
    old: VescCalibration,
    tape: Tape | None,
) -> tuple[Parameter, ...]:
    """First those of the fit, in its order; then what follows from them or was not calibrated."""
    per_count = float(fit.values[0])
    gain = ERPM_PER_COUNT_S / abs(per_count)
    sigma = fit.sigma.tolist()
    found = [Parameter("speed_to_erpm_gain", gain, gain * sigma[0] / abs(per_count))]
    for k, name in enumerate(names[1:], start=1):
        rests = rests_on(fit, priors, k)
        if name == "wheelbase_m" and rests != "data":
            said = "the rig's word" if tape is None else "the tape measure"
            rests = rests.replace(
                "prior", f"{said} {priors.mean[k]:.4f} +- {priors.sigma[k]:.4f} m"
            )
        found.append(Parameter(name, float(fit.values[k]), sigma[k], rests))
    if len(names) == len(NAMES):
        servo_gain, wheelbase = fit.values[3], fit.values[5]
        slope = np.zeros(fit.values.size)
        bent = float(1.0 / (servo_gain * wheelbase))
        slope[3], slope[5] = -bent / servo_gain, -bent / wheelbase
        spread = float(np.sqrt(slope @ fit.covariance @ slope))
        found.append(Parameter("curvature_per_servo_per_m", bent, spread))
    else:
        for name in ("steering_angle_to_servo_gain", "steering_angle_to_servo_offset"):
            found.append(Parameter(name, getattr(old, name), None, NOT_CALIBRATED))
        found.append(Parameter("wheelbase_m", old.wheelbase_m, None, NOT_CALIBRATED))
    found.append(Parameter("direction", 1.0 if per_count > 0 else -1.0))
    found.append(Parameter("low_speed_erpm", old.low_speed_erpm, None, NOT_CALIBRATED))
    return tuple(found)


def _public_covariance(names: Sequence[str], fit: RobustFit) -> tuple[tuple[float, ...], ...]:
    to = np.eye(len(names))
    to[0, 0] = -ERPM_PER_COUNT_S * np.sign(fit.values[0]) / fit.values[0] ** 2
    return tuple(tuple(row) for row in (to @ fit.covariance @ to.T).tolist())


def _residuals(drives: Sequence[Driven], fit: RobustFit, steering: bool) -> dict[str, float]:
    windows = sum(len(drive.pairs) for drive in drives)
    counted = fit.weight > 0

    def rms(rows: slice) -> float:
        return float(np.sqrt(np.mean(fit.residuals[rows][counted[rows]] ** 2)))

    found = {"distance_rms_m": rms(slice(windows))}
    if steering:
        found["turn_rms_rad"] = rms(slice(windows, None))
    return found


def _off(drives: Sequence[Driven], paths: Sequence[Floats]) -> float:
    """Root mean square of how far dead reckoning is from the truth."""
    away = [((path - drive.xy) ** 2).sum(axis=1) for path, drive in zip(paths, drives, strict=True)]
    return float(np.sqrt(np.concatenate(away).mean()))


def _reasons(
    names: Sequence[str], fit: RobustFit, residuals: Mapping[str, float], limits: OdometryLimits
) -> list[str]:
    sigma = dict(zip(names, fit.sigma.tolist(), strict=True))
    values = dict(zip(names, fit.values.tolist(), strict=True))
    reasons = []
    share = sigma["metres_per_count"] / abs(values["metres_per_count"])
    if not share <= limits.max_speed_sigma:
        reasons.append(
            f"the speed gain is known to {100 * share:.2f} % only, at most "
            f"{100 * limits.max_speed_sigma:g} %: drive further, in sight of the camera"
        )
    if residuals["distance_rms_m"] > limits.max_distance_rms_m:
        reasons.append(
            f"distances are off by {1e3 * residuals['distance_rms_m']:.1f} mm in each window, at "
            f"most {1e3 * limits.max_distance_rms_m:g}: wheels spun, or the clocks are not joined"
        )
    if len(names) < len(NAMES):
        return reasons
    gain, wheelbase = "steering_angle_to_servo_gain", sigma["wheelbase_m"]
    if not wheelbase <= limits.max_wheelbase_sigma_m:
        reasons.append(
            f"the drive alone tells the wheelbase to {1e3 * wheelbase:.0f} mm only, at most "
            f"{1e3 * limits.max_wheelbase_sigma_m:g}: measure it from axle to axle and give "
            "--wheelbase"
        )
    share = sigma[gain] / abs(values[gain])
    if not share <= limits.max_gain_sigma:
        reasons.append(
            f"the steering gain is known to {100 * share:.1f} % only, at most "
            f"{100 * limits.max_gain_sigma:g} %: drive slow circles to both sides, and "
            "faster ones, so that the tyres' part is told apart; measure the wheelbase"
        )
    if residuals["turn_rms_rad"] > limits.max_turn_rms_rad:
        reasons.append(
            f"turns are off by {np.degrees(residuals['turn_rms_rad']):.1f} deg in each window, at "
            f"most {np.degrees(limits.max_turn_rms_rad):.1f}: the car slid, or the servo has play"
        )
    return reasons
