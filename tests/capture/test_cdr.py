from __future__ import annotations

import numpy as np
import pytest
from small_session import odometry

from capture import cdr
from capture.messages import header, odometry_messages, serialised, typestore
from capture.topics import IMU_TYPE, ODOMETRY_TYPE, SCAN_TYPE, VESC_STATE_TYPE


def scan(frame: str, beams: int, intensities: int, stamp_ns: int = 5) -> bytes:
    """A `LaserScan` as rosbags serialises it."""
    message = typestore().types[SCAN_TYPE](
        header=header(stamp_ns, frame),
        angle_min=-1.0,
        angle_max=1.0,
        angle_increment=0.1,
        time_increment=0.001,
        scan_time=0.1,
        range_min=0.1,
        range_max=8.0,
        ranges=np.arange(beams, dtype=np.float32),
        intensities=np.full(intensities, 47, dtype=np.float32),
    )
    return serialised(message, SCAN_TYPE)


def test_runs_of_one_layout_are_one_block() -> None:
    messages = [scan("lidar", 3, 0), scan("lidar", 3, 0), scan("lidar", 4, 4), scan("l", 3, 0)]
    found = list(cdr.blocks(messages, cdr.LASER_SCAN))
    assert [block.size for block in found] == [2, 1, 1]
    assert found[1]["intensities"].tolist() == [[47.0] * 4]


def test_equal_sizes_with_unequal_parts_are_told_apart() -> None:
    # 4 ranges and 1 intensity take the same bytes as 1 and 4.
    messages = [scan("lidar", 4, 1), scan("lidar", 1, 4), scan("lidar", 1, 4)]
    assert len({len(message) for message in messages}) == 1
    found = list(cdr.blocks(messages, cdr.LASER_SCAN))
    assert [(block.size, block["ranges"].shape[1]) for block in found] == [(1, 4), (2, 1)]


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd", "a_long_frame/of_a_sensor"])
@pytest.mark.parametrize("beams", [0, 1, 5])
def test_a_scan_reads_as_rosbags_reads_it(frame: str, beams: int) -> None:
    message = scan(frame, beams, beams)
    theirs = typestore().deserialize_cdr(message, SCAN_TYPE)
    ((ours,),) = cdr.blocks([message], cdr.LASER_SCAN)
    for name in ("angle_min", "time_increment", "range_max", "ranges", "intensities"):
        np.testing.assert_array_equal(ours[name], getattr(theirs, name))


def test_odometry_reads_as_rosbags_reads_it() -> None:
    made = odometry(n=3)
    for message in odometry_messages(made):
        theirs = typestore().deserialize_cdr(message, ODOMETRY_TYPE)
        ((ours,),) = cdr.blocks([message], cdr.ODOMETRY)
        pose, twist = theirs.pose.pose, theirs.twist.twist  # type: ignore[attr-defined]  # made at run time
        assert ours["position"].tolist() == [pose.position.x, pose.position.y, pose.position.z]
        turn = pose.orientation
        assert ours["orientation"].tolist() == [turn.x, turn.y, turn.z, turn.w]
        assert (ours["linear"][0], ours["angular"][2]) == (twist.linear.x, twist.angular.z)


@pytest.mark.parametrize("little_endian", [True, False])
def test_both_byte_orders(little_endian: bool) -> None:
    types = typestore().types
    vector = types["geometry_msgs/msg/Vector3"]
    message = types[IMU_TYPE](
        header=header(7_000_000_009, "imu"),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector(x=1.0, y=2.0, z=3.0),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(x=4.0, y=5.0, z=9.8),
        linear_acceleration_covariance=np.zeros(9),
    )
    data = bytes(typestore().serialize_cdr(message, IMU_TYPE, little_endian=little_endian))
    ((row,),) = cdr.blocks([data], cdr.IMU)
    assert (row["sec"], row["nanosec"]) == (7, 9)
    assert row["angular_velocity"].tolist() == [1, 2, 3]
    assert row["linear_acceleration"].tolist() == [4, 5, 9.8]


def test_a_template_is_filled_with_columns() -> None:
    template = scan("lidar", 2, 0)
    ranges = np.array([[1, 2], [3, 4]], dtype=np.float32)
    first, second = cdr.filled(template, cdr.LASER_SCAN, {"sec": [8, 9], "ranges": ranges})
    theirs = typestore().deserialize_cdr(second, SCAN_TYPE)
    assert theirs.header.stamp.sec == 9  # type: ignore[attr-defined]  # made at run time
    assert theirs.ranges.tolist() == [3, 4]  # type: ignore[attr-defined]  # made at run time
    assert len(first) == len(template)


@pytest.mark.parametrize(
    "message", [b"", b"\0\1\0\0", scan("lidar", 3, 3)[:40], scan("lidar", 3, 3)[:-4], b"\1" * 200]
)
def test_a_message_that_is_too_short_is_refused(message: bytes) -> None:
    with pytest.raises(ValueError, match=r"ends within its fields|no plain CDR"):
        list(cdr.blocks([message], cdr.LASER_SCAN))


def test_the_vesc_fields_stand_where_the_definition_puts_them() -> None:
    fields = [name for name, _ in typestore().fielddefs["vesc_msgs/msg/VescState"][1]]
    ours = [name for name, _ in cdr.VESC_STATE[len(cdr.HEADER) :]]
    assert fields[: len(ours)] == ours
    assert typestore().fielddefs[VESC_STATE_TYPE][1][0][0] == "header"
