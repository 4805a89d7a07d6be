"""The board that the words of a command mean."""

from __future__ import annotations

from calibration.board import Board
from calibration.charuco import CharucoBoard
from calibration.chessboard import Chessboard
from calibration.ring_grid import RingGrid
from dialogue import UsageError
from geometry import RingShape

RATIO = 50.0 / 122.0


def board_of(
    kind: str,
    size: tuple[int, int] | None = None,
    square_m: float | None = None,
    marker_m: float | None = None,
    diameter_m: float | None = None,
    inner_m: float | None = None,
) -> Board:
    """A chessboard, a ChArUco board or a grid of rings.

    What is None is as `trackside markers` prints it.

    Raises `UsageError` for words that do not belong to the kind.
    """
    if kind != "charuco" and marker_m is not None:
        raise UsageError("--marker belongs to --board charuco")
    if kind != "rings" and (diameter_m is not None or inner_m is not None):
        raise UsageError("--diameter and --inner belong to --board rings")
    if kind == "chessboard":
        if size is None or square_m is None:
            raise UsageError("--board chessboard needs --size (inner corners, 9x6) and --square")
        return Chessboard(*size, square_m)
    if kind == "charuco":
        usual = CharucoBoard()
        square = square_m or usual.square_m
        return CharucoBoard(
            *(size or (usual.columns, usual.rows)), square, marker_m or 0.72 * square
        )
    grid = RingGrid()
    spacing = square_m or grid.spacing_m
    diameter = diameter_m or spacing * 2.0 / 3.0
    shape = RingShape(diameter, inner_m or diameter * RATIO)
    return RingGrid(*(size or (grid.columns, grid.rows)), spacing, shape)
