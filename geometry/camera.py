"""A camera: how a point becomes a pixel, and which ray a pixel saw.

Pinhole with the five coefficients of OpenCV (k1, k2, p1, p2, k3; Brown, Decentering Distortion of
Lenses, 1966). Pixel (0, 0) is the *middle* of the first pixel, as in OpenCV. The camera looks along
its z, its x goes right and its y down in the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.angles import Floats
from geometry.errors import CameraError
from geometry.trajectory import frozen

_PRECISION_PX = 1e-11
_MAX_STEPS = 40


@dataclass(frozen=True)
class Camera:
    """The inside of a camera: focal lengths and principal point in pixels, distortion, image size.

    distortion : (k1, k2, p1, p2, k3). Raises `CameraError` for what is no camera.
    """

    width_px: int
    height_px: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if len(self.distortion) != 5 or not np.isfinite(numbers).all():
            raise CameraError(
                f"a camera needs 4 finite numbers and 5 distortion coefficients, got {numbers}"
            )
        if min(self.width_px, self.height_px) < 1 or min(self.fx, self.fy) <= 0.0:
            raise CameraError(
                f"image size {self.width_px}x{self.height_px} and focal lengths {self.fx}, "
                f"{self.fy} must be positive"
            )

    @property
    def matrix(self) -> Floats:
        """The 3 x 3 camera matrix of every other program."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def distorted(self, plane: Floats) -> Floats:
        """Pixels (..., 2) of points (..., 2) on the plane z = 1."""
        k1, k2, p1, p2, k3 = self.distortion
        tangential = np.array([p2, p1])
        r2 = np.einsum("...i,...i->...", plane, plane)
        scale = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)) + 2.0 * (plane @ tangential)
        bent = plane * scale[..., None] + r2[..., None] * tangential
        pixels: Floats = bent * (self.fx, self.fy) + (self.cx, self.cy)
        return pixels

    def distortion_jacobian(self, plane: Floats) -> Floats:
        """D pixel / d plane, (..., 2, 2), at points (..., 2) on the plane z = 1."""
        x, y = plane[..., 0], plane[..., 1]
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))
        cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
        jacobian = np.empty((*x.shape, 2, 2))
        jacobian[..., 0, 0] = self.fx * (radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x)
        jacobian[..., 0, 1] = self.fx * cross
        jacobian[..., 1, 0] = self.fy * cross
        jacobian[..., 1, 1] = self.fy * (radial + slope * y * y + 2.0 * p2 * x + 6.0 * p1 * y)
        return jacobian

    def undistorted(self, pixels: Floats) -> Floats:
        """Points (..., 2) on the plane z = 1 that these pixels saw; exact to 1e-10 px.

        Newton's method from the undistorted guess. NaN where no point of the lens's usable part
        maps to the pixel: a polynomial that folds back describes no ray out there.
        """
        pixels = np.asarray(pixels, dtype=np.float64)
        plane = (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
        if not any(self.distortion):
            return plane
        # Far outside of the lens's usable part the steps run away; that is told by NaN.
        with np.errstate(over="ignore", invalid="ignore"):
            miss = pixels - self.distorted(plane)
            for _ in range(_MAX_STEPS):
                if np.abs(miss).max(initial=0.0) < _PRECISION_PX:
                    break
                plane = plane + _solved(self.distortion_jacobian(plane), miss)
                miss = pixels - self.distorted(plane)
            folded = ~(_determinant(self.distortion_jacobian(plane)) > 0.0)
        lost = folded | ~(np.abs(miss).max(axis=-1) < 10.0 * _PRECISION_PX)
        return np.where(lost[..., None], np.nan, plane)

    def project(self, points_camera: Floats) -> Floats:
        """Pixels (..., 2) of points (..., 3) in the camera's frame; NaN behind the camera."""
        z = points_camera[..., 2:]
        return self.distorted(points_camera[..., :2] / np.where(z > 0.0, z, np.nan))


@dataclass(frozen=True, eq=False)
class View:
    """A camera in its place.

    rotation : (3, 3), translation : (3,) metres carry world into camera: `R X + t`. Raises
    `CameraError` when the rotation is none.
    """

    camera: Camera
    rotation: Floats
    translation: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen(self.rotation, np.float64))
        object.__setattr__(self, "translation", frozen(self.translation, np.float64))
        if self.rotation.shape != (3, 3) or self.translation.shape != (3,):
            raise CameraError(
                f"rotation and translation have shapes {self.rotation.shape} and "
                f"{self.translation.shape}, expected (3, 3) and (3,)"
            )
        product = self.rotation @ self.rotation.T
        proper = np.allclose(product, np.eye(3), atol=1e-9) and np.linalg.det(self.rotation) > 0.0
        if not (proper and np.isfinite(self.translation).all()):
            raise CameraError(f"not a rotation and a translation: {self.rotation.tolist()}")

    @property
    def position(self) -> Floats:
        """Where the camera stands in the world, (3,) metres."""
        return -self.rotation.T @ self.translation

    def project(self, points_world: Floats) -> Floats:
        """Pixels (..., 2) of world points (..., 3); NaN behind the camera."""
        return self.camera.project(points_world @ self.rotation.T + self.translation)

    def on_plane(self, pixels: Floats, height_m: float | Floats) -> Floats:
        """World x, y (..., 2) where the rays of pixels (..., 2) meet the plane z = height.

        height : a number or shape (...,). NaN where the ray does not meet it before the camera.
        """
        plane = self.camera.undistorted(pixels)
        directions = plane @ self.rotation[:2] + self.rotation[2]
        position = self.position
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (np.asarray(height_m) - position[2]) / directions[..., 2]
        along = np.where(along > 0.0, along, np.nan)
        xy: Floats = position[:2] + along[..., None] * directions[..., :2]
        return xy

    def plane_jacobian(self, xy: Floats, height_m: float | Floats) -> Floats:
        """D pixel / d (x, y) at world points (..., 2) of the plane z = height, (..., 2, 2)."""
        points = at_height(xy, height_m) @ self.rotation.T + self.translation
        z = points[..., 2]
        plane = points[..., :2] / z[..., None]
        slope = (self.rotation[:2, :2] - plane[..., None] * self.rotation[2, :2]) / z[
            ..., None, None
        ]
        jacobian: Floats = self.camera.distortion_jacobian(plane) @ slope
        return jacobian


