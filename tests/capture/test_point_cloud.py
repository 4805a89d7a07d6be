"""Lidar revolutions with the time of every beam: `capture.point_cloud`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore
from small_session import START_NS

from capture import LogError, Session, SessionInfo, point_cloud_message
from capture.log_reader import RawMessages
from capture.messages import header, serialised, typestore
from capture.point_cloud import POINT, point_cloud_columns
from capture.topics import POINTS_TYPE, SCAN_TYPE
from geometry import Floats, Stamps

NAMES = ("x", "y", "z", "intensity", "range", "angle", "t")


def revolution(n: int = 5, seed: int = 0) -> tuple[Stamps, Floats, Floats, Floats]:
    """Beam times, ranges (the second without echo), bearings, intensities; all float32 numbers."""
    random = np.random.default_rng(seed)
    t_ns = START_NS + np.sort(random.integers(0, 2**32, n))
    if n:
        t_ns -= t_ns[0] - START_NS
    columns = random.uniform(0.1, 3.0, (3, n)).astype(np.float32).astype(np.float64)
    columns[0, 1:2] = np.nan
    return t_ns, columns[0], columns[1], columns[2]


def raw(*messages: bytes) -> RawMessages:
    return RawMessages("/lidar/points", 7 + np.arange(len(messages)), list(messages))


@given(sizes=st.lists(st.integers(0, 9), min_size=1, max_size=5), frame=st.text("ab_", max_size=6))
def test_what_is_written_is_read(sizes: list[int], frame: str) -> None:
    made = [revolution(n, seed) for seed, n in enumerate(sizes)]
    starts = [START_NS + k for k in range(len(made))]
    messages = [
        point_cloud_message(start, t + k, r, b, i, frame)
        for k, (start, (t, r, b, i)) in enumerate(zip(starts, made, strict=True))
    ]
    found = point_cloud_columns(raw(*messages))
    assert found.t_ns.tolist() == starts
    assert np.diff(found.starts).tolist() == sizes
    for name, column, shift in (
        ("beam_t_ns", 0, 1),
        ("range_m", 1, 0),
        ("bearing_rad", 2, 0),
        ("intensity", 3, 0),
    ):
        expected = np.concatenate([part[column] + shift * k for k, part in enumerate(made)])
        np.testing.assert_array_equal(getattr(found, name), expected, err_msg=name)


def decoded(message: bytes) -> Any:
    """By rosbags, which makes its message classes as it runs."""
    return get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(message, POINTS_TYPE)


def test_rosbags_reads_the_same_numbers() -> None:
    t_ns, range_m, bearing, intensity = revolution()
    message = point_cloud_message(START_NS, t_ns, range_m, bearing, intensity)
    cloud = decoded(message)
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (1, 5, 28, 140)
    assert (cloud.is_bigendian, cloud.is_dense, cloud.header.frame_id) == (False, False, "lidar")
    assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
        (name, 4 * k, 6 if name == "t" else 7, 1) for k, name in enumerate(NAMES)
    ]
    points = np.frombuffer(cloud.data.tobytes(), POINT)
    assert POINT.names == NAMES
    assert points["t"].tolist() == (t_ns - START_NS).tolist()
    np.testing.assert_allclose(points["x"], range_m * np.cos(bearing), atol=1e-6)
    np.testing.assert_allclose(points["y"], range_m * np.sin(bearing), atol=1e-6)
    assert np.isnan(points["range"]).tolist() == [False, True, False, False, False]
    assert np.isnan(points["x"]).tolist() == np.isnan(points["range"]).tolist()
    full = point_cloud_message(START_NS, t_ns[:1], range_m[:1], bearing[:1], intensity[:1])
    assert decoded(full).is_dense


@pytest.mark.parametrize("offset_ns", [-1, 2**32])
def test_a_beam_outside_the_reach_of_its_stamp_is_refused(offset_ns: int) -> None:
    one = np.ones(1)
    with pytest.raises(ValueError, match="the stamp is that of the first beam"):
        point_cloud_message(START_NS, np.array([START_NS + offset_ns]), one, one, one)


def test_revolutions_come_in_order_each_once_and_an_empty_stamp_is_the_log_time() -> None:
    times = [START_NS + 5, START_NS, START_NS + 5]
    one = np.ones(1)
    messages = [
        point_cloud_message(t, np.array([t]), one * k, one, one) for k, t in enumerate(times)
    ]
    unstamped = point_cloud_message(0, np.array([4]), one * 9, one, one)
    found = point_cloud_columns(raw(*messages, unstamped))
    assert found.t_ns.tolist() == [10, START_NS, START_NS + 5]
    assert found.range_m.tolist() == [9.0, 1.0, 0.0]
    assert found.beam_t_ns.tolist() == [14, START_NS, START_NS + 5]


def foreign(names: tuple[str, ...] = NAMES, step: int = 28, data: int = 28) -> bytes:
    types = typestore().types
    fields = [
        types["sensor_msgs/msg/PointField"](name=name, offset=4 * k, datatype=7, count=1)
        for k, name in enumerate(names)
    ]
    message = types[POINTS_TYPE](
        header=header(START_NS, "velodyne"),
        height=1,
        width=1,
        fields=fields,
        is_bigendian=False,
        point_step=step,
        row_step=step,
        data=np.zeros(data, np.uint8),
        is_dense=True,
    )
    return serialised(message, POINTS_TYPE)


@pytest.mark.parametrize(
    "message",
    [foreign(), foreign(("x", "y", "z", "intensity", "ring")), foreign(("x",)), b"\0\1\0\0\1", b""],
    ids=["another type of t", "other fields", "one field", "cut off", "empty"],
)
def test_clouds_of_another_layout_are_told(message: bytes) -> None:
    with pytest.raises(LogError, match=r"/lidar/points.*range, angle, t.*points=none.*LaserScan"):
        point_cloud_columns(raw(message))


def test_a_cloud_whose_data_do_not_fit_is_told() -> None:
    whole = point_cloud_message(START_NS, np.array([START_NS]), np.ones(1), np.ones(1), np.ones(1))
    at = whole.index(b"\x1c\0\0\0\x1c\0\0\0\x1c\0\0\0")  # point step, row step, size of the data
    broken = whole[:at] + b"\x18" + whole[at + 1 :]
    with pytest.raises(LogError, match="as trackside records them"):
        point_cloud_columns(raw(broken))


def test_a_session_takes_points_before_scans(tmp_path: Path) -> None:
    scan = typestore().types[SCAN_TYPE](
        header=header(START_NS, "lidar"),
        angle_min=0.0,
        angle_max=1.0,
        angle_increment=1.0,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.1,
        range_max=12.0,
        ranges=np.full(2, 3.0, np.float32),
        intensities=np.zeros(0, np.float32),
    )
    t_ns, range_m, bearing, intensity = revolution()
    at = np.array([START_NS])
    for name, with_points in (("both", True), ("scan", False)):
        with Session.create(tmp_path / name, SessionInfo()) as writer:
            writer.add_messages("/scan", SCAN_TYPE, [serialised(scan, SCAN_TYPE)], at)
            if with_points:
                message = point_cloud_message(START_NS, t_ns, range_m, bearing, intensity)
                writer.add_messages("/lidar/points", POINTS_TYPE, [message], at)
        session = Session.open(tmp_path / name)
        assert session.has_scans
        assert session.scans().range_m.size == (5 if with_points else 2)
    with Session.create(tmp_path / "points", SessionInfo()) as writer:
        writer.add_messages("/lidar/points", POINTS_TYPE, [message], at)
    assert Session.open(tmp_path / "points").has_scans
