"""Where a camera stands, from points of a plane that it saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.angles import Floats
from geometry.camera import Camera, View
from geometry.errors import CameraError

_MAX_STEPS = 50
_MIN_SPREAD = 1e-3


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A view fitted to points, and how well.

    residuals_px : (n, 2) seen minus predicted; covariance : (6, 6) of a small turn of the camera
    (three radians, `R <- exp(turn) R`) and of its translation (metres), if every coordinate of
    every pixel had a standard deviation of one pixel: multiply by the variance it has.
    """

    view: View
    residuals_px: Floats
    covariance: Floats


def fit_homography(source: Floats, target: Floats) -> Floats:
    """The 3 x 3 map, H[2, 2] = 1 where it can be, from points (n, 2) to points (n, 2), n >= 4.

    Least squares of the algebraic error after normalisation (Hartley and Zisserman, Multiple View
    Geometry, 2nd ed., algorithm 4.2). Raises `CameraError` for fewer points or collinear ones.
    """
    if len(source) < 4 or source.shape != target.shape:
        raise CameraError(f"a plane's image needs at least 4 pairs of points, got {len(source)}")
    to_source, to_target = _normalising(source), _normalising(target)
    s, t = apply_homography(to_source, source), apply_homography(to_target, target)
    one, zero = np.ones(len(s)), np.zeros((len(s), 3))
    row = np.column_stack([s, one])
    upper = np.hstack([row, zero, -t[:, :1] * row])
    lower = np.hstack([zero, row, -t[:, 1:] * row])
    _, singular, vectors = np.linalg.svd(np.vstack([upper, lower]))
    if singular[7] < 1e-7 * singular[0]:
        raise CameraError("the points do not fix a plane: three of four lie on one line")
    found = np.linalg.inv(to_target) @ vectors[8].reshape(3, 3) @ to_source
    scale = found[2, 2] if abs(found[2, 2]) > 1e-12 * np.abs(found).max() else 1.0
    homography: Floats = found / scale
    return homography


def apply_homography(homography: Floats, points: Floats) -> Floats:
    """The images (..., 2) of points (..., 2)."""
    mapped = points @ homography[:, :2].T + homography[:, 2]
    images: Floats = mapped[..., :2] / mapped[..., 2:]
    return images


def fit_planar_view(camera: Camera, points_world: Floats, pixels: Floats) -> PoseFit:
    """Where the camera stands, from n >= 4 points (n, 3) of one height and their pixels (n, 2).

    The plane's homography gives the start, `refine_view` the answer. Raises `CameraError` for
    fewer than four points, collinear ones, unequal heights, or pixels that no ray explains.
    """
    points_world = np.asarray(points_world, dtype=np.float64)
    heights = points_world[:, 2]
    if np.ptp(heights) > _MIN_SPREAD * max(np.ptp(points_world[:, :2]), 1e-9):
        raise CameraError(
            f"the points must have one height, theirs run from {heights.min():.3f} to "
            f"{heights.max():.3f} m; fit the view to those of one plane, then refine it with all"
        )
    plane = camera.undistorted(pixels)
    if not np.isfinite(plane).all():
        raise CameraError("a pixel lies where this lens sees nothing: is it this camera's image?")
    homography = fit_homography(points_world[:, :2], plane)
    # A point in front of the camera has a positive depth: that settles the sign.
    depth = points_world[:, :2] @ homography[2, :2] + homography[2, 2]
    homography = homography if np.median(depth) > 0.0 else -homography
    homography = homography * 2.0 / np.linalg.norm(homography[:, :2], axis=0).sum()
    first, second = homography[:, 0], homography[:, 1]
    u, _, v = np.linalg.svd(np.column_stack([first, second, np.cross(first, second)]))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    translation = homography[:, 2] - rotation[:, 2] * heights.mean()
    return refine_view(View(camera, rotation, translation), points_world, pixels)


def refine_view(start: View, points_world: Floats, pixels: Floats) -> PoseFit:
    """The view near `start` with the least squared pixel residuals; points (n, 3) of any height.

    Levenberg-Marquardt over turn and translation. Raises `CameraError` when nothing fits.
    """
    view, damping = start, 1e-6
    residuals = pixels - view.project(points_world)
    if not np.isfinite(residuals).all():
        raise CameraError("the start of the fit puts a point behind the camera")
    for _ in range(_MAX_STEPS):
        jacobian = _pose_jacobian(view, points_world)
        normal = jacobian.T @ jacobian
        gradient = jacobian.T @ residuals.ravel()
        damped = normal + damping * np.diag(np.diag(normal))
        step: Floats = np.asarray(np.linalg.solve(damped, gradient), np.float64)
        trial = _moved(view, step)
        missed = pixels - trial.project(points_world)
        better = np.isfinite(missed).all() and (missed**2).sum() <= (residuals**2).sum()
        if better:
            view, residuals, damping = trial, missed, damping / 10.0
        elif damping > 1e6:
            break
        else:
            damping *= 10.0
        if np.abs(step).max() < 1e-12:
            break
    jacobian = _pose_jacobian(view, points_world)
    covariance = np.asarray(np.linalg.pinv(jacobian.T @ jacobian), np.float64)
    return PoseFit(view, residuals, covariance)


def turned(turn_rad: Floats) -> Floats:
    """The rotation matrix of a rotation vector (3,): Rodrigues' formula."""
    angle = float(np.linalg.norm(turn_rad))
    cross = np.array(
        [
            [0.0, -turn_rad[2], turn_rad[1]],
            [turn_rad[2], 0.0, -turn_rad[0]],
            [-turn_rad[1], turn_rad[0], 0.0],
        ]
    )
    # sinc keeps the small angles exact.
    first, half = np.sinc(angle / np.pi), np.sinc(angle / (2.0 * np.pi))
    rotation: Floats = np.eye(3) + first * cross + 0.5 * half**2 * cross @ cross
    return rotation


def _moved(view: View, step: Floats) -> View:
    rotation = turned(step[:3]) @ view.rotation
    # Products of rotations drift; the nearest rotation does not.
    u, _, v = np.linalg.svd(rotation)
    return View(view.camera, u @ v, view.translation + step[3:])


def _pose_jacobian(view: View, points_world: Floats) -> Floats:
    """D pixel / d (turn, translation), (2 n, 6)."""
    rotated = points_world @ view.rotation.T
    points = rotated + view.translation
    z = points[:, 2]
    plane = points[:, :2] / z[:, None]
    slope = np.zeros((len(points), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = 1.0 / z
    slope[:, :, 2] = -plane / z[:, None]
    slope = view.camera.distortion_jacobian(plane) @ slope
    turn = np.cross(np.eye(3)[None], rotated[:, None, :]).transpose(0, 2, 1)
    return np.concatenate([slope @ turn, slope], axis=2).reshape(-1, 6)


def _normalising(points: Floats) -> Floats:
    """The similarity that puts the centroid at the origin and the mean distance at sqrt(2)."""
    centre = points.mean(axis=0)
    distance = np.linalg.norm(points - centre, axis=1).mean()
    if not distance > 0.0:
        raise CameraError("all points coincide")
    scale = np.sqrt(2.0) / distance
    return np.array([[scale, 0.0, -scale * centre[0]], [0.0, scale, -scale * centre[1]], [0, 0, 1]])
