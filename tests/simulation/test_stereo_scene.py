from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from drivers.camera import parse_zed_settings, split_stereo
from drivers.camera.image import yuyv_luma
from geometry import Floats, View, at_height, compose
from simulation.stereo import (
    ZED_MOUNTING,
    StereoScene,
    factory_text,
    zed_calibration,
    zed_pair,
)

POSE = np.array([0.5, 0.7, 0.4])
CONE = np.array([[2.0, 1.2]])
QUIET = StereoScene(np.zeros((0, 2)), seed=3, noise=0.0)


def views(pose: Floats) -> list[View]:
    """Both eyes in the world, from the calibration alone."""
    pair = zed_pair()
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation = (turn @ ZED_MOUNTING.rotation).T
    position = turn @ ZED_MOUNTING.position + (pose[0], pose[1], 0.0)
    left = View(pair.left, rotation, -rotation @ position)
    right = pair.rotation @ rotation, pair.rotation @ left.translation + pair.translation
    return [left, View(pair.right, *right)]


def floor_at(image: npt.NDArray[np.uint8], pixels: Floats) -> Floats:
    """Grey levels (n,) at pixels (n, 2)."""
    at = pixels.astype(np.float32)[None]
    return np.asarray(cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR), float).ravel()


def test_a_frame_is_two_eyes_side_by_side() -> None:
    frame = QUIET.frame(POSE)
    assert frame.shape == (376, 1344)
    assert frame.dtype == np.uint8
    left, right = split_stereo(frame)
    assert left.std() > 20
    assert np.abs(left.astype(float) - right).mean() > 10


def test_a_place_on_the_floor_looks_alike_wherever_it_is_seen_from() -> None:
    """Both eyes, and from 5 cm further on: the pixels that the calibration tells."""
    rng = np.random.default_rng(0)
    ahead, left = rng.uniform(0.75, 1.1, 400), rng.uniform(-0.2, 0.25, 400)
    place = compose(POSE, np.column_stack([ahead, left, np.zeros(400)]))[:, :2]
    greys = [
        floor_at(eye, view.project(at_height(place, 0.0)))
        for pose in (POSE, compose(POSE, np.array([0.05, 0.0, 0.02])))
        for eye, view in zip(split_stereo(QUIET.frame(pose)), views(pose), strict=True)
    ]
    for other in greys[1:]:
        assert np.corrcoef(greys[0], other)[0, 1] > 0.97
    aside = floor_at(split_stereo(QUIET.frame(POSE))[0],
                     views(POSE)[0].project(at_height(place + 0.02, 0.0)))  # fmt: skip
    assert np.corrcoef(greys[0], aside)[0, 1] < 0.8


def test_a_corner_of_the_room_is_where_the_calibration_says() -> None:
    """Where wall and floor meet, grey levels change along a line through the projected points."""
    pose = np.array([4.0, 2.0, 0.0])
    view = views(pose)[0]
    foot = view.project(np.array([[5.5, y, 0.0] for y in np.linspace(1.6, 2.4, 30)]))
    eye = split_stereo(QUIET.frame(pose))[0]
    above = [floor_at(eye, foot - np.array([0.0, shift])) for shift in (2.0, 4.0)]
    below = [floor_at(eye, foot + np.array([0.0, shift])) for shift in (2.0, 4.0)]
    step = np.abs(above[0] - below[0]).mean()
    assert step > 2.0 * np.abs(above[0] - above[1]).mean()


def test_a_cone_stands_where_it_was_put_in_both_eyes() -> None:
    with_cone = StereoScene(CONE, seed=3, noise=0.0)
    for eye, bare, view in zip(
        split_stereo(with_cone.frame(POSE)),
        split_stereo(QUIET.frame(POSE)),
        views(POSE),
        strict=True,
    ):
        down, across = np.nonzero(np.abs(eye.astype(int) - bare) > 12)
        ring = np.linspace(0.0, 2.0 * np.pi, 60)
        outline = np.concatenate([
            view.project(np.column_stack([CONE[0, 0] + radius * np.cos(ring),
                                          CONE[0, 1] + radius * np.sin(ring),
                                          np.full(60, height)]))
            for radius, height in ((0.09, 0.0), (0.015, 0.30))
        ])  # fmt: skip
        low, high = outline.min(axis=0), outline.max(axis=0)
        np.testing.assert_allclose([across.min(), down.min()], low, atol=2.5)
        np.testing.assert_allclose([across.max(), down.max()], high, atol=2.5)


def test_far_cones_are_behind_near_ones() -> None:
    near = compose(POSE, np.array([1.0, 0.06, 0.0]))[None, :2]
    far = compose(POSE, np.array([1.5, 0.06, 0.0]))[None, :2]
    one = StereoScene(near, seed=3, noise=0.0).frame(POSE)
    for order in ([near, far], [far, near]):
        both = StereoScene(np.concatenate(order), seed=3, noise=0.0).frame(POSE)
        top = views(POSE)[0].project(np.array([*near[0], 0.2])).astype(int)
        around = np.s_[top[1] - 3 : top[1] + 4, top[0] - 3 : top[0] + 4]
        np.testing.assert_array_equal(both[around], one[around])


def test_the_same_seed_gives_the_same_frames_with_noise() -> None:
    frames = [
        [scene.frame(POSE) for _ in range(2)]
        for scene in (StereoScene(CONE, seed=3), StereoScene(CONE, seed=3))
    ]
    np.testing.assert_array_equal(frames[0], frames[1])
    fresh = frames[0][0].astype(float) - frames[0][1]
    assert fresh.std() == pytest.approx(2.0 * 2**0.5, rel=0.15)


def test_the_bytes_of_the_camera_are_the_frame() -> None:
    data = QUIET.frame_yuyv(POSE)
    np.testing.assert_array_equal(yuyv_luma(data).reshape(376, 1344), QUIET.frame(POSE))
    assert data[1] == data[3] == 128


def test_the_factory_file_is_the_pair_to_the_digit() -> None:
    pair, told = zed_pair(), parse_zed_settings(factory_text(zed_pair()), "VGA")
    np.testing.assert_array_equal(told.left.matrix, pair.left.matrix)
    np.testing.assert_array_equal(told.right.distortion, pair.right.distortion)
    np.testing.assert_allclose(told.rotation, pair.rotation, atol=1e-15)
    np.testing.assert_allclose(told.translation_m, pair.translation, rtol=1e-15)
    np.testing.assert_array_equal(zed_calibration().pair.translation, pair.translation)
