from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from small_session import PERIOD_NS, START_NS, make_session, odometry

from capture import LogError, Session
from capture.bag_reader import BagTopic
from capture.bag_roles import assigned_roles
from capture.import_bag import import_bag
from capture.messages import header, odometry_messages, serialised, typestore
from capture.topics import (
    IMU_TYPE,
    ODOMETRY_TYPE,
    POINTS_TYPE,
    POSE_TYPE,
    SCAN_TYPE,
    VESC_STATE_TYPE,
)
from dialogue import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

LOG_DELAY_NS = 3_000_000
OTHER = "std_msgs/msg/String"


def poses(heights_m: Sequence[float]) -> list[bytes]:
    types = typestore().types
    made = []
    for number, height in enumerate(heights_m):
        pose = types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=float(number), y=0.5, z=height),
            orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.6, w=0.8),
        )
        stamped = types[POSE_TYPE](header=header(START_NS + PERIOD_NS * number, "map"), pose=pose)
        made.append(serialised(stamped, POSE_TYPE))
    return made


def content(heights_m: Sequence[float] = (0.1, 0.1, 0.1)) -> list[tuple[str, str, list[bytes]]]:
    """Topics of a car that is not ours."""
    word = serialised(typestore().types[OTHER](data="hello"), OTHER)
    return [
        ("/vesc/odom", ODOMETRY_TYPE, odometry_messages(odometry(n=3))),
        ("/camera/odom/sample", ODOMETRY_TYPE, odometry_messages(odometry(n=2))),
        ("/vicon/car", POSE_TYPE, poses(heights_m)),
        ("/chatter", OTHER, [word]),
    ]


def ros1_bag(path: Path, topics: list[tuple[str, str, list[bytes]]]) -> Path:
    with Writer1(path) as bag:
        for topic, kind, messages in topics:
            connection = bag.add_connection(topic, kind, typestore=typestore(ros=1))
            for k, data in enumerate(messages):
                t_ns = START_NS + PERIOD_NS * k + LOG_DELAY_NS
                bag.write(connection, t_ns, typestore().cdr_to_ros1(data, kind))
    return path


def ros2_bag(
    path: Path, topics: list[tuple[str, str, list[bytes]]], storage: StoragePlugin
) -> Path:
    with Writer2(path, version=8, storage_plugin=storage) as bag:
        for topic, kind, messages in topics:
            connection = bag.add_connection(topic, kind, typestore=typestore())
            for k, data in enumerate(messages):
                bag.write(connection, START_NS + PERIOD_NS * k + LOG_DELAY_NS, data)
    return path


@pytest.mark.parametrize("form", ["bag", "db3", "mcap", "db3 file", "mcap file"])
def test_every_form_of_bag_makes_the_same_session(tmp_path: Path, form: str) -> None:
    if form == "bag":
        path = ros1_bag(tmp_path / "a.bag", content())
    else:
        storage = StoragePlugin.MCAP if "mcap" in form else StoragePlugin.SQLITE3
        path = ros2_bag(tmp_path / "a", content(), storage)
        path = next(path.glob(f"*.{form.split()[0]}")) if form.endswith("file") else path
    report = import_bag(path, tmp_path / "run", {})
    assert [(t.role, t.topic, t.target, t.count) for t in report.taken] == [
        ("camera_odom_sample", "/camera/odom/sample", "/camera_odom_sample/odom", 2),
        ("vesc", "/vesc/odom", "/vesc/odom", 3),
        ("truth", "/vicon/car", "ground_truth/car.tum", 3),
    ]
    assert report.taken[1].rate_hz == pytest.approx(50.0)
    assert report.left_out == (BagTopic("/chatter", OTHER, 1),)
    session = Session.open(tmp_path / "run")
    assert session.log is not None
    raw = session.log.read("/vesc/odom")
    assert raw.messages == odometry_messages(odometry(n=3))
    assert (raw.log_t_ns - odometry(n=3).t_ns).tolist() == [LOG_DELAY_NS] * 3
    assert session.odometry().source == "vesc"
    truth = session.ground_truth().path
    assert truth.x.tolist() == [0, 1, 2]
    np.testing.assert_allclose(truth.heading, 2 * np.arctan2(0.6, 0.8))
    assert session.info.origin["left_out"] == {"/chatter": 1}


