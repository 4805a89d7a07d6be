"""What a board is to a calibration: something flat whose points are known and can be found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from calibration.errors import CalibrationError
from geometry import Floats
from tracking import Image


@dataclass(frozen=True, eq=False)
class BoardSighting:
    """A board in one picture: its points (n, 3) in metres, z = 0, and their pixels (n, 2)."""

    name: str
    points_m: Floats
    pixels: Floats


class Board(Protocol):
    """A flat pattern of known size."""

    @property
    def radius_m(self) -> float:
        """Of its circles, whose images' middles are biased; 0 for points that are none."""

    def find(self, image: Image, name: str) -> BoardSighting | None:
        """The board in a picture; None when it is not there, or not enough of it."""

    def describe(self) -> Mapping[str, object]:
        """Kind and sizes, for the record."""


def grid_points(columns: int, rows: int, spacing_m: float) -> Floats:
    """Points (rows * columns, 3) of a grid, row by row, z = 0."""
    down, across = np.divmod(np.arange(rows * columns), columns)
    return np.stack([across * spacing_m, down * spacing_m, np.zeros(rows * columns)], axis=1)


def check_grid(columns: int, rows: int, spacing_m: float, least: int = 3) -> None:
    """Raise `CalibrationError` for what is no grid."""
    if min(columns, rows) < least or not spacing_m > 0.0:
        raise CalibrationError(
            f"a board needs at least {least} columns and rows and a positive spacing, got "
            f"{columns} x {rows} and {spacing_m} m"
        )