def at_height(xy: Floats, height_m: float | Floats) -> Floats:
    """Points (..., 3) from x, y (..., 2) and one height or one for each."""
    height = np.broadcast_to(np.asarray(height_m, dtype=np.float64), xy.shape[:-1])
    return np.concatenate([xy, height[..., None]], axis=-1)


def looking_at(camera: Camera, position_m: Floats, target_m: Floats, up: Floats) -> View:
    """The view from a position (3,) towards a target (3,), `up` (3,) being up in the image.

    Raises `CameraError` when position and target coincide or `up` is along the line of sight.
    """
    forward = np.asarray(target_m, dtype=np.float64) - position_m
    right = np.cross(forward, up)
    lengths = float(np.linalg.norm(forward)), float(np.linalg.norm(right))
    if lengths[1] < 1e-9 * max(lengths[0], 1e-9):
        raise CameraError("the camera must look somewhere, and not along `up`")
    forward, right = forward / lengths[0], right / lengths[1]
    rotation = np.stack([right, np.cross(forward, right), forward])
    return View(camera, rotation, -rotation @ np.asarray(position_m, dtype=np.float64))


def _solved(matrices: Floats, right: Floats) -> Floats:
    """Solutions of 2 x 2 systems (..., 2, 2), (..., 2), many times faster than LAPACK's."""
    a, b = matrices[..., 0, 0], matrices[..., 0, 1]
    c, d = matrices[..., 1, 0], matrices[..., 1, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / _determinant(matrices)
    x = scale * (d * right[..., 0] - b * right[..., 1])
    y = scale * (a * right[..., 1] - c * right[..., 0])
    return np.stack([x, y], axis=-1)


def _determinant(matrices: Floats) -> Floats:
    product: Floats = matrices[..., 0, 0] * matrices[..., 1, 1]
    return product - matrices[..., 0, 1] * matrices[..., 1, 0]
