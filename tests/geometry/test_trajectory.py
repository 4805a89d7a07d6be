"""Paths over time: their measures, and poses between the poses."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_strategies import poses, trajectories

from geometry import Floats, Stamps, Trajectory, TrajectoryError, inverse, wrap

DECADES_NS = 1_800_000_000 * 10**9
S = 10**9


def path(
    t_s: npt.ArrayLike, x: npt.ArrayLike = 0.0, y: npt.ArrayLike = 0.0, heading: npt.ArrayLike = 0.0
) -> Trajectory:
    """A path with stamps in seconds of today's size; a single number stands for a whole column."""
    t_ns = stamps(*np.asarray(t_s, dtype=np.float64))
    columns = [
        np.broadcast_to(np.asarray(c, dtype=np.float64), t_ns.shape) for c in (x, y, heading)
    ]
    return Trajectory(t_ns, *columns)


def stamps(*t_s: float) -> Stamps:
    return np.array([DECADES_NS + round(t * S) for t in t_s], dtype=np.int64)


def test_a_square_drive() -> None:
    drive = path([0, 1, 2, 4], x=[0, 3, 3, 0], y=[0, 0, 4, 4], heading=[0, 1, 2, 3])
    assert len(drive) == 4
    assert drive.duration_s == 4.0
    assert drive.rate_hz == 1.0
    assert drive.travelled_m.tolist() == [0, 3, 7, 10]
    assert drive.length_m == 10.0
    np.testing.assert_array_equal(drive.positions, [[0, 0], [3, 0], [3, 4], [0, 4]])
    np.testing.assert_array_equal(drive.poses[3], [0, 4, 3])


def test_speed_of_even_motion_at_uneven_stamps() -> None:
    t_s = np.array([0.0, 0.1, 0.15, 0.4, 1.0])
    np.testing.assert_allclose(path(t_s, x=2.0 * t_s).speed_m_s, 2.0, rtol=1e-9)


def test_speed_of_accelerated_motion_is_exact_inside() -> None:
    t_s = np.linspace(0, 2, 21)
    np.testing.assert_allclose(path(t_s, y=t_s**2).speed_m_s[1:-1], 2 * t_s[1:-1], rtol=1e-9)


def test_a_single_pose_has_no_extent() -> None:
    standing = path([0.0], x=1.0, y=2.0, heading=3.0)
    assert (standing.duration_s, standing.rate_hz, standing.length_m) == (0.0, 0.0, 0.0)
    assert standing.speed_m_s.tolist() == [0.0]
    np.testing.assert_array_equal(standing.interpolated(standing.t_ns).poses, [[1, 2, 3]])


def test_the_rate_is_that_of_the_median_period() -> None:
    assert path([0.0, 0.1, 0.2, 0.3, 9.0]).rate_hz == pytest.approx(10.0)


@given(trajectories(), poses)
def test_there_and_back(drive: Trajectory, pose: Floats) -> None:
    moved = drive.transformed(pose)
    np.testing.assert_allclose(moved.length_m, drive.length_m, rtol=1e-9, atol=1e-9)
    back = moved.transformed(inverse(pose))
    np.testing.assert_array_equal(back.t_ns, drive.t_ns)
    np.testing.assert_allclose(back.positions, drive.positions, atol=1e-9)
    np.testing.assert_allclose(wrap(back.heading - drive.heading), 0.0, atol=1e-12)


def test_selected_keeps_whole_poses() -> None:
    drive = path([0, 1, 2], x=[5, 6, 7], y=[8, 9, 10], heading=[0.1, 0.2, 0.3])
    kept = drive.selected(np.array([True, False, True]))
    np.testing.assert_array_equal(kept.poses, drive.poses[[0, 2]])
    np.testing.assert_array_equal(kept.t_ns, drive.t_ns[[0, 2]])
    with pytest.raises(TrajectoryError, match="this one has none"):
        drive.selected(np.zeros(3, dtype=bool))


