from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from capture import (
    CalibrationFileError,
    MeasuredCalibration,
    Parameter,
    Session,
    SessionInfo,
    accepted_file,
    accepted_files,
    kind_of,
    read_measured_calibration,
    write_calibration,
)
from drivers.vesc import VescCalibration

RIG = {
    "speed_to_erpm_gain": 4614.0,
    "steering_angle_to_servo_gain": -1.2,
    "steering_angle_to_servo_offset": 0.53,
    "wheelbase_m": 0.325,
}
BELIEVED = VescCalibration(
    speed_to_erpm_gain=4614.0,
    steering_angle_to_servo_gain=-1.2,
    steering_angle_to_servo_offset=0.53,
    wheelbase_m=0.325,
)


def odometry(made_utc: str, gain: float, *, accepted: bool = True) -> MeasuredCalibration:
    values = {**RIG, "speed_to_erpm_gain": gain, "direction": -1.0, "low_speed_erpm": 500.0}
    return MeasuredCalibration(
        kind="odometry",
        made_utc=made_utc,
        accepted=accepted,
        parameters=tuple(Parameter(name, value, 0.01) for name, value in values.items()),
        covariance=((4.0, 0.0), (0.0, 1.0)),
    )


def session(folder: Path) -> Session:
    with Session.create(folder, SessionInfo(configuration={"rig": {"vesc_calibration": RIG}})):
        pass
    return Session.open(folder)


def test_a_measured_calibration_is_read_back_whole(tmp_path: Path) -> None:
    written = odometry("2026-05-14T10:15:30Z", 4000.0)
    file = write_calibration(tmp_path, written)
    assert file.name == "odometry_20260514T101530Z.yaml"
    assert kind_of(file) == "odometry"
    assert kind_of(tmp_path / "notes_1.yaml") is None
    back = read_measured_calibration(tmp_path, "odometry")
    assert back.parameters == written.parameters
    assert back.covariance == written.covariance
    assert back.value("wheelbase_m") == 0.325
    assert back.value("nothing") is None
    with pytest.raises(CalibrationFileError, match="trackside calibrate lidar"):
        read_measured_calibration(tmp_path, "lidar")


def test_the_newest_accepted_one_goes_before_the_words_of_the_rig(tmp_path: Path) -> None:
    recorded = session(tmp_path / "run")
    assert recorded.motor_calibration() == BELIEVED
    folder = tmp_path / "calibration"
    write_calibration(folder, odometry("2026-05-14T10:00:00Z", 4100.0))
    newest = write_calibration(folder, odometry("2026-05-15T10:00:00Z", 4200.0))
    write_calibration(folder, odometry("2026-05-16T10:00:00Z", 9999.0, accepted=False))
    assert accepted_file(folder, "odometry") == newest
    assert accepted_files(folder) == (newest,)
    copied = recorded.adopt_calibrations(accepted_files(folder))
    assert [file.name for file in copied] == [newest.name]
    assert recorded.adopt_calibrations(accepted_files(folder)) == ()
    known = recorded.motor_calibration()
    assert known is not None
    assert known.speed_to_erpm_gain == 4200.0
    assert known.direction == -1
    assert known.low_speed_erpm == 500.0
    assert recorded.recorded_motor_calibration() == BELIEVED
    assert recorded.measured("lidar") == {}


def test_a_session_that_got_a_rejected_one_keeps_to_its_rig(tmp_path: Path) -> None:
    recorded = session(tmp_path / "run")
    bad = odometry("2026-05-16T10:00:00Z", 9999.0, accepted=False)
    recorded.copy_calibration(write_calibration(tmp_path, bad))
    assert recorded.calibration_in_force("odometry") is None
    assert recorded.motor_calibration() == BELIEVED


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "imu_20260514T101530Z.yaml").write_text("kind: imu\n")
    with pytest.raises(CalibrationFileError, match="is no imu calibration that we can read"):
        accepted_files(tmp_path)
    with pytest.raises(ValueError, match="2 numbers"):
        replace(odometry("2026-05-16T10:00:00Z", 1.0), covariance=((1.0,), (2.0,)))
