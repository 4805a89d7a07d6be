"""Pictures of boards with known truth, small and quick."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from calibration import Board, CharucoBoard, Chessboard, Picture, RingGrid, Sightings
from geometry import Camera
from simulation.boards import held_boards, render_sheet
from tracking import Image

CAMERA = Camera(800, 600, 640.0, 636.0, 405.0, 293.0, (-0.15, 0.06, 0.0008, -0.0006, -0.01))
CHARUCO = CharucoBoard()
RINGS = RingGrid()
CHESSBOARD = Chessboard(9, 6, 0.027)


def sheet(board: Board) -> tuple[Image, float, tuple[float, float]]:
    """A board as it is printed: texels, metres for each, width and height."""
    if isinstance(board, RingGrid):
        return board.picture(0.0002), 0.0002, board.size_m
    if isinstance(board, CharucoBoard):
        return board.picture(135), board.square_m / 135, (10 * 0.025, 7 * 0.025)
    assert isinstance(board, Chessboard)
    squares = np.indices((board.rows + 1, board.columns + 1)).sum(axis=0) % 2
    fine = np.kron(255 * (1 - squares), np.ones((135, 135))).astype(np.uint8)
    white = np.pad(fine, 100, constant_values=255)
    metres = board.square_m / 135
    return white, metres, (white.shape[1] * metres, white.shape[0] * metres)


def pictures(board: Board, count: int, seed: int = 0, camera: Camera = CAMERA) -> Iterator[Picture]:
    """A board held in so many ways."""
    rng = np.random.default_rng(seed)
    texels, metres, size_m = sheet(board)
    for k, view in enumerate(held_boards(camera, size_m, count, rng)):
        image = render_sheet(view, texels, metres, rng, psf_sigma_px=0.6)
        yield Picture(f"view {k}", image)


@lru_cache(maxsize=4)
def charuco_pictures() -> tuple[Picture, ...]:
    """Twelve, made once."""
    return tuple(pictures(CHARUCO, 12))


def seen(board: Board, shown: Iterator[Picture] | tuple[Picture, ...]) -> Sightings:
    """What is found in them."""
    sightings = Sightings(board)
    sightings.add_all(shown)
    return sightings
