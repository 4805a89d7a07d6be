from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from rendered_runs import arc, dark, session, stamps
from rosbags.highlevel import AnyReader

from capture import Session, SessionInfo
from capture.log_columns import LOST_COVARIANCE
from capture.log_writer import LogWriter
from capture.sensor_messages import image_message
from capture.topics import IMAGE_TYPE, ZED_LOG_NAME, ZED_TOPIC
from geometry import between
from simulation.stereo import zed_calibration
from slam.sources import odometry_of
from trackside.cli import trackside

POSES = arc(length_m=2.0)
LOST = slice(20, 36)


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with visual odometry, lost for a second on the way."""
    folder = tmp_path_factory.mktemp("vo") / "run"
    session(folder, POSES, dark(LOST.start, LOST.stop))
    done = call("vo", folder, "--format", "json")
    assert done.exit_code == 0, done.output
    (folder / "said.json").write_text(done.stdout)
    return folder


def test_the_table_tells_lost_stretches_and_the_drift(made: Path) -> None:
    rows = {
        row["visual odometry"]: row["value"]
        for row in json.loads((made / "said.json").read_text())["rows"]
    }
    assert rows["pictures"] == len(POSES)
    assert rows["lost stretches"] == 1
    assert rows["lost [s]"] == pytest.approx(18 / 15, abs=0.01)
    assert rows["drift [%]"] < 0.5
    assert abs(rows["heading is off [deg]"]) < 0.1
    assert rows["scale"] == pytest.approx(1.0, abs=0.005)


def test_the_session_has_a_source_more_and_the_other_logs_are_as_they_were(made: Path) -> None:
    recording = Session.open(made)
    assert recording.odometry_sources == ("viso",)
    told = recording.odometry("viso")
    lost = slice(LOST.start, LOST.stop + 1)
    np.testing.assert_array_equal(told.lost_t_ns, stamps(len(POSES))[lost])
    known = np.delete(np.arange(len(POSES)), lost)
    np.testing.assert_array_equal(told.t_ns, stamps(len(POSES))[known])
    after = known > LOST.stop
    true = between(POSES[known[after][0]], POSES[-1])
    assert (
        np.abs(between(told.pose_odom_base[after][0], told.pose_odom_base[-1]) - true).max() < 4e-3
    )
    speed = told.speed_m_s[1:-1]
    assert np.median(speed) == pytest.approx(0.6, abs=0.005)
    assert recording.stereo_count == len(POSES)
    assert [log.file.name for log in recording.logs] == ["car.mcap", "viso.mcap", "zed.mcap"]


def test_ros_tools_open_the_folder_and_see_the_covariance(made: Path) -> None:
    with AnyReader([made]) as reader:
        (connection,) = [one for one in reader.connections if one.topic == "/viso/odom"]
        messages = [
            reader.deserialize(data, connection.msgtype)
            for _, _, data in reader.messages([connection])
        ]
        assert {one.topic for one in reader.connections} >= {"/viso/odom", ZED_TOPIC}
    assert len(messages) == len(POSES)
    sigma = [message.pose.covariance.reshape(6, 6)[0, 0] ** 0.5 for message in messages]  # type: ignore[attr-defined]
    assert sigma[0] < sigma[10] < 0.01
    assert sigma[25] ** 2 == pytest.approx(LOST_COVARIANCE)
    assert messages[10].child_frame_id == "base_link"  # type: ignore[attr-defined]


def test_slam_bridges_the_lost_stretch(made: Path) -> None:
    recording = Session.open(made)
    bridged, report = odometry_of(recording, "viso")
    assert report.lost == 1
    end = between(POSES[0], POSES[-1])
    np.testing.assert_allclose(bridged.pose_odom_base[-1], end, atol=0.05)
    done = call("slam", made, "--odometry", "viso", "--name", "with_viso")
    assert done.exit_code == 0, done.output
    assert "the odometry was lost 1 times" in done.output
    path = recording.estimate("with_viso").path
    np.testing.assert_allclose(between(path.poses[0], path.poses[-1]), end, atol=0.05)


def test_what_is_there_is_kept_unless_replaced(made: Path, tmp_path: Path) -> None:
    again = call("vo", made)
    assert "give --replace" in str(again.exception)
    copy = tmp_path / "copy"
    shutil.copytree(made, copy)
    before = (copy / "viso.mcap").read_bytes()
    words = ["--set", "mounting.x_m=0.1", "--set", "key_frame_m=0.05", "--replace"]
    done = call("vo", copy, *words)
    assert done.exit_code == 0, done.output
    assert (copy / "viso.mcap").read_bytes() != before
    assert not list(copy.glob(".*partial*"))
    moved = Session.open(copy).odometry("viso").pose_odom_base
    assert np.abs(moved[15] - Session.open(made).odometry("viso").pose_odom_base[15]).max() > 0.01


def test_what_is_missing_is_told(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    with Session.create(empty, SessionInfo(map="turn")):
        pass
    assert "has no pictures of the stereo camera" in str(call("vo", empty).exception)
    bare = session(tmp_path / "bare", POSES[:2], calibrated=False)
    gone = call("vo", bare.folder, "--calibration", tmp_path / "nowhere")
    assert "trackside calibrate stereo makes one" in str(gone.exception)
    assert "no such key" in str(call("vo", *_calibrated(bare), "--set", "keyframe=1").exception)


def test_a_session_without_light_has_no_odometry(tmp_path: Path) -> None:
    night = session(tmp_path / "night", POSES[:6], dark(0, 6))
    error = str(call("vo", night.folder).exception)
    assert "none of 6 pictures tells a motion (too few points)" in error
    assert not (night.folder / "viso.mcap").exists()


def test_damaged_pictures_are_counted_and_left_out(tmp_path: Path) -> None:
    whole = session(tmp_path / "whole", POSES[:8])
    images = list(whole.stereo_images())
    (whole.folder / ZED_LOG_NAME).unlink()
    with LogWriter(whole.folder / ZED_LOG_NAME, sync_period_s=None) as log:
        for image in images:
            data = image.data[: len(image.data) // 2] if image.sequence == 3 else image.data
            message = image_message(image.t_ns, "zed_left", image.format, data)
            log.write(ZED_TOPIC, IMAGE_TYPE, message, log_t_ns=image.t_ns, stamp_ns=image.t_ns)
    done = call("vo", whole.folder, "--format", "json")
    assert done.exit_code == 0, done.output
    rows = {row["visual odometry"]: row["value"] for row in json.loads(done.stdout)["rows"]}
    assert (rows["damaged"], rows["pictures"], rows["lost stretches"]) == (1, 8, 0)
    assert Session.open(whole.folder).odometry("viso").t_ns.size == 7


def _calibrated(recording: Session) -> list[object]:
    from capture import write_calibration

    file = write_calibration(recording.folder.parent / "site", zed_calibration())
    return [recording.folder, "--calibration", file]
