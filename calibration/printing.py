"""Markers and boards on paper, true to size, with a ruler by which to see that they are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from calibration.charuco import CharucoBoard
from calibration.pdf import PAPERS_MM, Page
from calibration.ring_grid import RingGrid
from dialogue import UsageError, nearest_names
from geometry import RingShape

_EDGE_MM = 5.0
"""What most printers cannot reach."""
_FOOT_MM = 24.0
_RULER_MM = 100


def ring_page(shape: RingShape, paper: str) -> Page:
    """One ring in the middle of the sheet, its white margin drawn as a line to cut along."""
    outer, inner = 1e3 * shape.diameter_m, 1e3 * shape.inner_diameter_m
    margin = outer * shape.margin
    page = _page(
        paper, margin, margin, f"a ring of {outer:g} mm with its margin of {margin:.1f} mm"
    )
    x, y = _middle(page)
    page.circle(x, y, margin, 0.7)
    page.disc(x, y, outer, 0.0)
    page.disc(x, y, inner, 1.0)
    page.bar(x - 0.05, y - 1.5, 0.1, 3.0, 0.6)
    page.bar(x - 1.5, y - 0.05, 3.0, 0.1, 0.6)
    words = f"ring {outer:g} mm outside, {inner:g} mm inside; cut along the grey line, not within"
    _foot(page, words)
    return page


def charuco_page(board: CharucoBoard, paper: str) -> Page:
    """A ChArUco board in the middle of the sheet."""
    import cv2

    square, marker = 1e3 * board.square_m, 1e3 * board.marker_m
    wide, high = board.columns * square, board.rows * square
    page = _page(paper, wide, high, f"a board of {wide:g} x {high:g} mm")
    left, top = _middle(page)[0] - wide / 2.0, _middle(page)[1] + high / 2.0
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    module, inset = marker / 7.0, (square - marker) / 2.0
    number = 0
    for row in range(board.rows):
        for column in range(board.columns):
            x, y = left + column * square, top - row * square
            if (row + column) % 2 == 0:
                page.bar(x, y - square, square, square)
                continue
            bits = np.asarray(cv2.aruco.generateImageMarker(dictionary, number, 7)) == 0
            _bits(page, bits, x + inset, y - inset, module)
            number += 1
    _foot(
        page,
        f"ChArUco 5X5_250, {board.columns} x {board.rows} squares of {square:g} mm, "
        f"markers {marker:g} mm",
    )
    return page


def ring_grid_page(grid: RingGrid, paper: str) -> Page:
    """A grid of rings in the middle of the sheet."""
    spacing, outer = 1e3 * grid.spacing_m, 1e3 * grid.shape.diameter_m
    inner = 1e3 * grid.shape.inner_diameter_m
    wide, high = (1e3 * side for side in grid.size_m)
    page = _page(paper, wide, high, f"a grid of {wide:g} x {high:g} mm")
    x, y = _middle(page)
    for row in range(grid.rows):
        for column in range(grid.columns):
            u = x + (column - (grid.columns - 1) / 2.0) * spacing
            v = y - (row - (grid.rows - 1) / 2.0) * spacing
            page.disc(u, v, outer, 0.0)
            page.disc(u, v, inner, 1.0)
    _foot(
        page,
        f"rings {grid.columns} x {grid.rows}, {spacing:g} mm apart, {outer:g} mm outside, "
        f"{inner:g} mm inside",
    )
    return page


def _page(paper: str, wide_mm: float, high_mm: float, what: str) -> Page:
    """A sheet on which so much has room, upright if it can be; raises `UsageError` otherwise."""
    if paper not in PAPERS_MM:
        raise UsageError(f"there is no paper {paper!r}; {nearest_names(paper, PAPERS_MM)}")
    fitting = {name: sheet for name in PAPERS_MM if (sheet := _fitting(name, wide_mm, high_mm))}
    if paper in fitting:
        return Page(*fitting[paper])
    larger = list(fitting)
    advice = f"it fits on {larger[0]}" if larger else "make it smaller"
    raise UsageError(f"{what} does not fit on {paper} with the control ruler; {advice}")


def _fitting(paper: str, wide_mm: float, high_mm: float) -> tuple[float, float] | None:
    """The paper's sides, upright or turned, if so much has room on it."""
    for width, height in (PAPERS_MM[paper], PAPERS_MM[paper][::-1]):
        if wide_mm <= width - 2.0 * _EDGE_MM and high_mm <= height - _FOOT_MM - _EDGE_MM:
            return width, height
    return None


def _middle(page: Page) -> tuple[float, float]:
    return page.width_mm / 2.0, (page.height_mm + _FOOT_MM - _EDGE_MM) / 2.0


def _foot(page: Page, words: str) -> None:
    """What it is, and a ruler of exactly 100 mm."""
    x, y = (page.width_mm - _RULER_MM) / 2.0, 11.0
    page.bar(x, y, _RULER_MM, 0.3)
    for tick in range(0, _RULER_MM + 1, 10):
        long = 3.0 if tick % 50 == 0 else 1.8
        page.bar(x + tick - 0.1, y, 0.2, long)
    page.text(x, y - 4.0, "must measure 100 mm, or the printer has scaled: print at 100 %", 8.0)
    page.text(x, y + 5.0, words, 8.0)


def _bits(page: Page, bits: npt.NDArray[np.bool_], left: float, top: float, module: float) -> None:
    """Black modules, those side by side as one bar, so that no light shows between them."""
    for row, line in enumerate(bits):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
        for first, last in edges.reshape(-1, 2).tolist():
            x, y = left + first * module, top - (row + 1) * module
            page.bar(x, y, (last - first) * module, module)
