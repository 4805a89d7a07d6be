from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from click.testing import CliRunner
from recording import COUNTS_PER_M, WHEELBASE_M, driven, messages, stamps, write

from capture import MeasuredCalibration, Parameter, Session, write_calibration
from capture.session_info import write_session_info
from slam.algorithms import Request, estimate_session
from slam.cli import slam
from slam.session_defaults import for_session
from slam.sources import odometry_of

CALIBRATION = {
    "speed_to_erpm_gain": 10.0 * COUNTS_PER_M,
    "steering_angle_to_servo_gain": -1.2,
    "steering_angle_to_servo_offset": 0.5,
    "wheelbase_m": WHEELBASE_M,
    "direction": 1,
}


def recorded(folder: Path, *devices: str) -> Session:
    """What a recorder that only listens writes: telemetry and no odometry of the motor."""
    session = write(folder, [m for m in messages() if m[2] != "/vesc/odom"])
    info = replace(
        session.info,
        devices={name: {} for name in devices},
        configuration={"rig": {"vesc_calibration": CALIBRATION}},
    )
    write_session_info(folder, info)
    return Session.open(folder)


@pytest.mark.parametrize(
    ("devices", "source"),
    [(("lidar", "vesc", "razor"), "imu+tachometer"), (("lidar", "vesc"), "tachometer")],
)
def test_a_recording_is_read_as_it_was_made(
    tmp_path: Path, devices: tuple[str, ...], source: str
) -> None:
    session = recorded(tmp_path / "session", *devices)
    request = for_session(Request(), session)
    assert request.odometry == source
    estimate, _, _ = estimate_session(session, request, quiet=True)
    path = estimate.path
    truth = driven((path.t_ns - stamps(np.zeros(1))[0]) * 1e-9)
    assert np.abs(path.poses[:, :2] - truth[:, :2]).max() < 0.1


def test_what_a_person_said_goes_before(tmp_path: Path) -> None:
    session = recorded(tmp_path / "session", "lidar", "vesc", "razor")
    said = Request(odometry="tachometer", settings=("odometry.wheelbase_m=0.5",))
    request = for_session(said, session)
    assert request.odometry == "tachometer"
    assert request.source_config().wheelbase_m == 0.5
    assert request.source_config().metres_per_count == pytest.approx(1.0 / COUNTS_PER_M)


def test_a_session_that_says_nothing_changes_nothing(tmp_path: Path) -> None:
    session = write(tmp_path / "session", messages())
    assert for_session(Request(), session) == Request()


def test_the_command_needs_no_words_for_a_recording(tmp_path: Path) -> None:
    recorded(tmp_path / "session", "lidar", "vesc", "razor")
    done = CliRunner().invoke(slam, [str(tmp_path / "session")], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert "gyro bias" in done.output


def measured(kind: Literal["odometry", "imu", "lidar"], **values: float) -> MeasuredCalibration:
    parameters = tuple(Parameter(name, value) for name, value in values.items())
    made = "2026-05-14T10:15:30Z"
    return MeasuredCalibration(kind=kind, made_utc=made, accepted=True, parameters=parameters)


def test_calibrations_of_the_session_are_taken(tmp_path: Path) -> None:
    session = recorded(tmp_path / "session", "lidar", "vesc", "razor")
    for one in (
        measured("lidar", x_m=0.13, y_m=0.01, yaw_rad=0.02),
        measured("imu", gyro_scale=1.5, gyro_bias_z_rad_s=0.02, gyro_late_s=0.004),
    ):
        session.copy_calibration(write_calibration(tmp_path, one))
    request = for_session(Request(), session)
    mounting = request.cone_config().mounting
    assert (mounting.x_m, mounting.y_m, mounting.yaw_rad) == (0.13, 0.01, 0.02)
    source = request.source_config()
    assert source.gyro_scale == 1.5
    assert source.gyro_usual_bias_rad_s == pytest.approx(0.03)
    assert source.imu_offset_s == -0.004
    said = for_session(Request(settings=("cones.mounting.x_m=0.2",)), session)
    assert said.cone_config().mounting.x_m == 0.2


def test_a_motor_calibrated_later_makes_odometry_anew(tmp_path: Path) -> None:
    """The angles of /drive are those of the rig; both calibrations stand for the same servo."""
    session = write(tmp_path / "session", list(messages()))
    info = replace(
        session.info,
        devices={"vesc": {}},
        configuration={"rig": {"vesc_calibration": CALIBRATION}},
    )
    write_session_info(session.folder, info)
    session = Session.open(session.folder)
    assert for_session(Request(), session).odometry is None
    new = {**CALIBRATION, "steering_angle_to_servo_gain": -1.0, "low_speed_erpm": 700.0}
    new["steering_angle_to_servo_offset"] = 0.48
    session.copy_calibration(write_calibration(tmp_path, measured("odometry", **new)))
    request = for_session(Request(), session)
    assert request.odometry == "tachometer"
    config = request.source_config()
    believed, known = session.recorded_motor_calibration(), session.motor_calibration()
    assert believed is not None
    assert known is not None
    angle = config.steering_scale * (believed.steering_angle_rad(0.4) - config.steering_offset_rad)
    assert angle == pytest.approx(known.steering_angle_rad(0.4))
    driven_now, _ = odometry_of(session, request.odometry, config)
    moving = driven_now.speed_m_s > 0.3
    servo = CALIBRATION["steering_angle_to_servo_offset"] - 1.2 * 0.12
    bent = driven_now.yaw_rate_rad_s[moving] / driven_now.speed_m_s[moving]
    assert np.median(bent) == pytest.approx(known.curvature_per_m(servo), rel=1e-6)
