from __future__ import annotations

import numpy as np
import pytest

from geometry import Floats, Mounting, turned
from simulation.stereo import ZED_MOUNTING, zed_pair
from visual_odometry.motion import Motion, MotionFit, coarse_motion, fitted_motion
from visual_odometry.mounting import CameraOnCar
from visual_odometry.patches import aligned, patches_at
from visual_odometry.rectification import Eyes, Rectifier

EYES = Eyes(350.0, 336.0, 188.0, 0.12)
TRUE = Motion(turned(np.array([0.004, -0.03, 0.002])), np.array([0.01, -0.003, -0.09]))


def sights(count: int = 200, seed: int = 0) -> tuple[Floats, Floats]:
    """Points before and after a motion, as a rectified pair sees them."""
    rng = np.random.default_rng(seed)
    rays = rng.uniform((-0.8, -0.3), (0.8, 0.5), (count, 2))
    points = np.column_stack([rays, np.ones(count)]) * rng.uniform(0.5, 5.0, (count, 1))
    return EYES.seen(points), EYES.seen(TRUE.applied(points))


def off(fit: MotionFit) -> Floats:
    """(6,): the true motion as a step from the fitted one."""
    rotation = TRUE.rotation @ fit.motion.rotation.T
    turn = np.array([rotation[2, 1], rotation[0, 2], rotation[1, 0]])
    return np.concatenate([TRUE.translation - rotation @ fit.motion.translation, turn])


def test_points_and_their_sights_are_inverse() -> None:
    before, _ = sights()
    np.testing.assert_allclose(EYES.seen(EYES.points(before)), before, atol=1e-9)


def test_an_exact_motion_is_found_exactly() -> None:
    before, after = sights()
    fit = fitted_motion(before, after, EYES, Motion.none(), 0.1)
    np.testing.assert_allclose(fit.motion.rotation, TRUE.rotation, atol=1e-6)
    np.testing.assert_allclose(fit.motion.translation, TRUE.translation, atol=1e-6)
    assert fit.inliers.all()


def test_wrong_matches_change_nothing() -> None:
    before, after = sights()
    after[:40] += np.random.default_rng(1).uniform(5.0, 30.0, (40, 3))
    points = EYES.points(before)
    found = coarse_motion(points, after, EYES, Motion.none(), 2.0)
    assert found is not None
    motion, agree = found
    assert not agree[:40].any()
    fit = fitted_motion(before, after, EYES, motion, 0.1)
    assert not fit.inliers[:40].any()
    assert fit.inliers[40:].mean() > 0.99
    np.testing.assert_allclose(fit.motion.translation, TRUE.translation, atol=1e-5)


def test_without_agreement_there_is_no_motion() -> None:
    before, _ = sights(30)
    rng = np.random.default_rng(2)
    found = coarse_motion(EYES.points(before), rng.uniform(0, 600, (30, 3)), EYES, TRUE, 2.0)
    assert found is None or found[1].sum() < 12
    assert coarse_motion(EYES.points(before[:4]), before[:4], EYES, TRUE, 2.0) is None


def test_the_covariance_is_that_of_many_trials() -> None:
    before, after = sights()
    rng = np.random.default_rng(3)
    squared, sigmas = [], []
    for _ in range(200):
        noise = rng.normal(0.0, 0.15, (2, *before.shape))
        fit = fitted_motion(before + noise[0], after + noise[1], EYES, TRUE, 0.1)
        step = off(fit)
        squared.append(step @ np.linalg.solve(fit.covariance, step))
        sigmas.append(fit.sigma_px)
    assert np.mean(squared) == pytest.approx(6.0, rel=0.25)
    assert np.mean(sigmas) == pytest.approx(0.15, rel=0.1)


@pytest.mark.parametrize("pose", [(0.1, -0.02, 0.05), (0.0, 0.0, 0.0), (-0.2, 0.1, -1.2)])
def test_the_cars_motion_and_the_cameras_are_inverse(pose: tuple[float, float, float]) -> None:
    mounting = Mounting(x_m=0.2, y_m=0.06, z_m=0.22, roll_rad=0.02, pitch_rad=0.2, yaw_rad=-0.1)
    car = CameraOnCar(mounting, turned(np.array([0.01, -0.02, 0.003])))
    motion = car.camera_motion(np.array(pose))
    told = car.car_motion(MotionFit(motion, np.eye(6), np.ones(1, bool), 0.1))
    np.testing.assert_allclose(told.pose, pose, atol=1e-12)
    assert told.tilt_rad == pytest.approx(0.0, abs=1e-6)
    assert told.rise_m == pytest.approx(0.0, abs=1e-12)


