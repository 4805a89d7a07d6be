"""Two cameras side by side, and where a camera sits on a car."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geometry.angles import Floats
from geometry.camera import Camera
from geometry.errors import CameraError
from geometry.trajectory import frozen

_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""A camera's axes (right, down, ahead) in those of a body (ahead, left, up)."""


@dataclass(frozen=True, eq=False)
class StereoPair:
    """Two cameras; x_right = rotation @ x_left + translation, in a camera's axes.

    rotation : (3, 3); translation : (3,) metres, its first below 0 as the right camera is to the
    right. Raises `CameraError` for what is no such pair.
    """

    left: Camera
    right: Camera
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
        straight = np.allclose(self.rotation @ self.rotation.T, np.eye(3), atol=1e-9)
        if not straight or np.linalg.det(self.rotation) < 0.0:
            raise CameraError(f"not a rotation: {self.rotation.tolist()}")
        if not self.translation[0] < 0.0 or not np.isfinite(self.translation).all():
            raise CameraError(
                f"translation {self.translation.tolist()}: the right camera must be to the right "
                "of the left one (x below 0); are the eyes swapped?"
            )
        if (self.left.width_px, self.left.height_px) != (
            self.right.width_px,
            self.right.height_px,
        ):
            raise CameraError("the two cameras of a pair must have pictures of one size")

    @property
    def baseline_m(self) -> float:
        """How far the cameras are apart."""
        return float(np.linalg.norm(self.translation))

    @property
    def eye_size_px(self) -> tuple[int, int]:
        """Width and height of one picture."""
        return self.left.width_px, self.left.height_px


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Where a camera sits on the car: its pose in base_link, metres and radians.

    Without any turn it looks ahead, upright. pitch_rad > 0 looks down, yaw_rad > 0 to the left,
    roll_rad > 0 leans to the right (REP 103: turned by roll, then pitch, then yaw).
    """

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    roll_rad: float = field(default=0.0, metadata={"min": -np.pi, "max": np.pi})
    pitch_rad: float = field(default=0.0, metadata={"min": -np.pi / 2, "max": np.pi / 2})
    yaw_rad: float = field(default=0.0, metadata={"min": -np.pi, "max": np.pi})

    @property
    def position(self) -> Floats:
        """(3,) in base_link."""
        return np.array([self.x_m, self.y_m, self.z_m])

    @property
    def rotation(self) -> Floats:
        """(3, 3): from the camera's axes (right, down, ahead) into base_link's."""
        roll, pitch, yaw = self.roll_rad, self.pitch_rad, self.yaw_rad
        about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)],
                            [0, np.sin(roll), np.cos(roll)]])  # fmt: skip
        about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0],
                            [-np.sin(pitch), 0, np.cos(pitch)]])  # fmt: skip
        about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0],
                            [0, 0, 1]])  # fmt: skip
        turned: Floats = about_z @ about_y @ about_x @ _OPTICAL
        return turned
