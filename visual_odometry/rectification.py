"""Both eyes brought into line: a point is on one row of both, and its disparity tells its depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, StereoPair
from visual_odometry.errors import VisualOdometryError

Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Eyes:
    """A rectified pair: one focal length, one principal point, pixels; the baseline in metres."""

    focal_px: float
    cx: float
    cy: float
    baseline_m: float

    def points(self, seen: Floats) -> Floats:
        """Points (n, 3) in the left eye's frame from (u left, v, u right) (n, 3)."""
        scale = self.baseline_m / (seen[:, 0] - seen[:, 2])
        rays = np.stack(
            [seen[:, 0] - self.cx, seen[:, 1] - self.cy, np.full(len(seen), self.focal_px)], axis=1
        )
        return rays * scale[:, None]

    def seen(self, points: Floats) -> Floats:
        """(u left, v, u right) (n, 3) of points (n, 3) in the left eye's frame."""
        x, y, z = points.T
        scale = self.focal_px / z
        across = x * scale + self.cx
        return np.stack([across, y * scale + self.cy, across - self.baseline_m * scale], axis=1)

    @property
    def matrix(self) -> Floats:
        """The 3 x 3 camera matrix of either eye."""
        return np.array(
            [[self.focal_px, 0.0, self.cx], [0.0, self.focal_px, self.cy], [0.0, 0.0, 1.0]]
        )


class Rectifier:
    """Maps of a calibrated pair, made once.

    turn : (3, 3), from the left camera's frame into that of the rectified left eye.
    """

    def __init__(self, pair: StereoPair) -> None:
        import cv2

        self.size_px = pair.eye_size_px
        lenses = [
            (camera.matrix, np.array(camera.distortion)) for camera in (pair.left, pair.right)
        ]
        turns_and_projections = cv2.stereoRectify(
            *lenses[0], *lenses[1], self.size_px, np.array(pair.rotation),
            np.array(pair.translation), flags=cv2.CALIB_ZERO_DISPARITY, alpha=0.0,
        )  # fmt: skip
        turns = [np.asarray(turn, np.float64) for turn in turns_and_projections[:2]]
        projections = [np.asarray(one, np.float64) for one in turns_and_projections[2:4]]
        left, right = projections
        self.turn: Floats = turns[0]
        self.eyes = Eyes(
            float(left[0, 0]), float(left[0, 2]), float(left[1, 2]),
            -float(right[0, 3] / right[0, 0]),
        )  # fmt: skip
        # Fixed-point maps: half the memory, and twice the speed.
        self._maps = [
            cv2.initUndistortRectifyMap(*lens, turn, projection, self.size_px, cv2.CV_16SC2)
            for lens, turn, projection in zip(lenses, turns, projections, strict=True)
        ]

    def rectified(self, picture: Image) -> tuple[Image, Image]:
        """Left and right eye of a side-by-side picture; raises `VisualOdometryError` for others."""
        import cv2

        width, height = self.size_px
        if picture.shape != (height, 2 * width):
            raise VisualOdometryError(
                f"a picture has {picture.shape[1]}x{picture.shape[0]} pixels, the calibration is "
                f"for two eyes of {width}x{height} side by side; calibrate in the mode of the "
                "recording (trackside calibrate stereo)"
            )
        halves = picture[:, :width], picture[:, width:]
        left, right = (
            np.asarray(cv2.remap(half, *maps, cv2.INTER_LINEAR), np.uint8)
            for half, maps in zip(halves, self._maps, strict=True)
        )
        return left, right