class TestInterpolation:
    def test_between_two_poses(self) -> None:
        middle = path([0, 1], x=[0, 4], y=[2, 0], heading=[0, 1]).interpolated(stamps(0.25, 0.5))
        np.testing.assert_allclose(middle.poses, [[1, 1.5, 0.25], [2, 1, 0.5]])

    def test_heading_takes_the_shorter_arc_across_the_seam(self) -> None:
        turn = path([0, 1], heading=np.radians([170.0, -170.0])).interpolated(
            stamps(0.25, 0.5, 0.75)
        )
        np.testing.assert_allclose(np.degrees(turn.heading), [175, 180, -175])

    def test_headings_of_many_turns_are_directions(self) -> None:
        turn = path([0, 1], heading=[0.1, 0.3 + 20 * math.pi]).interpolated(stamps(0.5))
        assert turn.heading[0] == pytest.approx(0.2)

    @given(trajectories())
    def test_at_our_own_stamps_it_gives_our_own_poses(self, drive: Trajectory) -> None:
        same = drive.interpolated(drive.t_ns)
        np.testing.assert_array_equal(same.positions, drive.positions)
        np.testing.assert_allclose(wrap(same.heading - drive.heading), 0.0, atol=1e-14)

    @given(trajectories(min_size=2), st.data())
    def test_a_pose_between_lies_between(self, drive: Trajectory, data: st.DataObject) -> None:
        low, high = int(drive.t_ns[0]), int(drive.t_ns[-1])
        t_ns = data.draw(st.integers(low, high))
        pose = drive.interpolated(np.array([t_ns]))
        k = min(max(int(np.searchsorted(drive.t_ns, t_ns)), 1), len(drive) - 1)
        ends = drive.positions[k - 1 : k + 1]
        assert np.all(pose.positions[0] >= ends.min(axis=0) - 1e-9)
        assert np.all(pose.positions[0] <= ends.max(axis=0) + 1e-9)
        arc = abs(wrap(drive.heading[k] - drive.heading[k - 1]))
        assert abs(wrap(pose.heading[0] - drive.heading[k - 1])) <= arc + 1e-12
        assert -math.pi < pose.heading[0] <= math.pi

    @given(trajectories(), st.integers(1, 10**18))
    def test_it_never_extrapolates(self, drive: Trajectory, beyond_ns: int) -> None:
        for t_ns in (drive.t_ns[0] - beyond_ns, drive.t_ns[-1] + beyond_ns):
            with pytest.raises(TrajectoryError, match=r"1 of 1 stamps .* never extrapolated"):
                drive.interpolated(np.array([t_ns]))

    def test_the_refusal_counts_the_stamps_outside(self) -> None:
        with pytest.raises(TrajectoryError, match=r"2 of 4 stamps lie outside the path's 1\.500 s"):
            path([0, 1.5]).interpolated(stamps(-1, 0, 1.5, 1.6))

    def test_no_stamps_make_no_trajectory(self) -> None:
        with pytest.raises(TrajectoryError, match="at least one pose"):
            path([0, 1]).interpolated(stamps())

    def test_stamps_of_decades_keep_their_nanoseconds(self) -> None:
        one_ns = Trajectory.from_poses(
            DECADES_NS + np.array([0, 4]), np.array([[0.0] * 3, [4.0] * 3])
        )
        np.testing.assert_array_equal(one_ns.interpolated(one_ns.t_ns[:1] + 3).x, [3.0])