def test_truth_that_leaves_the_plane_is_refused_whole(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path / "a.bag", content(heights_m=(0.0, 0.5)))
    with pytest.raises(LogError, match=r"/vicon/car: the path leaves the plane.*truth=none"):
        import_bag(path, tmp_path / "run", {})
    assert [child.name for child in tmp_path.iterdir()] == ["a.bag"]
    report = import_bag(path, tmp_path / "run", {"truth": "none"})
    assert [topic.name for topic in report.left_out] == ["/chatter", "/vicon/car"]


def test_odometry_may_be_the_truth(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path / "a.bag", content())
    import_bag(path, tmp_path / "run", {"truth": "/vesc/odom"})
    session = Session.open(tmp_path / "run")
    np.testing.assert_allclose(
        session.ground_truth().path.poses, odometry(n=3).pose_odom_base, atol=1e-12
    )


def test_a_log_without_its_end_is_taken_with_a_remark(tmp_path: Path) -> None:
    log = make_session(tmp_path / "other").folder / "car.mcap"
    (tmp_path / "cut.mcap").write_bytes(log.read_bytes()[:-300])
    report = import_bag(tmp_path / "cut.mcap", tmp_path / "run", {})
    assert "cut.mcap has no end" in report.remarks[0]
    assert Session.open(tmp_path / "run").odometry().t_ns.size == 50


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.bag", b"", r"a\.bag: cannot be read as a bag: .*expected a ROS 1 \.bag"),
        ("a.bag", b"#ROSBAG V2.0\n" + bytes(50), r"a\.bag: cannot be read as a bag"),
        ("a.db3", b"junk", r"a\.db3: cannot be read as a bag"),
        ("a.mcap", b"junk", r"a\.mcap: is no MCAP file; expected an MCAP log; restore"),
        ("a.txt", b"junk", r"a\.txt: cannot be read as a bag: .*expected a ROS 1"),
    ],
)
def test_what_is_no_bag_is_refused(tmp_path: Path, name: str, data: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(LogError, match=message):
        import_bag(tmp_path / name, tmp_path / "run", {})
    assert [child.name for child in tmp_path.iterdir()] == [name]


def test_a_truncated_ros1_bag_says_what_to_do(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path / "a.bag", content())
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(LogError, match=r"a\.bag: cannot be read as a bag: .*rosbag reindex"):
        import_bag(path, tmp_path / "run", {})


def test_a_folder_without_metadata_points_to_its_log(tmp_path: Path) -> None:
    folder = ros2_bag(tmp_path / "a", content(), StoragePlugin.MCAP)
    (folder / "metadata.yaml").unlink()
    with pytest.raises(LogError, match=r"has no metadata\.yaml.* give the log itself: .*\.mcap"):
        import_bag(folder, tmp_path / "run", {})
    with pytest.raises(LogError, match="no such file or folder"):
        import_bag(tmp_path / "absent", tmp_path / "run", {})


def test_a_foreign_channel_is_named(tmp_path: Path) -> None:
    folder = ros2_bag(tmp_path / "a", content(), StoragePlugin.MCAP)
    (log,) = folder.glob("*.mcap")
    with log.open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("settings", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/settings", "json", schema), 1, b"{}", 1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it untyped
    for path in (folder, log):
        with pytest.raises(LogError, match="channel /settings is encoded as json with schema jso"):
            import_bag(path, tmp_path / "run", {})


def test_a_bag_without_anything_for_us(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path / "a.bag", content()[-1:])
    with pytest.raises(LogError, match=r"no stream that trackside knows.*/chatter \(std_msgs"):
        import_bag(path, tmp_path / "run", {})


def roles(names: dict[str, str], wishes: dict[str, str] | None = None) -> dict[str, str]:
    topics = [BagTopic(name, kind, 5) for name, kind in sorted(names.items())]
    return {role.topic.name: role.name for role in assigned_roles(topics, wishes or {})}


@pytest.mark.parametrize(
    ("topic", "kind", "role"),
    [
        ("/lidar/scan", SCAN_TYPE, "scan"),
        ("/sensors/imu/raw", IMU_TYPE, "imu"),
        ("/sensors/core", VESC_STATE_TYPE, "vesc_state"),
        ("/vesc/odom", ODOMETRY_TYPE, "vesc"),
        ("/zed2/zed_node/odom", ODOMETRY_TYPE, "zed"),
        ("/stereo_odometer/odometry", ODOMETRY_TYPE, "viso"),
        ("/odom", ODOMETRY_TYPE, "odom"),
        ("/pf/pose/odom", ODOMETRY_TYPE, "pf_pose"),
        ("/ground_truth/state", ODOMETRY_TYPE, "truth"),
        ("/vicon/car/pose", POSE_TYPE, "truth"),
    ],
)
def test_roles_follow_from_type_and_name(topic: str, kind: str, role: str) -> None:
    assert roles({topic: kind, "/other": OTHER}) == {topic: role}


def test_a_cloud_is_taken_from_its_own_topic_or_when_asked_for() -> None:
    clouds = {"/lidar/points": POINTS_TYPE, "/zed2/point_cloud/cloud_registered": POINTS_TYPE}
    assert roles(clouds) == {"/lidar/points": "points"}
    assert roles(clouds, {"points": "none"}) == {}
    wish = {"points": "/zed2/point_cloud/cloud_registered"}
    assert roles(clouds, wish) == {"/zed2/point_cloud/cloud_registered": "points"}


def test_a_pose_is_truth_only_when_it_is_called_so() -> None:
    assert roles({"/pf/pose": POSE_TYPE}) == {}
    assert roles({"/pf/pose": POSE_TYPE}, {"truth": "/pf/pose"}) == {"/pf/pose": "truth"}


def test_ambiguity_is_told_with_its_remedy() -> None:
    two = {
        "/front": SCAN_TYPE,
        "/rear": SCAN_TYPE,
        "/zed/odom": ODOMETRY_TYPE,
        "/zed2": ODOMETRY_TYPE,
    }
    with pytest.raises(UsageError) as caught:
        roles(two)
    assert str(caught.value).splitlines() == [
        "2 topics could be scan: /front, /rear; choose one with --topic scan=/front (or scan=none)",
        "2 topics could be zed: /zed/odom, /zed2; choose one with --topic zed=/zed/odom "
        "(or zed=none)",
    ]
    chosen = roles(two, {"scan": "/rear", "zed": "/zed2", "spare": "/zed/odom"})
    assert chosen == {"/rear": "scan", "/zed2": "zed", "/zed/odom": "spare"}
    assert roles(two, {"scan": "none", "zed": "none"}) == {}


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        ({"scan": "/frnt"}, r"--topic scan=/frnt: no such topic; did you mean '/front'"),
        ({"imu": "/front"}, r"--topic imu=/front: the topic is .*LaserScan, expected .*Imu; roles"),
        ({"vesc": "/front"}, r"expected nav_msgs/msg/Odometry; .*name of an odometry source"),
    ],
)
def test_a_wish_that_cannot_be_met(wish: dict[str, str], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        roles({"/front": SCAN_TYPE}, wish)


@pytest.mark.realdata
def test_the_vesc_bag_of_a_real_car(data_dir: Path, tmp_path: Path) -> None:
    (path,) = (data_dir / "vesc").glob("*.bag")
    report = import_bag(path, tmp_path / "run", {})
    assert [(t.role, t.count) for t in report.taken] == [("vesc_state", 2244)]
    assert report.taken[0].rate_hz == pytest.approx(50.0, abs=0.05)
    assert [(t.name, t.count) for t in report.left_out] == [
        ("/sensors/servo_position_command", 879)
    ]
    state = Session.open(tmp_path / "run").vesc_state()
    t_s = (state.t_ns - state.t_ns[0]) * 1e-9
    middle = (state.speed_erpm[1:] + state.speed_erpm[:-1]) / 2
    turns = np.sum(middle * np.diff(t_s)) / 60
    assert state.tachometer[-1] - state.tachometer[0] == -3246
    assert -3246 / turns == pytest.approx(6.0, abs=0.01)
    assert state.voltage_v[0] == 11.7


@pytest.mark.realdata
def test_telemetry_keeps_its_form(data_dir: Path, tmp_path: Path) -> None:
    (path,) = (data_dir / "vesc").glob("*.bag")
    import_bag(path, tmp_path / "run", {})
    import_bag(tmp_path / "run" / "car.mcap", tmp_path / "again", {})
    first, second = Session.open(tmp_path / "run").log, Session.open(tmp_path / "again").log
    assert first is not None
    assert second is not None
    topic = "/vesc/state"
    assert second.read(topic).messages == first.read(topic).messages


@pytest.mark.realdata
def test_two_lidars_of_a_real_robot(data_dir: Path, tmp_path: Path) -> None:
    path = data_dir / "bags" / "hokuyo_circles.bag"
    with pytest.raises(UsageError, match=r"2 topics could be scan: /front_scan, /rear_scan"):
        import_bag(path, tmp_path / "run", {})
    import_bag(path, tmp_path / "run", {"scan": "/front_scan"})
    scans = Session.open(tmp_path / "run").scans()
    assert scans.t_ns.size == 331
    assert set(np.diff(scans.starts).tolist()) == {726}
