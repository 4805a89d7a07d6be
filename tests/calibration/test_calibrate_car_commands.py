"""The whole road of the car's calibrations through the real commands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from click.testing import CliRunner, Result
from figures_drive import FIGURES, Truth, write_imu_session, write_session
from test_imu_calibration import by_hand, lying, sphere

from capture import Session, read_measured_calibration, write_calibration
from slam.algorithms import Request
from slam.session_defaults import for_session
from trackside.cli import trackside

TRUTH = Truth(lever=(0.01, 0.0, 0.01))


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive with everything, and a folder with calibrations made of it."""
    folder = tmp_path_factory.mktemp("site")
    write_session(folder / "figures", FIGURES, scans=True)
    write_session(folder / "rings", FIGURES, TRUTH)
    output = ("-o", folder / "calibration")
    done = call("calibrate", "odometry", folder / "figures", "--wheelbase", "26cm", *output)
    assert done.exit_code == 0, done.output
    assert "vesc_calibration:\n  speed_to_erpm_gain: 44" in done.output
    assert "the tape measure" in done.output
    done = call("calibrate", "markers", folder / "rings", *output)
    assert done.exit_code == 0, done.output
    assert "car: {front_x_m: 0.24" in done.output
    done = call("calibrate", "lidar", folder / "figures", *output)
    assert done.exit_code == 0, done.output
    done = call("calibrate", "imu", folder / "figures", *output)
    assert done.exit_code == 0, done.output
    assert "gyro_scale" in done.output
    return folder


def test_every_calibration_is_a_file_with_a_picture(site: Path) -> None:
    for kind in ("odometry", "markers", "lidar", "imu"):
        calibration = read_measured_calibration(site / "calibration", kind)
        assert calibration.accepted
        assert calibration.how["sessions"] in (["figures"], ["rings"])
    pictures = list((site / "calibration").glob("*.png"))
    assert len(pictures) == 4
    for picture in pictures:
        assert cv2.imread(str(picture)) is not None


def test_show_tells_what_is_in_force_before_and_after_apply(site: Path) -> None:
    session = write_session(site / "other", FIGURES[:2])
    before = call("calibrate", "show", session.folder)
    assert "nothing to show" in str(before.exception)
    assert "by the rig in" in before.output
    assert "4614" in before.output
    applied = call("calibrate", "apply", session.folder, "--calibration", site / "calibration")
    assert applied.exit_code == 0, applied.output
    assert "odometry_" in applied.output
    again = call("calibrate", "apply", session.folder, "--calibration", site / "calibration")
    assert "nothing: it has them all" in again.output
    assert len(Session.open(session.folder).calibrations) == 4
    for place in (session.folder, site / "calibration"):
        shown = call("calibrate", "show", place)
        assert shown.exit_code == 0, shown.output
        for kind in ("odometry", "markers", "lidar", "imu"):
            assert f"{kind}_20" in shown.output
    file = next((site / "calibration").glob("lidar_*.yaml"))
    alone = call("calibrate", "show", file, "--format", "json")
    assert '"x_m"' in alone.output
    assert "odometry" not in alone.output
    assert "is no calibration" in str(
        call("calibrate", "show", session.folder / "session.yaml").exception
    )


def test_slam_of_the_session_takes_them(site: Path) -> None:
    session = write_session(site / "taken", FIGURES[:2], scans=True)
    call("calibrate", "apply", session.folder, "--calibration", site / "calibration")
    request = for_session(Request(), session)
    assert request.cone_config().mounting.x_m == pytest.approx(0.13, abs=3e-3)
    assert request.source_config().gyro_scale == pytest.approx(Truth().gyro_scale, abs=2e-3)
    assert request.source_config().wheelbase_m == pytest.approx(0.26, abs=1e-3)


def test_a_refusal_says_what_to_drive_and_writes_nothing(tmp_path: Path) -> None:
    session = write_session(tmp_path / "line", ((9.0, 0.0, 0.8),))
    done = call("calibrate", "odometry", session.folder, "-o", tmp_path / "calibration")
    assert done.exit_code == 1
    assert "drive a full circle" in str(done.exception)
    assert not (tmp_path / "calibration").exists()
    nothing = call("calibrate", "apply", session.folder, "--calibration", tmp_path / "calibration")
    assert "holds no accepted calibration" in str(nothing.exception)


def test_a_rejection_is_written_and_ends_with_1(site: Path, tmp_path: Path) -> None:
    done = call("calibrate", "odometry", site / "figures", "-o", tmp_path / "calibration")
    assert done.exit_code == 1
    assert "rejected\n" in done.output
    assert "give --wheelbase" in done.output
    made = tmp_path / "calibration"
    assert not read_measured_calibration(made, "odometry").accepted
    older = read_measured_calibration(site / "calibration", "odometry")
    before = write_calibration(made, replace(older, made_utc="2020-01-01T00:00:00Z"))
    shown = call("calibrate", "show", made)
    assert f"was rejected; a session takes {before.name}" in shown.output


def test_an_imu_by_hand_with_its_compass_and_from_a_csv(tmp_path: Path) -> None:
    imu = by_hand(5.0, 1.02)
    session = write_imu_session(tmp_path / "bench", imu, sphere(imu.t_ns.size))
    done = call("calibrate", "imu", session.folder, "--turns", "5", "-o", tmp_path / "calibration")
    assert done.exit_code == 0, done.output
    found = read_measured_calibration(tmp_path / "calibration", "imu")
    assert found.value("gyro_scale") == pytest.approx(1.02, abs=0.01)
    assert found.value("mag_field_t") == pytest.approx(48e-6, rel=0.01)
    call(
        "export",
        "csv",
        write_imu_session(tmp_path / "rest", lying(20.0)).folder,
        "-o",
        tmp_path / "csv",
    )
    done = call("calibrate", "imu", tmp_path / "csv" / "imu.csv", "-o", tmp_path / "second")
    assert done.exit_code == 0, done.output
    both = call("calibrate", "imu", session.folder, "--turns", "5", "--truth", session.folder)
    assert "not both" in str(both.exception)
    assert "0 tells no scale" in str(
        call("calibrate", "imu", session.folder, "--turns", 0).exception
    )


def test_help_of_the_group_names_every_command_and_a_mistyped_one_its_nearest() -> None:
    told = call("calibrate", "--help").output
    for name in ("camera", "world", "verify", "markers", "odometry", "imu", "lidar", "apply"):
        assert f"  {name} " in told
        assert call("calibrate", name, "--help").exit_code == 0
    wrong = call("calibrate", "odometri")
    assert wrong.exit_code == 2
    assert "odometry" in wrong.output
