"""The chessboard: the oldest target, and the one in everybody's drawer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calibration.board import BoardSighting, check_grid, grid_points
from tracking import Image

_WINDOW_OF_SQUARE = 0.4
_LARGEST_WINDOW_PX = 11


@dataclass(frozen=True)
class Chessboard:
    """A chessboard of so many *inner* corners, the side of a square in metres."""

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        check_grid(self.columns, self.rows, self.square_m)

    @property
    def radius_m(self) -> float:
        """Corners are points."""
        return 0.0

    def describe(self) -> Mapping[str, object]:
        """Kind and sizes."""
        return {"board": "chessboard", "columns": self.columns, "rows": self.rows,
                "square_m": self.square_m}  # fmt: skip

    def find(self, image: Image, name: str) -> BoardSighting | None:
        """All of its inner corners, to a few hundredths of a pixel; None if one is missing."""
        import cv2

        found, corners = cv2.findChessboardCorners(image, (self.columns, self.rows))
        if not found:
            return None
        grid = corners.reshape(self.rows, self.columns, 2)
        side = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
        window = int(np.clip(_WINDOW_OF_SQUARE * side, 2, _LARGEST_WINDOW_PX))
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
        refined = cv2.cornerSubPix(image, corners, (window, window), (-1, -1), stop)
        points = grid_points(self.columns, self.rows, self.square_m)
        return BoardSighting(name, points, np.asarray(refined, np.float64).reshape(-1, 2))
