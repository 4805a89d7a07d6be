"""The whole overhead chain, from pictures of a board to the pose of a car, against exact truth.

    uv run python benchmarks/overhead_chain.py [--trials 3]

Rendered at 1080p with 2.5 grey levels of noise: twenty pictures of a board give the camera; four
corner rings, each placed 2 mm (one sigma, either axis) off a square of 3 m, and six lengths by a
tape of 1 mm give the frame; rings on a car 0.2 m above the floor, found without knowing anything
before, give its pose. Errors are in the frame of the corners as they really stand. The last rows
believe the square instead of a tape, which is what others do, and calibrate OpenCV's left camera.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import cv2
import numpy as np

from calibration import (
    Board,
    CharucoBoard,
    Chessboard,
    Floor,
    FloorMarker,
    MeasuredLength,
    Picture,
    RingGrid,
    Sightings,
    Skipped,
    calibrate_camera,
    calibrate_world,
    pictures_of,
)
from capture import CameraCalibration, WorldCalibration
from dialogue import Cell, Table
from geometry import Floats, View, circle_centres, inverse, transform_points, wrap
from simulation import CarPlan, OverheadScene, Ring, oblique_view, straight_down_view
from simulation.boards import held_boards, render_sheet
from tracking import RingSearch, average_rings, find_rings
from tracking.identity import car_pose

SQUARE_M = 3.0
PLACED_M, TAPE_M = 0.002, 0.001
BOARD_VIEWS, STILLS, POSES = 20, 10, 25
GOAL_MM, STRETCH_MM = 5.0, 2.0
PLAN = CarPlan()
DATA = Path(os.environ.get("TRACKSIDE_DATA", Path(__file__).parents[2] / "shared" / "data"))


@dataclass(frozen=True, eq=False)
class Errors:
    """Position (k,) in metres and heading (k,) in radians of a car; sigma_m as it was predicted."""

    position_m: Floats
    heading_rad: Floats
    sigma_m: float


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=3)
    trials = parser.parse_args().trials
    cv2.setNumThreads(1)
    rows: list[tuple[Cell, ...]] = []
    boards: dict[str, Board] = {"ChArUco": CharucoBoard(), "ring grid": RingGrid()}
    for name, board in boards.items():
        for where, view in (("down", straight_down_view()), ("oblique", oblique_view())):
            done = [_trial(board, view, seed, taped=True) for seed in range(trials)]
            rows.append(_row(f"{name}, {where}", done))
    believed = [
        _trial(boards["ChArUco"], straight_down_view(), s, taped=False) for s in range(trials)
    ]
    rows.append(_row("ChArUco, down, square believed", believed))
    columns = (
        "chain", "rms [mm]", "max [mm]", "predicted sigma [mm]", "heading max [deg]", "goal [mm]",
        "goal / max", "stretch / max",
    )  # fmt: skip
    print(Table(columns, tuple(rows), f"image to pose, {trials} trials each").render("md"))
    print(_left_camera())


def _trial(board: Board, view: View, seed: int, taped: bool) -> Errors:
    rng = np.random.default_rng(seed)
    camera = _camera(board, view, rng)
    half = SQUARE_M / 2.0
    nominal = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = nominal + PLACED_M * rng.standard_normal((4, 2))
    scene = OverheadScene(view, [Ring((x, y, 0.0)) for x, y in corners.tolist()])
    floor = _floor(corners if taped else nominal, rng, TAPE_M if taped else PLACED_M, taped)
    stills = (scene.frame(rng).image for _ in range(STILLS))
    world = calibrate_world(floor, average_rings(stills, floor.ring), camera, {}).calibration
    return _driven(scene, view, world, corners, rng)


def _camera(board: Board, view: View, rng: np.random.Generator) -> CameraCalibration:
    if isinstance(board, RingGrid):
        texel_m, size_m, sheet = 0.00015, board.size_m, board.picture(0.00015)
    else:
        assert isinstance(board, CharucoBoard)
        texel_m, sheet = board.square_m / 200, board.picture(200)
        size_m = (board.columns * board.square_m, board.rows * board.square_m)
    seen = Sightings(board)
    for k, held in enumerate(held_boards(view.camera, size_m, BOARD_VIEWS, rng)):
        seen.add(Picture(f"view {k}", render_sheet(held, sheet, texel_m, rng)))
    return calibrate_camera(seen, {}).calibration


def _floor(corners: Floats, rng: np.random.Generator, sigma_m: float, taped: bool) -> Floor:
    """What a person measures: to the millimetre, as far as the tape is good."""
    lengths = []
    for a, b in combinations(range(4), 2):
        true = float(np.linalg.norm(corners[a] - corners[b]))
        read = round(true + sigma_m * rng.standard_normal(), 3) if taped else true
        lengths.append(
            MeasuredLength(between=(f"c{a + 1}", f"c{b + 1}"), length_m=read, sigma_m=sigma_m)
        )
    marks = tuple(FloorMarker(name=f"c{k + 1}", corner=k + 1) for k in range(4))
    return Floor(markers=marks, lengths=tuple(lengths))


def _driven(
    scene: OverheadScene,
    view: View,
    world: WorldCalibration,
    corners: Floats,
    rng: np.random.Generator,
) -> Errors:
    """A car at random places between the corners, each from one picture."""
    along = corners[1] - corners[0]
    frame = np.array([*corners[0], np.arctan2(along[1], along[0])])
    search = RingSearch(smallest_px=12.0)
    off, turned, reach = [], [], SQUARE_M / 2.0 - 0.35
    for _ in range(POSES):
        pose = np.array([*rng.uniform(-reach, reach, 2), rng.uniform(-np.pi, np.pi)])
        rings = PLAN.rings(pose)
        shown = scene.frame(rng, moving=rings, body=PLAN.outline(pose))
        found = find_rings(shown.image, search).centres_px
        # The two that are the car's are taken by the truth; where they are is not.
        due = view.project(np.array([ring.xyz_m for ring in rings]))
        nearest = np.linalg.norm(found[None] - due[:, None], axis=2).argmin(axis=1)
        xy = circle_centres(world.view, found[nearest], PLAN.height_m, PLAN.shape.radius_m)
        none = np.zeros((2, 2))
        measured, _ = car_pose(xy[0], xy[1], none, none, PLAN.front_x_m, PLAN.rear_x_m)
        true = transform_points(inverse(frame), pose[None, :2])[0]
        off.append(float(np.hypot(*(measured[:2] - true))))
        turned.append(abs(float(wrap(measured[2] - (pose[2] - frame[2])))))
    return Errors(np.array(off), np.array(turned), world.accuracy_m["car_rms"])


def _row(name: str, done: list[Errors]) -> tuple[Cell, ...]:
    off_mm = 1e3 * np.concatenate([one.position_m for one in done])
    rms, worst = float(np.sqrt((off_mm**2).mean())), float(off_mm.max())
    predicted = 1e3 * float(np.sqrt(np.mean([one.sigma_m**2 for one in done])))
    heading = float(np.degrees(max(one.heading_rad.max() for one in done)))
    return (name, rms, worst, predicted, heading, GOAL_MM, GOAL_MM / worst, STRETCH_MM / worst)


def _left_camera() -> str:
    folder = DATA / "calibration_left"
    if not folder.is_dir():
        return f"the left camera was not calibrated: {folder} is not there"
    seen = Sightings(Chessboard(9, 6, 0.025))
    seen.add_all(pictures_of(folder, Skipped()))
    found = calibrate_camera(seen, {}).calibration
    used = sum(view.used for view in found.views)
    rows: tuple[tuple[Cell, ...], ...] = (
        ("boards", used, 14, used / 14),
        ("rms [px]", found.rms_px, 0.20, 0.20 / found.rms_px),
        (
            "|fx - 532.8| [px]",
            abs(found.camera.fx - 532.8),
            1.0,
            1.0 / abs(found.camera.fx - 532.8),
        ),
        (
            "|fy - 533.0| [px]",
            abs(found.camera.fy - 533.0),
            1.0,
            1.0 / abs(found.camera.fy - 533.0),
        ),
    )
    return Table(("OpenCV's left camera", "figure", "limit", "ratio"), rows).render("md")


if __name__ == "__main__":
    main()
