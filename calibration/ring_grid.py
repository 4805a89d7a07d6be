"""A grid of rings: the same eyes that track find the board, to a hundredth of a pixel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calibration.board import BoardSighting, check_grid, grid_points
from calibration.errors import CalibrationError
from geometry import Floats, RingShape, apply_homography, fit_homography
from tracking import Image, RingSearch, find_rings

_SMALLEST_PX = 10.0
_OFF_GRID = 0.25
"""Of a spacing: how far a ring may lie from its place in the grid."""


@dataclass(frozen=True)
class RingGrid:
    """So many rings in columns and rows, not equally many, `spacing_m` from middle to middle.

    A grid turned by half a turn looks the same, which does a calibration no harm; a square one
    turned by a quarter does too, and would be mistaken.
    """

    columns: int = 6
    rows: int = 4
    spacing_m: float = 0.045
    shape: RingShape = field(default_factory=lambda: RingShape(0.030, 0.0123, 1.35))

    def __post_init__(self) -> None:
        check_grid(self.columns, self.rows, self.spacing_m, least=2)
        if self.columns == self.rows:
            raise CalibrationError("a ring grid must not have as many columns as rows")
        if self.spacing_m < self.shape.diameter_m * 1.3:
            raise CalibrationError(
                f"rings of {self.shape.diameter_m} m need 1.3 diameters from middle to middle, "
                f"got {self.spacing_m} m"
            )

    @property
    def radius_m(self) -> float:
        """Of the outer edges, whose middles are measured."""
        return self.shape.radius_m

    def describe(self) -> Mapping[str, object]:
        """Kind and sizes."""
        return {"board": "rings", "columns": self.columns, "rows": self.rows,
                "spacing_m": self.spacing_m, "diameter_m": self.shape.diameter_m,
                "inner_diameter_m": self.shape.inner_diameter_m}  # fmt: skip

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the sheet: half a spacing around the outer rings' middles."""
        return self.columns * self.spacing_m, self.rows * self.spacing_m

    def picture(self, metres_per_pixel: float) -> Image:
        """The sheet as it is printed; the first ring's middle half a spacing from its corner."""
        cell = round(self.spacing_m / metres_per_pixel)
        along = (np.arange(cell) + 0.5) * (self.spacing_m / cell) - self.spacing_m / 2.0
        radius = np.hypot(along, along[:, None])

        def inside(diameter_m: float) -> Floats:
            share = 0.5 + (diameter_m / 2.0 - radius) / metres_per_pixel
            return np.asarray(np.clip(share, 0.0, 1.0))

        black = inside(self.shape.diameter_m) - inside(self.shape.inner_diameter_m)
        one = np.rint(255.0 * (1.0 - black)).astype(np.uint8)
        return np.tile(one, (self.rows, self.columns))

    def find(self, image: Image, name: str) -> BoardSighting | None:
        """All of its rings; None if one is missing or they make no grid."""
        search = RingSearch(shape=self.shape, smallest_px=_SMALLEST_PX)
        centres = find_rings(image, search).centres_px
        ordered = self._in_order(centres)
        if ordered is None:
            return None
        return BoardSighting(name, grid_points(self.columns, self.rows, self.spacing_m), ordered)

    def _in_order(self, centres: Floats) -> Floats | None:
        """The centres (columns * rows, 2) row by row, in whatever order they come."""
        wanted = self.columns * self.rows
        if len(centres) != wanted:
            return None
        corners = _outer_corners(centres)
        if corners is None:
            return None
        wide, high = self.columns - 1.0, self.rows - 1.0
        flat = np.array([[0.0, 0.0], [wide, 0.0], [wide, high], [0.0, high]])
        for turn in range(2):
            to_grid = fit_homography(np.roll(corners, turn, axis=0), flat)
            places = apply_homography(to_grid, centres)
            cells = np.rint(places).astype(int)
            index = cells[:, 1] * self.columns + cells[:, 0]
            near = np.abs(places - cells).max() < _OFF_GRID
            if near and np.array_equal(np.sort(index), np.arange(wanted)):
                return np.asarray(centres[np.argsort(index)])
        return None


def _outer_corners(centres: Floats) -> Floats | None:
    """The four corners (4, 2) of the hull, clockwise on the screen; None if it has fewer."""
    import cv2

    hull = np.asarray(cv2.convexHull(centres.astype(np.float32)), np.float64).reshape(-1, 2)
    # Points on the sides of the hull go, the one that the outline misses least first.
    while len(hull) > 4:
        before, after = np.roll(hull, 1, axis=0), np.roll(hull, -1, axis=0)
        a, b = hull - before, after - hull
        cost = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        hull = np.delete(hull, int(cost.argmin()), axis=0)
    if len(hull) < 4:
        return None
    x, y = hull.T
    area = float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    return hull if area > 0.0 else hull[::-1]
