from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_session import PERIOD_NS, START_NS, observations, odometry

from capture import LogError, Observations, Odometry
from capture.log_columns import (
    imu_columns,
    integrated,
    observation_columns,
    odometry_columns,
    scan_columns,
)
from capture.log_reader import RawMessages
from capture.messages import (
    header,
    observation_messages,
    odometry_messages,
    serialised,
    typestore,
)
from capture.topics import RANGE_BEARING_TYPE, SCAN_TYPE


def raw(messages: list[bytes]) -> RawMessages:
    return RawMessages("/topic", START_NS + np.arange(len(messages)), messages)


def read_back(made: Odometry) -> Odometry:
    return odometry_columns(raw(odometry_messages(made)), made.source)


def test_odometry_survives_to_the_last_bit() -> None:
    made = odometry()
    found = read_back(made)
    for name in ("t_ns", "pose_odom_base", "speed_m_s", "yaw_rate_rad_s"):
        np.testing.assert_array_equal(getattr(found, name), getattr(made, name), err_msg=name)


def test_odometry_is_in_order_of_its_stamps_each_once() -> None:
    made = odometry(n=4)
    order = np.array([2, 0, 0, 3, 1])
    shuffled = Odometry(
        "wheel",
        made.t_ns[order],
        made.pose_odom_base[order],
        made.speed_m_s[order],
        made.yaw_rate_rad_s[order],
    )
    np.testing.assert_array_equal(read_back(shuffled).t_ns, made.t_ns)
    np.testing.assert_array_equal(read_back(shuffled).pose_odom_base, made.pose_odom_base)


def test_poses_that_are_not_finite_are_left_out() -> None:
    made = odometry(n=5)
    pose = made.pose_odom_base.copy()
    pose[2, 0] = np.nan
    assert read_back(replace(made, pose_odom_base=pose)).t_ns.tolist() == [
        t for k, t in enumerate(made.t_ns.tolist()) if k != 2
    ]


def test_a_source_that_tells_only_speeds_gets_poses() -> None:
    n = 101
    t_ns = START_NS + PERIOD_NS * np.arange(n)
    made = Odometry("wheel", t_ns, np.zeros((n, 3)), np.full(n, 2.0), np.full(n, 0.5))
    found = read_back(made)
    # A circle of radius v / w = 4 m after 2 s, that is 1 rad; the chords are shorter by a hair.
    np.testing.assert_allclose(
        found.pose_odom_base[-1], [4 * np.sin(1.0), 4 * (1 - np.cos(1.0)), 1.0], atol=1e-4
    )
    np.testing.assert_array_equal(
        found.pose_odom_base, integrated(t_ns, made.speed_m_s, made.yaw_rate_rad_s)
    )


def test_a_source_that_tells_only_poses_gets_speeds() -> None:
    n = 101
    t_ns = START_NS + PERIOD_NS * np.arange(n)
    heading = np.linspace(0.0, -1.0, n)
    pose = np.stack([4 * np.sin(-heading), -4 * (1 - np.cos(heading)), heading], axis=1)
    found = read_back(Odometry("zed", t_ns, pose, np.zeros(n), np.zeros(n)))
    np.testing.assert_allclose(found.speed_m_s, 2.0, rtol=1e-4)
    np.testing.assert_allclose(found.yaw_rate_rad_s, -0.5, rtol=1e-6)
    backwards = read_back(Odometry("zed", t_ns, pose[::-1], np.zeros(n), np.zeros(n)))
    np.testing.assert_allclose(backwards.speed_m_s, -2.0, rtol=1e-4)


def test_a_car_at_rest_stays_at_rest() -> None:
    made = Odometry("wheel", odometry(n=3).t_ns, np.zeros((3, 3)), np.zeros(3), np.zeros(3))
    assert not read_back(made).pose_odom_base.any()


def test_a_speed_holds_until_the_next_message() -> None:
    t_ns = np.array([0, 1_000_000_000, 4_000_000_000])
    pose = integrated(t_ns, np.array([1.0, 2.0, 9.0]), np.array([0.0, np.pi / 6, 9.0]))
    middle = np.pi / 4
    np.testing.assert_allclose(
        pose, [[0, 0, 0], [1, 0, 0], [1 + 6 * np.cos(middle), 6 * np.sin(middle), np.pi / 2]]
    )


def test_observations_survive_to_the_last_bit() -> None:
    made = observations()
    t_ns, messages = observation_messages(made)
    assert t_ns.tolist() == sorted(set(made.t_ns.tolist()))
    found = observation_columns(RawMessages("/o", t_ns, messages))
    for name in ("t_ns", "landmark_id", "range_m", "bearing_rad"):
        np.testing.assert_array_equal(getattr(found, name), getattr(made, name), err_msg=name)
    assert found.batch_starts.tolist() == [0, 3, 4, 6]


def test_no_observations_make_no_messages() -> None:
    nothing = np.array([], dtype=np.int64)
    t_ns, messages = observation_messages(
        Observations(nothing, nothing, nothing.astype(float), nothing.astype(float))
    )
    assert (t_ns.size, messages) == (0, [])


def test_observations_of_unequal_number_are_refused() -> None:
    message = typestore().types[RANGE_BEARING_TYPE](
        header=header(1, ""),
        landmark_id=np.zeros(2, dtype=np.int32),
        range_m=np.zeros(3),
        bearing_rad=np.zeros(3),
    )
    with pytest.raises(LogError, match=r"topic /topic: .*unequal number.*import"):
        observation_columns(raw([serialised(message, RANGE_BEARING_TYPE)]))


def scan(stamp_ns: int, ranges: list[float], intensities: list[float]) -> bytes:
    message = typestore().types[SCAN_TYPE](
        header=header(stamp_ns, "lidar"),
        angle_min=3.0,
        angle_max=4.0,
        angle_increment=0.25,
        time_increment=0.001,
        scan_time=0.1,
        range_min=0.5,
        range_max=8.0,
        ranges=np.array(ranges, dtype=np.float32),
        intensities=np.array(intensities, dtype=np.float32),
    )
    return serialised(message, SCAN_TYPE)


def test_scans_of_any_length() -> None:
    first = scan(START_NS, [1.0, 0.1, 9.0, np.inf], [])
    second = scan(START_NS + PERIOD_NS, [2.0, np.nan], [15.0, 47.0])
    found = scan_columns(raw([second, first]))
    assert found.t_ns.tolist() == [START_NS, START_NS + PERIOD_NS]
    assert found.starts.tolist() == [0, 4, 6]
    np.testing.assert_array_equal(found.range_m, [1.0, np.nan, np.nan, np.nan, 2.0, np.nan])
    np.testing.assert_array_equal(found.intensity, [np.nan] * 4 + [15.0, 47.0])
    np.testing.assert_allclose(found.bearing_rad[:3], [3.0, 3.25 - 2 * np.pi, 3.5 - 2 * np.pi])
    assert (found.beam_t_ns[:4] - START_NS).tolist() == [0, 1_000_000, 2_000_000, 3_000_000]


def test_an_empty_stamp_becomes_the_log_time() -> None:
    found = scan_columns(raw([scan(0, [1.0], []), scan(0, [2.0], [])]))
    assert found.t_ns.tolist() == [START_NS, START_NS + 1]


def test_a_damaged_message_names_its_topic() -> None:
    with pytest.raises(LogError, match=r"topic /topic: .*expected messages as its schema says"):
        imu_columns(raw([b"\0\1\0\0 too short"]))
