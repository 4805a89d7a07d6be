"""Odometry sample by sample is what it is as a whole: `capture.growing_odometry`."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_session import PERIOD_NS, START_NS

from capture import GrowingOdometry, LogError, Odometry, extended, joined, no_odometry, split
from capture.log_columns import LOST_COVARIANCE, odometry_columns, told_odometry
from capture.log_reader import RawMessages
from capture.messages import odometry_messages, serialised, typestore
from capture.topics import ODOMETRY_TYPE

N = 200


def moving() -> Odometry:
    """A car that stands for a second, then drives in circles that wrap its heading."""
    random = np.random.default_rng(2)
    t_ns = START_NS + np.cumsum(random.integers(1, 2 * PERIOD_NS, N))
    speed = np.where(np.arange(N) < 50, 0.0, random.uniform(0.2, 2.0, N))
    yaw_rate = np.where(np.arange(N) < 50, 0.0, 4.0 + random.normal(0.0, 0.1, N))
    heading = np.cumsum(yaw_rate * 0.02)
    pose = np.stack([np.cumsum(speed * 0.02), 0.1 * heading, (heading + 3.0) % 6.0 - 3.0], axis=1)
    return Odometry("viso", t_ns, pose, speed, yaw_rate)


STANDING = np.tile([1.0, -2.0, 0.5], (N, 1))
KINDS = {
    "both": moving(),
    "poses": replace(moving(), speed_m_s=np.zeros(N), yaw_rate_rad_s=np.zeros(N)),
    "speeds": replace(moving(), pose_odom_base=STANDING),
    "standing": replace(
        moving(), pose_odom_base=STANDING, speed_m_s=np.zeros(N), yaw_rate_rad_s=np.zeros(N)
    ),
    "crawling": replace(
        moving(),
        pose_odom_base=STANDING,
        speed_m_s=np.full(N, 1e-3),
        yaw_rate_rad_s=np.zeros(N),
    ),
}


def raw(odometry: Odometry) -> RawMessages:
    return RawMessages("/viso/odom", odometry.t_ns, odometry_messages(odometry))


@pytest.mark.parametrize("kind", KINDS)
@given(cuts=st.lists(st.integers(0, N), max_size=12))
def test_however_it_comes_it_is_the_same_to_the_last_bit(kind: str, cuts: list[int]) -> None:
    made = KINDS[kind]
    whole = odometry_columns(raw(made), "viso")
    growing, found = GrowingOdometry("viso"), no_odometry("viso")
    edges = [0, *sorted(cuts), N]
    for start, stop in pairwise(edges):
        part = split(split(made, stop)[0], start)[1]
        told = told_odometry(raw(part), "viso") if part.t_ns.size else None
        found = joined(found, growing.take(told, last=False))
    found = joined(found, growing.take(None, last=True))
    for name in ("t_ns", "pose_odom_base", "speed_m_s", "yaw_rate_rad_s"):
        if kind == "poses" and name in ("speed_m_s", "yaw_rate_rad_s"):
            # Live a speed is that by which a pose was reached, offline that by which it is left.
            np.testing.assert_array_equal(getattr(found, name)[51:], getattr(whole, name)[50:-1])
            continue
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name), err_msg=name)


def test_a_standing_car_is_not_held_back() -> None:
    growing = GrowingOdometry("viso")
    first, rest = split(KINDS["speeds"], 50)
    assert growing.take(first, last=False).t_ns.size == 50
    # One speed is not enough to know that the pose will never move, some centimetres are.
    assert growing.take(split(rest, 1)[0], last=False).t_ns.size == 0
    assert growing.take(split(rest, 1)[1], last=False).t_ns.size == N - 50


def test_what_comes_too_late_is_left_out() -> None:
    made = KINDS["both"]
    growing = GrowingOdometry("viso")
    first = growing.take(split(made, 100)[0], last=False)
    again = growing.take(split(made, 120)[0], last=False)
    np.testing.assert_array_equal(joined(first, again).t_ns, made.t_ns[:120])


def lost_message(odometry: Odometry) -> bytes:
    """As libviso2 tells that it is lost: the last pose, no speed, a covariance of 9999."""
    data = odometry_messages(odometry)[0]
    message: Any = typestore().deserialize_cdr(data, ODOMETRY_TYPE)
    bad = (np.eye(6) * LOST_COVARIANCE).reshape(-1)
    pose, twist = replace(message.pose, covariance=bad), replace(message.twist, covariance=bad)
    return serialised(replace(message, pose=pose, twist=twist), ODOMETRY_TYPE)


def test_a_lost_message_is_no_sample() -> None:
    made = split(moving(), 80)[0]
    messages = odometry_messages(made)
    rows = [0, 60, 61, 79]
    for row in rows:
        messages[row] = lost_message(split(split(made, row + 1)[0], row)[1])
    found = odometry_columns(RawMessages("/viso/odom", made.t_ns, messages), "viso")
    assert found.lost_t_ns.tolist() == made.t_ns[rows].tolist()
    assert found.t_ns.tolist() == np.delete(made.t_ns, rows).tolist()
    np.testing.assert_array_equal(found.speed_m_s, np.delete(made.speed_m_s, rows))


def test_a_source_that_is_always_lost_is_told() -> None:
    one = split(moving(), 1)[0]
    with pytest.raises(LogError, match=r"1 say that the source was lost.*another source"):
        odometry_columns(RawMessages("/viso/odom", one.t_ns, [lost_message(one)]), "viso")


def test_streams_are_cut_and_joined_with_what_was_lost_between() -> None:
    made = replace(moving(), lost_t_ns=moving().t_ns[[10, 20, 30]] + 1)
    head, tail = split(made, 21)
    assert (head.t_ns.size, tail.t_ns.size) == (21, N - 21)
    assert (head.lost_t_ns.size, tail.lost_t_ns.size) == (2, 1)
    both = joined(head, tail)
    np.testing.assert_array_equal(both.pose_odom_base, made.pose_odom_base)
    np.testing.assert_array_equal(both.lost_t_ns, made.lost_t_ns)
    assert extended(head, made).t_ns.tolist() == made.t_ns.tolist()
    assert extended(head, None) is head
