"""Which calibrations of a session are in force, and what ties the motor's numbers to its car."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from capture.calibrations import (
    Calibration,
    MeasuredCalibration,
    accepted_file,
    read_calibration,
)
from capture.configuration import configuration_from_mapping
from capture.session_info import FILE_NAME, SessionInfo
from drivers.vesc import VescCalibration

_OF_THE_CAR = (
    "speed_to_erpm_gain",
    "steering_angle_to_servo_gain",
    "steering_angle_to_servo_offset",
    "wheelbase_m",
)


def usual_calibrations(session: Path | None, kind: str) -> Path:
    """The folder where a kind is looked for if nobody says: the session's, else `calibration`."""
    own = None if session is None else session / "calibration"
    return Path("calibration") if own is None or not any(own.glob(f"{kind}_*.yaml")) else own


def calibration_in_force(session: Path, kind: str) -> Calibration | None:
    """The newest accepted calibration of a kind in a session's folder, None without one.

    Raises `CalibrationFileError` for a file that cannot be read.
    """
    file = accepted_file(session / "calibration", kind)
    return None if file is None else read_calibration(file, kind)


def measured(session: Path, kind: str) -> Mapping[str, float]:
    """The parameters of the car's calibration of a kind that is in force; empty without one."""
    found = calibration_in_force(session, kind)
    if not isinstance(found, MeasuredCalibration):
        return {}
    return {one.name: one.value for one in found.parameters}


def motor_calibration(session: Path) -> VescCalibration | None:
    """Of an accepted `odometry_*.yaml`, None without one."""
    found = measured(session, "odometry")
    if not found:
        return None
    return VescCalibration(
        **{name: found[name] for name in _OF_THE_CAR},
        direction=round(found["direction"]),
        low_speed_erpm=found["low_speed_erpm"],
    )


def recorded_motor_calibration(session: Path, info: SessionInfo) -> VescCalibration | None:
    """The rig's words while it was recorded.

    Raises `ConfigurationError` where `session.yaml` holds something else in their place.
    """
    rig = info.configuration.get("rig")
    values = rig.get("vesc_calibration") if isinstance(rig, Mapping) else None
    if not isinstance(values, Mapping):
        return None
    return configuration_from_mapping(VescCalibration, values, f"{session}/{FILE_NAME}")
