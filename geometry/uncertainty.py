"""How a camera's pixels, and places on the floor seen by it, depend on its fifteen parameters.

Order: fx, fy, cx, cy, k1, k2, p1, p2, k3 (that of OpenCV), then a small turn of the camera (three
radians, `R <- exp(turn) R`) and its translation (metres).
"""

from __future__ import annotations

import numpy as np

from geometry.angles import Floats
from geometry.camera import Camera, View, at_height

INTRINSICS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


def intrinsics_of(camera: Camera) -> Floats:
    """The nine parameters of a camera."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion])


def camera_of(intrinsics: Floats, width_px: int, height_px: int) -> Camera:
    """The camera with these nine parameters."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = intrinsics.tolist()
    return Camera(width_px, height_px, fx, fy, cx, cy, (k1, k2, p1, p2, k3))


def intrinsics_jacobian(camera: Camera, plane: Floats) -> Floats:
    """Slopes d pixel / d intrinsics, (..., 2, 9), at points (..., 2) on the plane z = 1."""
    x, y = plane[..., 0], plane[..., 1]
    r2 = x * x + y * y
    bent = (camera.distorted(plane) - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    jacobian = np.zeros((*x.shape, 2, 9))
    for axis, focal in enumerate((camera.fx, camera.fy)):
        jacobian[..., axis, axis] = bent[..., axis]
        jacobian[..., axis, 2 + axis] = 1.0
        for column, power in ((4, r2), (5, r2**2), (8, r2**3)):
            jacobian[..., axis, column] = focal * plane[..., axis] * power
        own = focal * (r2 + 2.0 * plane[..., axis] ** 2)
        cross = focal * 2.0 * x * y
        jacobian[..., axis, 6] = own if axis else cross
        jacobian[..., axis, 7] = cross if axis else own
    return jacobian


def view_jacobian(view: View, points_world: Floats) -> Floats:
    """Slopes d pixel / d parameters of camera and place, (..., 2, 15), at world points (..., 3)."""
    rotated = points_world @ view.rotation.T
    points = rotated + view.translation
    z = points[..., 2]
    plane = points[..., :2] / z[..., None]
    slope = np.zeros((*z.shape, 2, 3))
    slope[..., 0, 0] = slope[..., 1, 1] = 1.0 / z
    slope[..., :, 2] = -plane / z[..., None]
    slope = view.camera.distortion_jacobian(plane) @ slope
    turn = np.swapaxes(np.cross(np.eye(3), rotated[..., None, :]), -1, -2)
    return np.concatenate([intrinsics_jacobian(view.camera, plane), slope @ turn, slope], axis=-1)


def floor_covariance(
    view: View, covariance: Floats, xy: Floats, height_m: float | Floats, height_sigma_m: float = 0
) -> Floats:
    """Covariance (..., 2, 2) of places (..., 2) at a height, found with an uncertain camera.

    covariance : (15, 15) of the parameters. height_sigma_m : how well the height is known. The
    share of the image's noise is not included.
    """
    points = at_height(xy, height_m)
    to_floor = np.linalg.inv(view.plane_jacobian(xy, height_m))
    moved = -to_floor @ view_jacobian(view, points)
    along = points - view.position
    slide = along[..., :2] / along[..., 2:] * height_sigma_m
    result: Floats = moved @ covariance @ np.swapaxes(moved, -1, -2)
    return result + slide[..., :, None] * slide[..., None, :]
