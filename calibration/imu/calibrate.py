"""An IMU's calibration: what it reads at rest, how it wanders, how it scales, how it is mounted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calibration.imu.allan import NoiseModel, allan_deviation, noise_of
from calibration.imu.magnetometer import Ellipsoid, fit_ellipsoid
from calibration.imu.scale import Scale
from calibration.imu.still import StillPart, still_part
from capture import Imu, MeasuredCalibration, Parameter, now_utc
from drivers.imu import STANDARD_GRAVITY_M_S2
from geometry import Floats

AXES = "xyz"
ALLAN_S = 60.0
"""Shorter rests show the white noise only."""


@dataclass(frozen=True, kw_only=True)
class ImuLimits:
    """When the calibration of an IMU is accepted."""

    max_bias_sigma_rad_s: float = field(default=float(np.deg2rad(0.05)), metadata={"min": 0.0})
    max_gravity_error: float = field(default=0.1, metadata={"min": 0.0})
    max_tilt_rad: float = field(default=float(np.deg2rad(15.0)), metadata={"min": 0.0})
    max_scale_error: float = field(default=0.1, metadata={"min": 0.0})
    max_scale_sigma: float = field(default=0.005, metadata={"min": 0.0})


@dataclass(frozen=True, eq=False)
class ImuResult:
    """A calibration, and what its picture shows; deviation : (k, 6) at tau_s (k,)."""

    calibration: MeasuredCalibration
    still: StillPart
    tau_s: Floats
    deviation: Floats
    noise: tuple[NoiseModel, ...]
    ellipsoid: Ellipsoid | None
    field_t: Floats | None


def calibrate_imu(
    imu: Imu,
    scale: Scale | None = None,
    field_t: Floats | None = None,
    how: Mapping[str, object] | None = None,
    limits: ImuLimits = ImuLimits(),
    still: StillPart | None = None,
) -> ImuResult:
    """What a recording shows of its IMU, with a verdict.

    field_t : (n, 3) readings of its compass; still : where it was looked for before. Raises
    `CalibrationError` where it never lay still.
    """
    still = still or still_part(imu)
    tau_s, deviation = allan_deviation(still.longest, still.period_s)
    noise = tuple(noise_of(tau_s, column) for column in deviation.T)
    if len(still.longest) * still.period_s < ALLAN_S:
        noise = tuple(NoiseModel(one.white, None, None) for one in noise)
    found = None if field_t is None else fit_ellipsoid(field_t)
    ellipsoid = found if isinstance(found, Ellipsoid) else None
    parameters = [
        *_still_parameters(still, noise),
        *_noise_parameters(noise),
        *([] if scale is None else _scale_parameters(scale)),
        *([] if ellipsoid is None else _compass_parameters(ellipsoid)),
    ]
    reasons = _reasons(parameters, scale, limits)
    told = "none recorded" if found is None else found if isinstance(found, str) else "calibrated"
    calibration = MeasuredCalibration(
        kind="imu",
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        parameters=tuple(parameters),
        residuals={
            **{f"gyro_std_{axis}_rad_s": float(still.values[:, k].std())
               for k, axis in enumerate(AXES)},
            **({} if ellipsoid is None else {"mag_rms_t": ellipsoid.rms_t}),
        },
        how={
            **(how or {}),
            "still_s": still.seconds,
            "glitches": still.glitches,
            "rate_hz": 1.0 / still.period_s,
            "allan_s": len(still.longest) * still.period_s,
            "compass": told,
            "limits": limits,
        },
    )  # fmt: skip
    return ImuResult(calibration, still, tau_s, deviation, noise, ellipsoid, field_t)


def _still_parameters(still: StillPart, noise: tuple[NoiseModel, ...]) -> list[Parameter]:
    """Bias, size of gravity, and how the accelerometer is tilted if the floor is level."""
    sigma = still.sigma.copy()
    for k, one in enumerate(noise):
        # No mean is better than the floor of the sensor.
        sigma[k] = np.hypot(sigma[k], one.instability or 0.0)
    found = [
        Parameter(f"gyro_bias_{axis}_rad_s", float(still.mean[k]), float(sigma[k]))
        for k, axis in enumerate(AXES)
    ]
    x, y, z = still.mean[3:].tolist()
    size = float(np.linalg.norm(still.mean[3:]))
    spread = float(np.linalg.norm(still.sigma[3:] * still.mean[3:]) / max(size, 1e-9))
    found.append(Parameter("gravity_m_s2", size, spread))
    roll, pitch = float(np.arctan2(y, z)), float(np.arctan2(-x, np.hypot(y, z)))
    tilt = float(still.sigma[3:].max() / max(size, 1e-9))
    found.append(Parameter("roll_rad", roll, tilt, "data, and a level floor"))
    found.append(Parameter("pitch_rad", pitch, tilt, "data, and a level floor"))
    return found


def _noise_parameters(noise: tuple[NoiseModel, ...]) -> list[Parameter]:
    found = []
    for k, one in enumerate(noise):
        device, unit = ("gyro", "rad_s") if k < 3 else ("accel", "m_s2")
        axis = AXES[k % 3]
        found.append(Parameter(f"{device}_noise_{axis}_{unit}_per_sqrt_hz", one.white))
        if one.instability is not None:
            found.append(Parameter(f"{device}_instability_{axis}_{unit}", one.instability))
        if one.walk is not None:
            found.append(Parameter(f"{device}_walk_{axis}_{unit}_per_s_per_sqrt_hz", one.walk))
    return found


def _scale_parameters(scale: Scale) -> list[Parameter]:
    found = [Parameter("gyro_scale", scale.value, scale.sigma, scale.source)]
    if scale.late_s is not None:
        found.append(Parameter("gyro_late_s", scale.late_s, scale.late_sigma_s, scale.source))
    return found


def _compass_parameters(ellipsoid: Ellipsoid) -> list[Parameter]:
    k = len(ellipsoid.hard_iron_t)
    found = [
        Parameter(f"mag_hard_iron_{AXES[i]}_t", float(ellipsoid.hard_iron_t[i]),
                  float(ellipsoid.sigma_t[i]))
        for i in range(k)
    ]  # fmt: skip
    found += [
        Parameter(f"mag_soft_iron_{AXES[i]}{AXES[j]}", float(ellipsoid.soft_iron[i, j]))
        for i in range(k)
        for j in range(i, k)
    ]
    return [*found, Parameter("mag_field_t", ellipsoid.field_t)]


def _reasons(parameters: list[Parameter], scale: Scale | None, limits: ImuLimits) -> list[str]:
    value = {one.name: one.value for one in parameters}
    sigma = max(one.sigma or 0.0 for one in parameters if one.name.startswith("gyro_bias"))
    reasons = []
    if not sigma <= limits.max_bias_sigma_rad_s:
        reasons.append(
            f"the bias is known to {np.degrees(sigma):.3f} deg/s only, at most "
            f"{np.degrees(limits.max_bias_sigma_rad_s):.3f}: let it lie still for longer"
        )
    gravity = value["gravity_m_s2"] / STANDARD_GRAVITY_M_S2
    if abs(gravity - 1.0) > limits.max_gravity_error:
        reasons.append(
            f"at rest the accelerometer reads {gravity:.3f} g: is its full scale right in the rig?"
        )
    tilt = max(abs(value["roll_rad"]), abs(value["pitch_rad"]))
    if tilt > limits.max_tilt_rad:
        reasons.append(
            f"its z axis is tilted by {np.degrees(tilt):.0f} deg: mount it level, z up, and put "
            "the car on a level floor, or the turning of the car is not on one axis"
        )
    if scale is not None and abs(scale.value - 1.0) > limits.max_scale_error:
        reasons.append(
            f"the gyro's scale is {scale.value:.3f}: is its full scale right in the rig?"
        )
    if scale is not None and not scale.sigma <= limits.max_scale_sigma:
        reasons.append(
            f"the scale is known to {100 * scale.sigma:.2f} % only, at most "
            f"{100 * limits.max_scale_sigma:g} %: turn it more often"
        )
    return reasons
