from __future__ import annotations

import cv2
import numpy as np
import pytest
from rendered_runs import (
    LENGTH_M,
    Image,
    arc,
    dark,
    key_errors,
    nees,
    off_at_end,
    scene,
    seen,
    stamps,
    straight,
)

from geometry import Floats, between
from visual_odometry import State, VisualOdometer, VisualOdometryError, VoConfig, VoFrame


@pytest.fixture(scope="module")
def turn() -> tuple[Floats, list[VoFrame]]:
    """A turn of 4 m at 0.6 m/s."""
    poses = arc()
    return poses, seen(poses)


def test_a_turn_of_four_metres_ends_where_it_ended(turn: tuple[Floats, list[VoFrame]]) -> None:
    """Asked are 2 % and 1 degree; a twentieth of that is what it does with room to spare."""
    poses, frames = turn
    off = off_at_end(poses, frames)
    assert np.hypot(*off[:2]) < 0.001 * LENGTH_M
    assert abs(off[2]) < np.radians(0.1)
    assert [frame.state for frame in frames] == [State.START] + [State.TRACKED] * (len(poses) - 1)


def test_the_scale_is_right() -> None:
    poses = straight(2.0)
    frames = seen(poses)
    told = np.array([frame.pose for frame in frames])
    way = float(np.hypot(*np.diff(told[:, :2], axis=0).T).sum())
    assert way == pytest.approx(2.0, rel=0.002)


def test_covariances_of_the_steps_are_as_large_as_the_errors() -> None:
    """Mean NEES is 3 for a right covariance; between 1.5 and 6 over two rooms."""
    values = []
    for seed in range(2):
        poses = arc(length_m=1.6)
        values += nees(*key_errors(poses, seen(poses, seed=seed))).tolist()
    assert len(values) > 30
    assert 1.5 < np.mean(values) < 6.0


def test_the_covariance_of_the_pose_grows_along_the_way(
    turn: tuple[Floats, list[VoFrame]],
) -> None:
    poses, frames = turn
    spread = [float(np.trace(frame.covariance[:2, :2])) for frame in frames]
    assert spread[0] == 0.0
    assert 0.0 < spread[10] < spread[50] < spread[-1]
    off = off_at_end(poses, frames)
    assert off @ np.linalg.solve(_at_end(frames), off) < 20.0


def _at_end(frames: list[VoFrame]) -> Floats:
    """Covariance of the last pose, seen from itself."""
    heading = float(frames[-1].pose[2])
    cos, sin = np.cos(heading), np.sin(heading)
    back = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(back @ frames[-1].covariance @ back.T)


def test_a_few_dark_frames_are_missed_and_made_good() -> None:
    poses = arc(length_m=1.4)
    frames = seen(poses, dark(12, 17))
    assert [frame.state for frame in frames[12:17]] == [State.MISSED] * 5
    assert all(frame.why for frame in frames[12:17])
    assert {frame.state for frame in frames[17:]} == {State.TRACKED}
    assert np.hypot(*off_at_end(poses, frames)[:2]) < 0.01


def test_a_long_dark_is_lost_and_afterwards_steps_are_right_again() -> None:
    poses = arc(length_m=2.4)
    frames = seen(poses, dark(15, 30))
    states = [frame.state for frame in frames]
    assert State.LOST in states[15:30]
    assert State.TRACKED not in states[15:31]
    # The first frame with light begins anew; from it on every step is known.
    assert set(states[31:]) == {State.TRACKED}
    assert frames[30].state is State.LOST
    np.testing.assert_allclose(frames[30].pose, frames[14].pose, atol=1e-12)
    true = between(poses[30], poses[-1])
    np.testing.assert_allclose(between(frames[30].pose, frames[-1].pose), true, atol=5e-3)


def test_a_covered_eye_is_no_motion() -> None:
    poses = arc(length_m=1.4)

    def covered(k: int, image: Image) -> Image:
        hidden = image.copy()
        hidden[:, 672:] = 25
        return hidden if 12 <= k < 28 else image

    frames = seen(poses, covered)
    assert State.TRACKED not in {frame.state for frame in frames[12:28]}
    assert frames[-1].state is State.TRACKED


def test_a_dark_beginning_is_lost_until_there_is_light() -> None:
    poses = arc(length_m=0.8)
    frames = seen(poses, dark(0, 4))
    states = [frame.state for frame in frames]
    assert states[:5] == [State.LOST] * 4 + [State.START]
    assert set(states[5:]) == {State.TRACKED}
    np.testing.assert_array_equal(frames[4].pose, np.zeros(3))


def test_another_exposure_is_no_other_place() -> None:
    poses = arc(length_m=0.8)

    def exposed(k: int, image: Image) -> Image:
        return np.asarray(cv2.convertScaleAbs(image, alpha=1.0 - 0.4 * (k // 4 % 2)), np.uint8)

    frames = seen(poses, exposed)
    assert {frame.state for frame in frames[1:]} == {State.TRACKED}
    assert np.hypot(*off_at_end(poses, frames)[:2]) < 0.003


def test_standing_is_no_motion_at_all() -> None:
    frames = seen(np.repeat(arc()[:1], 10, axis=0))
    np.testing.assert_allclose([frame.pose for frame in frames], 0.0, atol=3e-4)
    assert sum(frame.key for frame in frames) == 1


def test_driving_backwards_is_told_as_such() -> None:
    poses = straight(0.8)[::-1].copy()
    frames = seen(poses)
    assert frames[-1].pose[0] == pytest.approx(-0.8, abs=2e-3)


def test_a_jump_that_no_car_makes_is_refused() -> None:
    poses = straight(0.4)
    room = scene()
    odometer = VisualOdometer(room.pair, room.mounting, VoConfig(max_speed_m_s=0.3))
    states = [
        odometer.add(t_ns, room.frame(pose)).state
        for t_ns, pose in zip(stamps(4).tolist(), poses, strict=False)
    ]
    # It drives at twice that speed.
    assert states[1:] == [State.MISSED] * 3


def test_the_lever_of_the_camera_is_taken_off() -> None:
    """A car that turns on the spot stays there, though its camera goes round."""
    spot = np.stack([np.full(12, 2.0), np.full(12, 2.0), np.linspace(0.0, 0.6, 12)], axis=1)
    frames = seen(spot)
    told = np.array([frame.pose for frame in frames])
    np.testing.assert_allclose(told[:, :2], 0.0, atol=2e-3)
    assert told[-1, 2] == pytest.approx(0.6, abs=2e-3)


def test_pictures_of_another_mode_are_refused() -> None:
    room = scene()
    odometer = VisualOdometer(room.pair, room.mounting)
    with pytest.raises(VisualOdometryError, match=r"2560x720 pixels.*672x376"):
        odometer.add(0, np.zeros((720, 2560), np.uint8))
