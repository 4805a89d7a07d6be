"""Visual odometry against the truth of rendered runs: drift, time, being lost, covariance.

    uv run python benchmarks/stereo_odometry.py

One core. Each path is driven in several rooms with their own floor, walls and noise; frames pass
through the JPEG of the recorder. Goals: 2 % of the way, 1 degree, 15 ms a pair.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"

import time
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from dialogue import Cell, Table
from geometry import Floats, Mounting, between, compose
from simulation.stereo import StereoScene
from visual_odometry import State, VisualOdometer, VoFrame

RATE_HZ = 15.0
ROOMS = 4
CONES = np.array(
    [[1.5, -0.3], [2.9, 0.6], [3.9, 2.0], [2.0, 1.2], [1.0, 1.6], [3.7, 3.6], [-0.4, 3.4],
     [2.6, 4.2]]
)  # fmt: skip
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Case:
    """A path, how fast it is driven, and what is unusual."""

    name: str
    poses: Floats
    quality: int | None = 90
    noise: float = 2.0
    mounting: Mounting | None = None


def main() -> None:
    """Print the tables."""
    cv2.setNumThreads(1)
    start = np.array([0.6, 0.4, 0.1])
    across = np.array([-0.8, 0.3, 0.7])
    turn = arc(start, 0.6)
    cases = [
        Case("turn 4 m, 0.6 m/s", turn),
        Case("straight 4 m, 0.6 m/s", arc(across, 0.6, curvature=0.0)),
        Case("s-curve 4 m, 0.6 m/s", s_curve(np.array([0.0, 1.0, 0.3]), 0.6)),
        Case("turn 4 m, 1.5 m/s", arc(start, 1.5)),
        Case("turn 4 m, 2.5 m/s", arc(start, 2.5)),
        Case("turn, JPEG quality 60", turn, quality=60),
        Case("turn, no JPEG", turn, quality=None),
        Case("turn, noise of 4 levels", turn, noise=4.0),
    ]
    rows = [row(case) for case in cases]
    columns = ("path", "drift [%]", "worst [%]", "heading [deg]", "worst [deg]", "scale - 1 [%]",
               "tracked [%]", "NEES of a step (3)", "ms a pair", "p95 [ms]")  # fmt: skip
    print(
        Table(columns, tuple(rows), f"visual odometry, {ROOMS} rooms a path", digits=3).render("md")
    )
    print()
    print(lost_table(turn).render("md"))
    print()
    print(render_table().render("md"))


def arc(start: Floats, speed_m_s: float, curvature: float = 1.0 / 1.5) -> Floats:
    """Poses (n, 3) along 4 m of constant curvature."""
    way = np.arange(0.0, 4.0 + 1e-9, speed_m_s / RATE_HZ)
    return driven(start, way, np.full(way.size, curvature))


def s_curve(start: Floats, speed_m_s: float) -> Floats:
    """Poses (n, 3) along 4 m to the left and to the right."""
    way = np.arange(0.0, 4.0 + 1e-9, speed_m_s / RATE_HZ)
    return driven(start, way, 0.9 * np.sin(2.0 * np.pi * way / 4.0))


def driven(start: Floats, way: Floats, curvature: Floats) -> Floats:
    """Poses by steps of constant curvature each."""
    poses = [np.array(start, np.float64)]
    for (first, last), bend in zip(pairwise(way.tolist()), curvature.tolist(), strict=False):
        step, turn = last - first, bend * (last - first)
        half = np.sinc(turn / 2.0 / np.pi) * step
        poses.append(compose(poses[-1], np.array(
            [half * np.cos(turn / 2.0), half * np.sin(turn / 2.0), turn]
        )))  # fmt: skip
    return np.array(poses)


def frames_of(case: Case, scene: StereoScene) -> list[Image]:
    """What the recorder would have logged."""
    frames = [scene.frame(pose) for pose in case.poses]
    if case.quality is None:
        return frames
    return [
        np.asarray(cv2.imdecode(
            cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, case.quality])[1],
            cv2.IMREAD_GRAYSCALE,
        ), np.uint8)
        for frame in frames
    ]  # fmt: skip


def told(frames: list[Image], scene: StereoScene) -> tuple[list[VoFrame], list[float]]:
    """What visual odometry makes of frames, and its CPU time for each."""
    odometer = VisualOdometer(scene.pair, scene.mounting)
    found, spent_ms = [], []
    for k, frame in enumerate(frames):
        began = time.process_time()
        found.append(odometer.add(round(k * 1e9 / RATE_HZ), frame))
        spent_ms.append(1e3 * (time.process_time() - began))
    return found, spent_ms


def row(case: Case) -> tuple[Cell, ...]:
    """Drift and the rest of one path over all rooms."""
    ends, ratios, tracked, squares, spent = [], [], [], [], []
    length = way_of(case.poses)
    for room in range(ROOMS):
        scene = StereoScene(CONES, seed=room, noise=case.noise)
        found, ms = told(frames_of(case, scene), scene)
        own = np.array([frame.pose for frame in found])
        ends.append(between(between(case.poses[0], case.poses[-1]), own[-1]))
        ratios.append(way_of(own) / length - 1.0)
        tracked.append(np.mean([frame.state is not State.LOST for frame in found]))
        squares += step_nees(case.poses, found)
        spent += ms[1:]
    off = np.array(ends)
    drift = 100.0 * np.hypot(off[:, 0], off[:, 1]) / length
    heading = np.degrees(np.abs(off[:, 2]))
    return (
        case.name, float(drift.mean()), float(drift.max()), float(heading.mean()),
        float(heading.max()), 100.0 * float(np.mean(ratios)), 100.0 * float(np.mean(tracked)),
        float(np.mean(squares)), float(np.mean(spent)), float(np.quantile(spent, 0.95)),
    )  # fmt: skip


def way_of(poses: Floats) -> float:
    """Length of a path."""
    return float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def step_nees(poses: Floats, found: list[VoFrame]) -> list[float]:
    """Normalised squared errors of the steps between key frames; 3 in the mean is right."""
    squares, before = [], poses[0]
    for pose, frame in zip(poses, found, strict=True):
        if frame.key and frame.state is State.TRACKED:
            off = between(between(before, pose), frame.motion_pose)
            squares.append(float(off @ np.linalg.solve(frame.motion_covariance, off)))
        if frame.key:
            before = pose
    return squares


def lost_table(poses: Floats) -> Table:
    """What happens when the eyes are covered for so many frames."""
    rows: list[tuple[Cell, ...]] = []
    scene = StereoScene(CONES, seed=0)
    frames = frames_of(Case("covered", poses), scene)
    for count in (1, 3, 5, 7, 10, 15, 30):
        shown = [
            np.full_like(frame, 4) if 40 <= k < 40 + count else frame
            for k, frame in enumerate(frames)
        ]
        found, _ = told(shown, scene)
        states = [frame.state for frame in found]
        rest = [k for k in range(40 + count, len(found)) if states[k] is State.TRACKED]
        own = between(found[rest[0]].pose, found[-1].pose)
        off = between(between(poses[rest[0]], poses[-1]), own)
        back = rest[0]
        placed = compose(poses[0], found[back].pose)
        unknown = np.hypot(*between(poses[back], placed)[:2])
        rows.append((
            count, states.count(State.MISSED), states.count(State.LOST), back - 40 - count,
            1e3 * float(np.hypot(*off[:2])), 1e3 * float(unknown),
        ))  # fmt: skip
    columns = ("frames covered", "missed", "lost", "frames until it is back",
               "error afterwards [mm]", "way unknown [mm]")  # fmt: skip
    return Table(columns, tuple(rows), "covered eyes on the turn, 4 cm a frame", digits=1)


def render_table() -> Table:
    """What the emulated ZED costs, and its mounting told wrongly."""
    scene = StereoScene(CONES, seed=0)
    began = time.process_time()
    for k in range(60):
        scene.frame(np.array([0.5 + 0.02 * k, 0.5, 0.01 * k]))
    rows: list[tuple[Cell, ...]] = [
        ("rendering a pair [ms]", 1e3 * (time.process_time() - began) / 60)
    ]
    poses = arc(np.array([0.6, 0.4, 0.1]), 0.6)
    frames = frames_of(Case("turn", poses), scene)
    tilted = replace(scene.mounting, pitch_rad=scene.mounting.pitch_rad + np.radians(1.0))
    for name, mounting in (("true mounting", scene.mounting), ("pitch 1 deg off", tilted)):
        odometer = VisualOdometer(scene.pair, mounting)
        found = [odometer.add(round(k * 1e9 / RATE_HZ), frame) for k, frame in enumerate(frames)]
        off = between(between(poses[0], poses[-1]), found[-1].pose)
        rows.append((f"drift of the turn, {name} [%]", 100.0 * float(np.hypot(*off[:2])) / 4.0))
    return Table(("what", "value"), tuple(rows))


if __name__ == "__main__":
    main()
