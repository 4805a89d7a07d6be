"""Odometry of other people's bags: ZED and libviso2 topics, and the tachometer of a real VESC."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer

from capture import Odometry, Session
from capture.import_bag import import_bag
from capture.log_columns import LOST_COVARIANCE
from capture.messages import odometry_messages, serialised, typestore
from capture.topics import ODOMETRY_TYPE
from geometry import between
from slam.sources import SourceConfig, counted_odometry, odometry_of

PERIOD_NS, N, SPEED = 50_000_000, 200, 0.8
START_NS = 1_700_000_000_000_000_000
LOST = slice(100, 120)


def straight(lost: slice = slice(0)) -> Odometry:
    """A car that stands for two seconds, then drives; while it is lost its told pose stands."""
    moving = np.arange(N) >= 40
    told = moving.copy()
    told[lost] = False
    speed = np.where(told, SPEED, 0.0)
    pose = np.zeros((N, 3))
    pose[:, 0] = np.cumsum(speed * (PERIOD_NS * 1e-9))
    t_ns = START_NS + np.arange(N) * PERIOD_NS
    return Odometry("x", t_ns, pose, speed, np.zeros(N))


def marked_lost(data: bytes) -> bytes:
    message: Any = typestore().deserialize_cdr(data, ODOMETRY_TYPE)
    bad = (np.eye(6) * LOST_COVARIANCE).reshape(-1)
    pose, twist = replace(message.pose, covariance=bad), replace(message.twist, covariance=bad)
    return serialised(replace(message, pose=pose, twist=twist), ODOMETRY_TYPE)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """From a ROS 1 bag of a ZED and of libviso2, which is lost for a second."""
    folder = tmp_path_factory.mktemp("imported")
    viso = odometry_messages(straight(LOST))
    viso[LOST] = [marked_lost(data) for data in viso[LOST]]
    topics = {
        "/zed2/zed_node/odom": odometry_messages(straight()),
        "/stereo_odometer/odometry": viso,
    }
    with Writer(folder / "a.bag") as bag:
        for topic, messages in topics.items():
            connection = bag.add_connection(topic, ODOMETRY_TYPE, typestore=typestore(ros=1))
            for k, data in enumerate(messages):
                ros1 = typestore().cdr_to_ros1(data, ODOMETRY_TYPE)
                bag.write(connection, START_NS + k * PERIOD_NS, ros1)
    import_bag(folder / "a.bag", folder / "run", {})
    return Session.open(folder / "run")


def test_both_are_found_by_their_names(session: Session) -> None:
    assert session.odometry_sources == ("zed", "viso")
    assert odometry_of(session, None)[0].source == "zed"


def test_a_lost_viso_is_a_gap_and_no_standstill(session: Session) -> None:
    whole, _ = odometry_of(session, "zed")
    found, report = odometry_of(session, "viso")
    assert found.t_ns.size == N - 20
    assert (report.lost, report.source_gaps) == (1, 1)
    assert report.lost_s == pytest.approx(21 * 0.05)
    assert "lost 1 times (1.1 s)" in str(report)
    assert report.remarkable
    # 0.8 m were driven meanwhile; without the mark they would be missing for good.
    missing = whole.pose_odom_base[-1, 0] - straight(LOST).pose_odom_base[-1, 0]
    assert missing == pytest.approx(0.8)
    rows = np.searchsorted(whole.t_ns, found.t_ns)
    np.testing.assert_allclose(found.pose_odom_base, whole.pose_odom_base[rows], atol=1e-9)


@pytest.mark.parametrize("source", ["zed", "viso"])
def test_a_car_that_stands_does_not_move_at_all(session: Session, source: str) -> None:
    found, _ = odometry_of(session, source)
    moved = between(found.pose_odom_base[:-1], found.pose_odom_base[1:])
    assert not moved[:39].any()
    assert moved[40:].any(axis=1).all()


@pytest.mark.realdata
def test_the_tachometer_of_a_real_car(data_dir: Path, tmp_path: Path) -> None:
    """-3246 counts in 45 s; no step of them is a reset."""
    (bag,) = sorted((data_dir / "vesc").glob("*.bag"))
    import_bag(bag, tmp_path / "run", {})
    state = Session.open(tmp_path / "run").vesc_state()
    # Six counts per electrical turn, two pole pairs, a gear of 10 and wheels of 0.1 m.
    config = SourceConfig(metres_per_count=-np.pi * 0.1 / (6 * 2 * 10))
    counted, resets = counted_odometry(state, config)
    assert resets == 0
    assert counted.pose_odom_base[-1, 0] == pytest.approx(3246 * np.pi * 0.1 / 120)
    # ERPM counts electrical turns a minute, the tachometer six counts for each of them.
    turns = np.trapezoid(state.speed_erpm, (state.t_ns - state.t_ns[0]) * 1e-9) / 60.0
    assert -3246 / turns == pytest.approx(6.0, rel=2e-3)
