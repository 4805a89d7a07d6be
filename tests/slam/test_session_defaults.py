from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from recording import COUNTS_PER_M, WHEELBASE_M, driven, messages, stamps, write

from capture import Session
from capture.session_info import write_session_info
from slam.algorithms import Request, estimate_session
from slam.cli import slam
from slam.session_defaults import for_session

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