def test_the_covariance_of_the_car_follows_the_slopes() -> None:
    car = CameraOnCar(ZED_MOUNTING, np.eye(3))
    motion = car.camera_motion(np.array([0.1, 0.02, 0.2]))
    size = 1e-6

    def pose(step: Floats) -> Floats:
        fit = MotionFit(motion.stepped(step), np.eye(6), np.ones(1, bool), 0.1)
        return car.car_motion(fit).pose

    slopes = np.stack(
        [(pose(size * row) - pose(-size * row)) / (2.0 * size) for row in np.eye(6)], axis=1
    )
    told = car.car_motion(MotionFit(motion, np.diag(np.arange(1.0, 7.0)), np.ones(1, bool), 0.1))
    np.testing.assert_allclose(
        told.covariance, slopes @ np.diag(np.arange(1.0, 7.0)) @ slopes.T, atol=1e-6
    )


def test_rectified_eyes_see_a_point_on_one_row_and_its_depth() -> None:
    pair = zed_pair()
    rectifier = Rectifier(pair)
    rng = np.random.default_rng(4)
    points = rng.uniform((-0.3, -0.2, 0.8), (0.3, 0.2, 3.0), (50, 3))
    seen = rectifier.eyes.seen(points @ rectifier.turn.T)
    maps = rectifier.eyes
    assert maps.baseline_m == pytest.approx(pair.baseline_m, rel=1e-9)
    # A picture of one bright dot per point is the dot where the pinhole model says.
    for point, (left_u, v, right_u) in zip(points[:8], seen[:8], strict=True):
        width, height = pair.eye_size_px
        picture = np.zeros((height, 2 * width), np.uint8)
        at_left = pair.left.project(point)
        at_right = pair.right.project(pair.rotation @ point + pair.translation)
        for (u, w), start in ((at_left, 0), (at_right, width)):
            y, x = np.mgrid[:height, :width]
            dot = 250.0 * np.exp(-((x - u) ** 2 + (y - w) ** 2) / (2.0 * 2.0**2))
            picture[:, start : start + width] = np.rint(dot).astype(np.uint8)
        for eye, expected in zip(rectifier.rectified(picture), (left_u, right_u), strict=True):
            weight = eye.astype(float)
            y, x = np.mgrid[:height, :width]
            middle = (weight * x).sum() / weight.sum(), (weight * y).sum() / weight.sum()
            np.testing.assert_allclose(middle, (expected, v), atol=0.1)


def test_a_patch_is_brought_to_its_place_though_it_is_bent_and_dimmed() -> None:
    import cv2

    rng = np.random.default_rng(5)
    fine = cv2.GaussianBlur(rng.normal(120.0, 60.0, (120, 160)).astype(np.float32), (0, 0), 2.0)
    image = np.clip(fine * 3.0 - 240.0, 0.0, 255.0).astype(np.uint8)
    points = np.array([[60.0, 60.0], [80.0, 50.0], [100.0, 70.0]])
    bent = np.array([[1.15, 0.1], [-0.05, 1.1]])
    shift = np.array([3.3, -1.7])
    matrix = np.column_stack([bent, shift - bent @ points[0] + points[0]])
    seen = cv2.warpAffine(image, matrix, (160, 120), flags=cv2.INTER_CUBIC)
    dimmed = np.asarray(cv2.convertScaleAbs(seen, alpha=0.6, beta=20.0), np.uint8)
    true = points @ bent.T + matrix[:, 2]
    patches = patches_at(image, points)
    found, alike = aligned(
        patches, dimmed, true + np.array([0.8, -0.7]), np.broadcast_to(bent, (3, 2, 2))
    )
    np.testing.assert_allclose(found, true, atol=0.1)
    assert (alike > 0.95).all()
    _, other = aligned(patches, image[::-1].copy(), points, np.broadcast_to(np.eye(2), (3, 2, 2)))
    assert (other < 0.8).all()
