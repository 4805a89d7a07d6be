"""The ChArUco board: a chessboard whose corners have names, so that a part of it will do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from calibration.board import BoardSighting, check_grid
from calibration.errors import CalibrationError
from tracking import Image

if TYPE_CHECKING:
    import cv2

_LEAST_CORNERS = 8


@dataclass(frozen=True)
class CharucoBoard:
    """A ChArUco board of so many *squares*, ArUco dictionary 5X5_250, sides in metres."""

    columns: int = 10
    rows: int = 7
    square_m: float = 0.025
    marker_m: float = 0.018

    def __post_init__(self) -> None:
        check_grid(self.columns, self.rows, self.square_m)
        if not 0.0 < self.marker_m < self.square_m:
            raise CalibrationError(
                f"a marker must be smaller than its square, got marker {self.marker_m} m and "
                f"square {self.square_m} m: are they swapped?"
            )
        if self.columns * self.rows // 2 > 250:
            raise CalibrationError("the dictionary has 250 markers, enough for 500 squares")

    @property
    def radius_m(self) -> float:
        """Corners are points."""
        return 0.0

    def describe(self) -> Mapping[str, object]:
        """Kind and sizes."""
        sizes = {"columns": self.columns, "rows": self.rows}
        lengths = {"square_m": self.square_m, "marker_m": self.marker_m}
        return {"board": "charuco", "dictionary": "5X5_250", **sizes, **lengths}

    def picture(self, pixels_per_square: int) -> Image:
        """The board as it is printed, without a margin."""
        size = (self.columns * pixels_per_square, self.rows * pixels_per_square)
        return np.asarray(self._board.generateImage(size, marginSize=0), np.uint8)

    def find(self, image: Image, name: str) -> BoardSighting | None:
        """The corners that are seen; None for fewer than eight, or all on one line."""
        import cv2

        corners, ids, _, _ = self._detector.detectBoard(image)
        if ids is None or len(ids) < _LEAST_CORNERS:
            return None
        if self._board.checkCharucoCornersCollinear(ids):
            return None
        side = self._side_px(np.asarray(corners).reshape(-1, 2), ids.ravel())
        window = int(np.clip(0.3 * side, 2, 8))
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
        refined = cv2.cornerSubPix(image, corners, (window, window), (-1, -1), stop)
        points = np.asarray(self._board.getChessboardCorners(), np.float64)[ids.ravel()]
        return BoardSighting(name, points, np.asarray(refined, np.float64).reshape(-1, 2))

    def _side_px(self, corners: np.ndarray, ids: np.ndarray) -> float:
        """The shortest side of a square whose two corners are seen; small if there is none."""
        place = {int(i): corner for i, corner in zip(ids, corners, strict=True)}
        wide = self.columns - 1
        sides = [
            float(np.hypot(*(place[i + step] - place[i])))
            for i in place
            for step in (1, wide)
            if i + step in place and (step == wide or (i + 1) % wide)
        ]
        return min(sides, default=7.0)

    @cached_property
    def _board(self) -> cv2.aruco.CharucoBoard:
        import cv2

        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
        size = (self.columns, self.rows)
        return cv2.aruco.CharucoBoard(size, self.square_m, self.marker_m, dictionary)

    @cached_property
    def _detector(self) -> cv2.aruco.CharucoDetector:
        import cv2

        return cv2.aruco.CharucoDetector(self._board)
