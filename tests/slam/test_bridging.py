"""Where a visual odometry was lost the car drove on: `slam.bridging`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from capture import Odometry, joined, split
from geometry import Floats
from slam.bridging import Bridge

N, PERIOD_NS, SPEED, TURN = 100, 50_000_000, 0.8, 0.6


def circle(t_s: Floats) -> Floats:
    radius, turned = SPEED / TURN, TURN * t_s
    return np.stack([radius * np.sin(turned), radius * (1 - np.cos(turned)), turned], axis=1)


def libviso(lost: tuple[tuple[int, int], ...], n: int = N) -> Odometry:
    """What libviso2 tells of a car on a circle that is lost in some runs of its frames.

    Its pose stands while it is lost, and goes on from there.
    """
    gone = np.zeros(n, np.bool_)
    for start, stop in lost:
        gone[start:stop] = True
    t_ns = np.arange(n) * PERIOD_NS
    told_s = np.cumsum(np.append(0.0, np.where(gone[1:], 0.0, PERIOD_NS * 1e-9)))
    ones = np.ones(n)
    whole = Odometry("viso", t_ns, circle(told_s), SPEED * ones, TURN * ones)
    kept = ~gone
    return Odometry(
        "viso",
        t_ns[kept],
        whole.pose_odom_base[kept],
        whole.speed_m_s[kept],
        whole.yaw_rate_rad_s[kept],
        t_ns[gone],
    )


def test_without_a_lost_stretch_nothing_changes() -> None:
    told = libviso(())
    bridge = Bridge()
    assert bridge.carried(told) is not told.pose_odom_base or bridge.lost == 0
    np.testing.assert_array_equal(Bridge().carried(told), told.pose_odom_base)


def test_a_lost_stretch_is_no_standstill() -> None:
    told = libviso(((30, 50), (70, 72)))
    truth = circle(np.asarray(told.t_ns * 1e-9, np.float64))
    before_m = np.hypot(*(told.pose_odom_base - truth)[-1, :2])
    bridge = Bridge()
    after = bridge.carried(told) - truth
    assert bridge.lost == 2
    # From the last frame that was good to the first that is again.
    assert bridge.lost_s == pytest.approx((21 + 3) * 0.05)
    assert before_m > 0.5
    # The chord of the circle is shorter than its arc, by (w t)^2 / 24.
    assert np.hypot(*after[-1, :2]) < 0.02
    assert np.abs(after[:, 2]).max() < 1e-9


def test_lost_at_the_beginning_and_at_the_end_there_is_nothing_to_cross() -> None:
    told = libviso(((0, 5), (90, N)))
    bridge = Bridge()
    np.testing.assert_array_equal(bridge.carried(told), told.pose_odom_base)
    assert bridge.lost == 0


@given(cuts=st.lists(st.integers(0, N), max_size=8))
def test_block_by_block_it_is_the_same_to_the_last_bit(cuts: list[int]) -> None:
    told = libviso(((0, 2), (30, 50), (52, 53), (70, 71)))
    # Speeds that change, so that it matters which are taken.
    told = replace(told, speed_m_s=told.speed_m_s + 0.1 * np.sin(np.arange(told.t_ns.size)))
    whole, bridge = Bridge().carried(told), Bridge()
    rest, parts, done = told, [], 0
    for cut in [*sorted(min(c, told.t_ns.size) for c in cuts), told.t_ns.size]:
        block, rest = split(rest, cut - done)
        parts.append(bridge.carried(block))
        done = cut
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert bridge.lost == 3


def test_lost_stamps_may_come_before_the_frame_that_ends_them() -> None:
    """Live, the lost frames are in the log a while before the first good one."""
    told = libviso(((30, 50),))
    head, tail = split(told, 30)
    lost = replace(split(told, 0)[0], lost_t_ns=told.lost_t_ns)
    head, tail = (replace(part, lost_t_ns=told.lost_t_ns[:0]) for part in (head, tail))
    bridge = Bridge()
    parts = [bridge.carried(block) for block in (head, lost, tail)]
    np.testing.assert_array_equal(np.concatenate(parts), Bridge().carried(told))
    assert joined(head, tail).t_ns.size == told.t_ns.size