class TestCovers:
    GAP = path([0.0, 0.1, 0.2, 1.2, 1.3])

    @pytest.mark.parametrize(
        ("t_s", "covered"),
        [
            (-0.001, False),
            (0.0, True),
            (0.05, True),
            (0.2, True),
            (0.201, False),
            (0.7, False),
            (1.199, False),
            (1.2, True),
            (1.3, True),
            (1.301, False),
        ],
    )
    def test_near_a_gap(self, t_s: float, covered: bool) -> None:
        assert self.GAP.covers(stamps(t_s), max_gap_s=0.5).tolist() == [covered]

    def test_a_gap_as_long_as_allowed_is_none(self) -> None:
        assert self.GAP.covers(stamps(0.7), max_gap_s=1.0).all()

    def test_an_exact_stamp_is_covered_whatever_the_gaps(self) -> None:
        assert self.GAP.covers(self.GAP.t_ns, max_gap_s=0.0).all()

    def test_a_single_pose_covers_its_own_stamp_only(self) -> None:
        assert path([1.0]).covers(stamps(0.9, 1.0, 1.1), 10.0).tolist() == [False, True, False]

    def test_no_stamps(self) -> None:
        assert self.GAP.covers(stamps(), 1.0).shape == (0,)

    def test_the_smallest_of_all_stamps_does_not_overflow(self) -> None:
        limits = np.iinfo(np.int64)
        assert not self.GAP.covers(np.array([limits.min, limits.max]), 1e9).any()

    @given(trajectories(), st.lists(st.integers(-(10**10), 10**11), min_size=1), st.floats(0, 20))
    def test_what_is_covered_can_be_interpolated(
        self, drive: Trajectory, offsets_ns: list[int], max_gap_s: float
    ) -> None:
        t_ns = drive.t_ns[0] + np.unique(offsets_ns)
        kept = t_ns[drive.covers(t_ns, max_gap_s)]
        if kept.size:
            assert len(drive.interpolated(kept)) == kept.size


class TestConstruction:
    def test_the_callers_arrays_stay_the_callers(self) -> None:
        t_ns, columns = np.arange(3), np.zeros((3, 3))
        drive = Trajectory.from_poses(t_ns, columns)
        t_ns[0], columns[:] = -5, 9.0
        assert drive.t_ns[0] == 0
        assert not drive.poses.any()
        for column in (drive.t_ns, drive.x, drive.y, drive.heading):
            with pytest.raises(ValueError, match="read-only"):
                column[0] = 1
        with pytest.raises(AttributeError):
            drive.x = np.ones(3)  # type: ignore[misc]  # that it cannot be is what is tested

    def test_columns_get_their_types(self) -> None:
        drive = Trajectory.from_poses(
            np.arange(2, dtype=np.int32), np.ones((2, 3), dtype=np.float32)
        )
        assert drive.t_ns.dtype == np.int64
        assert drive.x.dtype == np.float64

    def test_no_pose(self) -> None:
        with pytest.raises(TrajectoryError, match="at least one pose, this one has none"):
            Trajectory.from_poses(np.array([], dtype=np.int64), np.empty((0, 3)))

    def test_stamps_in_two_dimensions(self) -> None:
        with pytest.raises(TrajectoryError, match=r"stamps have shape \(1, 2\), expected \(n,\)"):
            Trajectory(np.array([[1, 2]]), np.zeros(2), np.zeros(2), np.zeros(2))

    @pytest.mark.parametrize("late_ns", [10, 9])
    def test_stamps_that_do_not_increase(self, late_ns: int) -> None:
        t_ns = np.array([0, 10, late_ns])
        with pytest.raises(
            TrajectoryError, match=f"pose 2 is stamped {late_ns} ns, not after 10 ns"
        ):
            Trajectory(t_ns, np.zeros(3), np.zeros(3), np.zeros(3))

    @pytest.mark.parametrize("shape", [(2,), (4,), (3, 1), (3, 2), ()])
    def test_a_column_of_another_shape(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(TrajectoryError, match=r"y has shape .* expected \(3,\)"):
            Trajectory(np.arange(3), np.zeros(3), np.zeros(shape), np.zeros(3))

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    def test_values_that_are_not_finite_are_counted(self, value: float) -> None:
        heading = np.array([0.0, value, 0.0, value])
        with pytest.raises(
            TrajectoryError, match=r"heading is not finite in pose 1 \(and 1 more\)"
        ):
            Trajectory(np.arange(4), np.zeros(4), np.zeros(4), heading)
