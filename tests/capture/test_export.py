from __future__ import annotations

import csv
import errno
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from small_session import START_NS, estimate, make_session, observations, odometry, trajectory

from capture import (
    GroundTruth,
    LogError,
    MissingStreamError,
    Session,
    SessionError,
    SessionInfo,
    read_estimated_map,
    read_landmarks,
    read_planar_tum,
    stamp_to_ns,
)
from capture.export_bag import export_rosbag1, export_rosbag2
from capture.export_text import export_csv, export_tum
from capture.import_bag import import_bag
from capture.messages import header, serialised, typestore
from capture.topics import IMU_TOPIC, IMU_TYPE


@pytest.fixture
def session(tmp_path: Path) -> Session:
    made = make_session(tmp_path / "run", "wheel", "zed")
    made.write_estimate(estimate())
    return made


def columns(file: Path) -> dict[str, list[str]]:
    with file.open() as stream:
        rows = list(csv.DictReader(stream))
    return {name: [row[name] for row in rows] for name in rows[0]}


def test_paths_as_tum(session: Session, tmp_path: Path) -> None:
    names = export_tum(session, tmp_path / "out")
    assert sorted(names) == sorted(file.name for file in (tmp_path / "out").iterdir())
    assert set(names) == {
        "ground_truth.tum",
        "estimate_ekf.tum",
        "odometry_wheel.tum",
        "odometry_zed.tum",
    }
    truth, _ = read_planar_tum(tmp_path / "out" / "ground_truth.tum")
    np.testing.assert_array_equal(truth.poses, trajectory().poses)
    wheel, _ = read_planar_tum(tmp_path / "out" / "odometry_wheel.tum")
    np.testing.assert_array_equal(wheel.poses, odometry().pose_odom_base)


def test_streams_as_csv(session: Session, tmp_path: Path) -> None:
    names = export_csv(session, tmp_path / "out")
    assert set(names) == {
        "cones.csv",
        "estimate_ekf.csv",
        "ground_truth.csv",
        "map_ekf.csv",
        "observations.csv",
        "odometry_wheel.csv",
        "odometry_zed.csv",
    }
    wheel = columns(tmp_path / "out" / "odometry_wheel.csv")
    assert list(wheel) == ["t", "x_m", "y_m", "heading_rad", "speed_m_s", "yaw_rate_rad_s"]
    assert [stamp_to_ns(t) for t in wheel["t"]] == odometry().t_ns.tolist()
    assert [float(x) for x in wheel["x_m"]] == odometry().pose_odom_base[:, 0].tolist()
    seen = columns(tmp_path / "out" / "observations.csv")
    assert [int(each) for each in seen["landmark_id"]] == observations().landmark_id.tolist()
    assert len(read_landmarks(tmp_path / "out" / "cones.csv")) == 2
    assert len(read_estimated_map(tmp_path / "out" / "map_ekf.csv")) == 2


@pytest.mark.realdata
def test_telemetry_and_scans_as_csv(data_dir: Path, tmp_path: Path) -> None:
    (bag,) = (data_dir / "vesc").glob("*.bag")
    import_bag(bag, tmp_path / "vesc", {})
    assert export_csv(Session.open(tmp_path / "vesc"), tmp_path / "a") == ("vesc_state.csv",)
    state = columns(tmp_path / "a" / "vesc_state.csv")
    assert len(state["t"]) == 2244
    assert float(state["tachometer"][-1]) - float(state["tachometer"][0]) == -3246
    hokuyo = data_dir / "bags" / "hokuyo_circles.bag"
    import_bag(hokuyo, tmp_path / "lidar", {"scan": "/rear_scan"})
    assert export_csv(Session.open(tmp_path / "lidar"), tmp_path / "b") == ("scans.csv",)
    scans = columns(tmp_path / "b" / "scans.csv")
    assert len(scans["t"]) == 330 * 726
    assert (scans["range_m"][0], scans["intensity"][0]) == ("", "")


