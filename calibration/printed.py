"""The sheet that the words of a command mean, and its file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from calibration.boards import RATIO, board_of
from calibration.charuco import CharucoBoard
from calibration.errors import CalibrationError
from calibration.pdf import Page, pdf_bytes
from calibration.printing import charuco_page, ring_grid_page, ring_page
from calibration.ring_grid import RingGrid
from dialogue import UsageError
from geometry import RingShape

_USUAL_M = 0.122


def marker_page(
    kind: str,
    paper: str,
    diameter_m: float | None = None,
    inner_m: float | None = None,
    square_m: float | None = None,
    marker_m: float | None = None,
    size: tuple[int, int] | None = None,
) -> Page:
    """A ring, a ChArUco board or a grid of rings on a sheet.

    Raises `UsageError` for words that do not belong together or a sheet that is too small,
    `CameraError` for swapped diameters.
    """
    if kind == "ring":
        if square_m is not None or marker_m is not None or size is not None:
            raise UsageError("--square, --marker and --size belong to boards, not to --kind ring")
        diameter = diameter_m or _USUAL_M
        return ring_page(RingShape(diameter, inner_m or diameter * RATIO), paper)
    board = board_of(kind, size, square_m, marker_m, diameter_m, inner_m)
    if isinstance(board, CharucoBoard):
        return charuco_page(board, paper)
    assert isinstance(board, RingGrid)
    return ring_grid_page(board, paper)


def write_pages(file: Path, pages: Sequence[Page]) -> None:
    """Write a PDF; raises `CalibrationError` when the disk does not take it."""
    try:
        file.write_bytes(pdf_bytes(pages))
    except OSError as err:
        raise CalibrationError(f"cannot write {file}: {err.strerror or err}") from err
