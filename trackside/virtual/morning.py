"""What is done once on a site: the camera calibrated from a board, and its place from the corners.

Everything is rendered and then found by the same functions as on a real site.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from calibration import (
    CharucoBoard,
    Floor,
    FloorMarker,
    MeasuredLength,
    Picture,
    Sightings,
    calibrate_camera,
    calibrate_world,
)
from capture import CameraCalibration, write_calibration
from geometry import View
from simulation.boards import held_boards, render_sheet
from simulation.overhead_film import TAPE_SIGMA_M, empty_floor, measured_lengths
from simulation.world import site_corners
from tracking import average_rings

BOARD_VIEWS, FLOOR_PICTURES, TEXELS = 14, 20, 200


def calibrated_site(
    folder: Path, view: View, advance: Callable[[int], None] = lambda _: None
) -> None:
    """Write the camera's and the world's calibration into a folder, each with its verdict.

    advance : told how many of the pictures were made.
    """
    rng = np.random.default_rng(20190514)
    camera = _camera(view, rng, advance)
    pictures = _counted(empty_floor(view, rng, FLOOR_PICTURES), advance)
    floor = _floor(measured_lengths(site_corners(), rng))
    rings = average_rings(pictures, floor.ring)
    camera_file = write_calibration(folder, camera)
    how = {"source": "trackside simulate", "camera_file": camera_file.name}
    world = calibrate_world(floor, rings, camera, how).calibration
    write_calibration(folder, world)


def _camera(
    view: View, rng: np.random.Generator, advance: Callable[[int], None]
) -> CameraCalibration:
    board = CharucoBoard()
    sheet = board.picture(TEXELS)
    size_m = (board.columns * board.square_m, board.rows * board.square_m)
    seen = Sightings(board)
    for k, held in enumerate(held_boards(view.camera, size_m, BOARD_VIEWS, rng)):
        image = render_sheet(held, sheet, board.square_m / TEXELS, rng)
        seen.add(Picture(f"view {k}", image))
        advance(1)
    return calibrate_camera(seen, {"source": "trackside simulate"}).calibration


def _floor(lengths: Sequence[tuple[int, int, float]]) -> Floor:
    marks = tuple(FloorMarker(name=f"c{k + 1}", corner=k + 1) for k in range(4))
    taped = tuple(
        MeasuredLength(between=(f"c{a + 1}", f"c{b + 1}"), length_m=length, sigma_m=TAPE_SIGMA_M)
        for a, b, length in lengths
    )
    return Floor(markers=marks, lengths=taped)


def _counted(
    images: Iterator[npt.NDArray[np.uint8]], advance: Callable[[int], None]
) -> Iterator[npt.NDArray[np.uint8]]:
    for image in images:
        advance(1)
        yield image