def test_inertia_as_csv(tmp_path: Path) -> None:
    types = typestore().types
    vector = types["geometry_msgs/msg/Vector3"]
    message = types[IMU_TYPE](
        header=header(START_NS, "imu"),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector(x=0.1, y=0.2, z=0.3),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(x=4.0, y=5.0, z=9.8),
        linear_acceleration_covariance=np.zeros(9),
    )
    with Session.create(tmp_path / "run", SessionInfo()) as writer:
        data = [serialised(message, IMU_TYPE)]
        writer.add_messages(IMU_TOPIC, IMU_TYPE, data, np.array([START_NS + 9]))
    assert export_csv(Session.open(tmp_path / "run"), tmp_path / "out") == ("imu.csv",)
    row = {name: each[0] for name, each in columns(tmp_path / "out" / "imu.csv").items()}
    assert row["t"] == "1700000000.123456789"
    assert row["angular_velocity_z_rad_s"] == "0.3"
    assert row["linear_acceleration_z_m_s2"] == "9.8"


@pytest.mark.parametrize("form", ["rosbag2", "rosbag1"])
def test_a_bag_holds_every_message_at_its_time(session: Session, tmp_path: Path, form: str) -> None:
    if form == "rosbag2":
        counts, bag = export_rosbag2(session, tmp_path / "out"), tmp_path / "out"
    else:
        counts, bag = export_rosbag1(session, tmp_path / "out.bag"), tmp_path / "out.bag"
    assert counts == {"/landmarks/observed": 3, "/wheel/odom": 50, "/zed/odom": 50}
    assert session.log is not None
    with AnyReader([bag]) as reader:
        for topic in counts:
            connections = [c for c in reader.connections if c.topic == topic]
            found = [
                (t, reader.deserialize(data, c.msgtype))
                for c, t, data in reader.messages(connections)
            ]
            assert [t for t, _ in found] == session.log.read(topic).log_t_ns.tolist()
            seconds = [message.header.stamp.sec for _, message in found]  # type: ignore[attr-defined]  # made at run time
            assert set(seconds) <= {START_NS // 10**9, START_NS // 10**9 + 1}
    assert not list(tmp_path.glob(".*"))


def test_a_ros1_bag_comes_back_as_it_went(session: Session, tmp_path: Path) -> None:
    export_rosbag1(session, tmp_path / "out.bag")
    import_bag(tmp_path / "out.bag", tmp_path / "back", {})
    back = Session.open(tmp_path / "back")
    assert session.log is not None
    assert back.log is not None
    for topic in session.log.topics:
        assert back.log.read(topic).messages == session.log.read(topic).messages


@pytest.mark.parametrize("export", [export_tum, export_csv, export_rosbag1, export_rosbag2])
def test_what_exists_is_kept(session: Session, tmp_path: Path, export: object) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").touch()
    assert callable(export)
    with pytest.raises(SessionError, match="out exists already"):
        export(session, tmp_path / "out")
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["mine"]


def test_there_must_be_something_to_export(tmp_path: Path) -> None:
    with Session.create(tmp_path / "run", SessionInfo()):
        pass
    session = Session.open(tmp_path / "run")
    with pytest.raises(MissingStreamError, match="neither truth nor estimate nor odometry"):
        export_tum(session, tmp_path / "out")
    with pytest.raises(MissingStreamError, match="nothing to export"):
        export_csv(session, tmp_path / "out")
    session.write_ground_truth(GroundTruth(trajectory()))
    with pytest.raises(MissingStreamError, match=r"has no log.*trackside export tum"):
        export_rosbag1(session, tmp_path / "out")
    assert sorted(child.name for child in tmp_path.iterdir()) == ["run"]


def test_a_full_disk_leaves_no_bag(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Writer, "write", full)
    with pytest.raises(LogError, match=r"cannot write .*out\.bag: No space left.*MB free"):
        export_rosbag1(session, tmp_path / "out.bag")
    assert [child.name for child in tmp_path.iterdir()] == ["run"]
