"""Every kind of calibration as tables for a person."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from calibration.clocks.cli import delay_table
from calibration.stereo.cli import stereo_table
from capture import (
    Calibration,
    CameraCalibration,
    CameraDelayCalibration,
    MeasuredCalibration,
    StereoCalibration,
    WorldCalibration,
)
from dialogue import Cell, Table

_CORRELATED = 0.9
KEY_NUMBERS = {
    "odometry": (
        "speed_to_erpm_gain",
        "steering_angle_to_servo_gain",
        "steering_angle_to_servo_offset",
        "wheelbase_m",
    ),
    "imu": ("gyro_bias_z_rad_s", "gyro_scale", "gravity_m_s2"),
    "lidar": ("x_m", "y_m", "yaw_rad", "range_bias_m"),
    "markers": ("front_x_m", "rear_x_m", "side_m", "yaw_rad"),
}
"""What one wants to see of a kind at a glance."""


def tables_of(calibration: Calibration) -> list[Table]:
    """The tables of a calibration of any kind."""
    if isinstance(calibration, CameraCalibration):
        return [camera_table(calibration)]
    if isinstance(calibration, WorldCalibration):
        return world_tables(calibration)
    if isinstance(calibration, CameraDelayCalibration):
        return [delay_table(calibration)]
    if isinstance(calibration, StereoCalibration):
        return [stereo_table(calibration)]
    return [measured_table(calibration)]


def in_force_table(files: Mapping[str, Path], read: Mapping[str, Calibration]) -> Table:
    """One line for each kind: file, date, what it was made from, verdict, key numbers."""
    rows: list[tuple[Cell, ...]] = [
        (kind, files[kind].name, one.made_utc, _source(one),
         "accepted" if one.accepted else "rejected", _key_numbers(one))
        for kind, one in read.items()
    ]  # fmt: skip
    columns = ("kind", "file", "made (UTC)", "from", "verdict", "key numbers")
    return Table(columns, tuple(rows), "calibrations in force")


def measured_table(calibration: MeasuredCalibration) -> Table:
    """Every parameter of a calibration of the car, what it rests on, what was left over."""
    rows: list[tuple[Cell, ...]] = [
        (one.name, one.value, one.sigma, one.source) for one in calibration.parameters
    ]
    left = ", ".join(f"{name} {value:.4g}" for name, value in calibration.residuals.items())
    notes = [f"left over: {left}"] if left else []
    notes += [f"{a} and {b} are correlated by {r:+.2f}" for a, b, r in _correlated(calibration)]
    title = f"{calibration.kind}, {calibration.made_utc}"
    columns = ("parameter", "value", "sigma", "rests on")
    return Table(columns, tuple(rows), title, "\n".join(notes), digits=6)


def _correlated(calibration: MeasuredCalibration) -> list[tuple[str, str, float]]:
    """Pairs of parameters that the data hardly tell apart."""
    correlation, names = calibration.correlation, [p.name for p in calibration.parameters]
    return [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(len(correlation))
        for j in range(i)
        if abs(correlation[i, j]) > _CORRELATED
    ]


def _source(calibration: Calibration) -> str:
    if isinstance(calibration, CameraDelayCalibration):
        return " ".join(one.name for one in calibration.sessions)
    how = calibration.how
    told = how.get("sessions", how.get("source", ""))
    return " ".join(map(str, told)) if isinstance(told, list) else str(told)


def _key_numbers(calibration: Calibration) -> str:
    if isinstance(calibration, CameraCalibration):
        return f"fx {calibration.camera.fx:.1f}, rms {calibration.rms_px:.2f} px"
    if isinstance(calibration, WorldCalibration):
        return ", ".join(
            f"{k} {1e3 * v:.1f} mm" for k, v in list(calibration.accuracy_m.items())[:2]
        )
    if isinstance(calibration, CameraDelayCalibration):
        return f"delay {1e3 * calibration.delay_s:.2f} +- {1e3 * calibration.sigma_s:.2f} ms"
    if isinstance(calibration, StereoCalibration):
        return f"base line {1e3 * calibration.pair.baseline_m:.1f} mm"
    values = {one.name: one.value for one in calibration.parameters}
    told = [name for name in KEY_NUMBERS[calibration.kind] if name in values]
    return ", ".join(f"{name} {values[name]:.5g}" for name in told)


def camera_table(calibration: CameraCalibration) -> Table:
    """Every parameter, its standard deviation, and below it the views."""
    from geometry import INTRINSICS, intrinsics_of

    values = intrinsics_of(calibration.camera).tolist()
    sigma = [row[i] ** 0.5 for i, row in enumerate(calibration.covariance)]
    rows: list[tuple[Cell, ...]] = [*zip(INTRINSICS, values, sigma, strict=True)]
    size = f"{calibration.camera.width_px}x{calibration.camera.height_px}"
    left_out = [view for view in calibration.views if not view.used]
    notes = [f"rms {calibration.rms_px:.3f} px in {len(calibration.views) - len(left_out)} views"]
    notes += [f"left out {one.name}: {one.rms_px:.2f} px, {one.why}" for one in left_out]
    title = f"camera {size}, {calibration.made_utc}"
    return Table(("parameter", "value", "sigma"), tuple(rows), title, "\n".join(notes), digits=5)


def world_tables(calibration: WorldCalibration) -> list[Table]:
    """Markers, lengths, and the predicted accuracy below them."""
    marks: list[tuple[Cell, ...]] = [
        (one.name, one.corner, *one.xyz_m, 1e3 * math.sqrt(sxx + syy), one.residual_px)
        for one in calibration.markers
        for sxx, _, syy in [one.covariance_m2]
    ]
    lengths: list[tuple[Cell, ...]] = [
        (" to ".join(one.markers), one.length_m, 1e3 * one.sigma_m, 1e3 * one.residual_m)
        for one in calibration.lengths
    ]
    told = ", ".join(f"{key.replace('_', ' ')} {1e3 * value:.2f} mm"
                     for key, value in calibration.accuracy_m.items())  # fmt: skip
    columns = ("marker", "corner", "x [m]", "y [m]", "z [m]", "sigma [mm]", "residual [px]")
    return [
        Table(columns, tuple(marks), f"world, {calibration.made_utc}"),
        Table(
            ("length", "measured [m]", "sigma [mm]", "fitted - measured [mm]"),
            tuple(lengths),
            note=f"predicted accuracy: {told}",
            digits=4,
        ),
    ]
