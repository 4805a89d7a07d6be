from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from small_session import odometry

from capture import Odometry, Session, SessionError, SessionInfo, UncertainOdometry


def told(source: str = "viso", n: int = 5, lost: tuple[int, ...] = ()) -> UncertainOdometry:
    made = odometry(n=n)
    late = made.t_ns[-1] + 1 + np.arange(len(lost), dtype=np.int64)
    own = Odometry(
        source, made.t_ns, made.pose_odom_base, made.speed_m_s, made.yaw_rate_rad_s, late
    )
    covariance = np.arange(1.0, n + 1.0)[:, None, None] * np.diag([1.0, 2.0, 3.0])
    return UncertainOdometry(own, covariance, 10.0 * covariance)


@pytest.fixture
def session(tmp_path: Path) -> Session:
    with Session.create(tmp_path / "run", SessionInfo(map="turn")) as writer:
        writer.add_odometry(replace(odometry(n=4), source="vesc"))
    return Session.open(tmp_path / "run")


def test_it_stands_in_a_log_of_its_own_beside_the_cars(session: Session) -> None:
    car = (session.folder / "car.mcap").read_bytes()
    file = session.add_odometry(told(lost=(1, 2)))
    assert file == session.folder / "viso.mcap"
    assert session.odometry_sources == ("vesc", "viso")
    assert (session.folder / "car.mcap").read_bytes() == car
    opened = Session.open(session.folder)
    assert opened.odometry_sources == ("vesc", "viso")
    assert opened.odometry().source == "vesc"
    got, given = opened.odometry("viso"), told(lost=(1, 2)).odometry
    np.testing.assert_array_equal(got.t_ns, given.t_ns)
    np.testing.assert_allclose(got.pose_odom_base, given.pose_odom_base, atol=1e-12)
    np.testing.assert_array_equal(got.lost_t_ns, given.lost_t_ns)
    assert opened.deciding_files == (session.folder / "car.mcap", file)


def test_ros_tools_see_both_logs_and_the_covariances(session: Session) -> None:
    session.add_odometry(told())
    with AnyReader([session.folder]) as reader:
        assert {one.topic for one in reader.connections} == {"/vesc/odom", "/viso/odom"}
        found = [one for one in reader.connections if one.topic == "/viso/odom"]
        *_, last = (reader.deserialize(d, found[0].msgtype) for _, _, d in reader.messages(found))
    covariance = last.pose.covariance.reshape(6, 6)  # type: ignore[attr-defined]
    np.testing.assert_allclose(covariance[[0, 1, 5], [0, 1, 5]], [5.0, 10.0, 15.0])
    assert last.twist.covariance[0] == pytest.approx(50.0)  # type: ignore[attr-defined]


def test_it_is_replaced_only_when_asked(session: Session) -> None:
    session.add_odometry(told(n=5))
    with pytest.raises(SessionError, match="give --replace"):
        session.add_odometry(told(n=3))
    assert Session.open(session.folder).odometry("viso").t_ns.size == 5
    session.add_odometry(told(n=3), replace=True)
    assert Session.open(session.folder).odometry("viso").t_ns.size == 3
    bag = yaml.safe_load((session.folder / "metadata.yaml").read_text())
    counts = bag["rosbag2_bagfile_information"]["topics_with_message_count"]
    assert {one["topic_metadata"]["name"]: one["message_count"] for one in counts} == {
        "/vesc/odom": 4, "/viso/odom": 3,
    }  # fmt: skip


def test_what_the_recording_itself_holds_is_never_hidden(session: Session) -> None:
    with pytest.raises(SessionError, match="its recording has /vesc/odom already"):
        session.add_odometry(told("vesc"), replace=True)
    assert not (session.folder / "vesc.mcap").exists()


def test_a_disk_that_takes_nothing_leaves_nothing(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("mcap.writer.Writer.add_message", refused)
    with pytest.raises(Exception, match="cannot write"):
        session.add_odometry(told())
    assert sorted(file.name for file in session.folder.iterdir()) == [
        "car.mcap", "metadata.yaml", "session.yaml",
    ]  # fmt: skip


def test_a_session_that_was_broken_off_gets_no_half_a_list(session: Session) -> None:
    """`trackside recover` writes metadata.yaml, of all logs, once it has finished them."""
    (session.folder / "metadata.yaml").unlink()
    session.add_odometry(told())
    assert not (session.folder / "metadata.yaml").exists()
    assert Session.open(session.folder).odometry("viso").t_ns.size == 5


def test_a_broken_film_does_not_hide_the_odometry(session: Session) -> None:
    session.add_odometry(told())
    (session.folder / "overhead.mcap").write_bytes(b"no log")
    assert Session.open(session.folder).odometry_sources == ("vesc", "viso")
    assert Session.open(session.folder).odometry("viso").t_ns.size == 5
