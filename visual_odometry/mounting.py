"""The motion of the camera as the plane motion of the car that carries it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats, Mounting
from visual_odometry.motion import Motion, MotionFit


@dataclass(frozen=True, eq=False)
class CarMotion:
    """Motion of base_link: pose (x, y, heading) and covariance (3, 3), tilt and rise left over."""

    pose: Floats
    covariance: Floats
    tilt_rad: float
    rise_m: float


class CameraOnCar:
    """A rectified left eye in base_link.

    up : (3,), the car's z in the eye's frame; height_m : of the eye above base_link.
    """

    def __init__(self, mounting: Mounting, turn: Floats) -> None:
        self._rotation = mounting.rotation @ turn.T
        self._position = mounting.position
        self.up: Floats = self._rotation[2].copy()
        self.height_m = mounting.z_m
        self._base = -self._rotation.T @ self._position
        """base_link's origin in the eye's frame."""

    def camera_motion(self, pose: Floats) -> Motion:
        """What carries points of the eye into its frame after the car moved by `pose` (3,)."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        # x' = Rc^T (R^T (Rc x + p - d) - p)
        rotation = self._rotation.T @ turn.T @ self._rotation
        move = np.array([pose[0], pose[1], 0.0])
        shifted = turn.T @ (self._position - move) - self._position
        return Motion(rotation, self._rotation.T @ shifted)

    def car_motion(self, fit: MotionFit, covariance_factor: float = 1.0) -> CarMotion:
        """The same for base_link, from where it was at the key frame."""
        back = fit.motion.rotation.T
        turn = self._rotation @ back @ self._rotation.T
        origin = back @ (self._base - fit.motion.translation)
        there = self._rotation @ origin + self._position
        pose = np.array([there[0], there[1], np.arctan2(turn[1, 0], turn[0, 0])])
        tilt = float(np.arccos(np.clip(turn[2, 2], -1.0, 1.0)))
        slopes = self._slopes(self._rotation @ back)
        covariance: Floats = covariance_factor * (slopes @ fit.covariance @ slopes.T)
        return CarMotion(pose, covariance, tilt, float(there[2]))

    def _slopes(self, outward: Floats) -> Floats:
        """(3, 6): d pose / d (translation, turn) of `Motion.stepped`; outward : new eye to car."""
        x, y, z = self._base
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        slopes = np.empty((3, 6))
        slopes[:2, :3] = -outward[:2]
        slopes[:2, 3:] = outward[:2] @ cross
        slopes[2, :3] = 0.0
        slopes[2, 3:] = -outward[2]
        return slopes
