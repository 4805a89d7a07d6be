"""Right maps among clutter: simulated thesis-like tracks, no names, 30 seeds each.

    uv run python benchmarks/slam_accuracy.py [HOW_MANY_SEEDS [FIRST_SEED]]

The world is tests/slam/world.py: 14 to 16 cones inside 4 x 4 m, 0.5 to 0.9 m/s, 15 Hz; range noise
0.03 m, bearing 1 deg, odometry 0.006 m and 0.3 deg a step; cones found by range as a one-degree
lidar finds them; clutter 5 % (and 10 %) of the true detections. No alignment: the car knows where
it starts. "right" are the runs without any missed and without any false landmark (c = 0.3 m), to be
80 % of them; the mean position error is to be 2.5 cm (EKF) and 3 cm (FastSLAM, 2000 particles).
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import dataclasses
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "slam"))

import world

from dialogue import Cell, Table
from slam import PRESETS, Slam
from slam.ekf import EkfSlam
from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FastSlam

TRACKS = ("turn", "s-curve", "loop")
CLUTTERS = (0.05, 0.10)
RIGHT_AT_LEAST = 0.8
POSITION_AT_MOST_M = {"EKF": 0.025, "FastSLAM": 0.030}
PARTICLES = 2000
FILTERS: dict[str, Callable[[int], Slam]] = {
    "EKF robust, nearest": lambda _: EkfSlam(PRESETS["robust"], "nearest"),
    "EKF robust, jcbb": lambda _: EkfSlam(PRESETS["robust"], "jcbb"),
    "EKF thesis, nearest": lambda _: EkfSlam(PRESETS["thesis"], "nearest"),
    "FastSLAM robust": lambda seed: _fastslam("robust", seed),
    "FastSLAM thesis": lambda seed: _fastslam("thesis", seed),
}


def _fastslam(preset: str, seed: int) -> Slam:
    config = dataclasses.replace(FASTSLAM_PRESETS[preset], particles=PARTICLES)
    return FastSlam(config, "likelihood", seed)


def main() -> None:
    """Print one table for each amount of clutter."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    seeds = range(first, first + count)
    columns = (
        "track", "filter", "right", "FN", "FP", "position [m]", "worst [m]", "map [m]", ""
    )  # fmt: skip
    cases = [(clutter, track, name) for clutter in CLUTTERS for track in TRACKS for name in FILTERS]
    jobs = [(*case, seed) for case in cases for seed in seeds]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = list(pool.map(_outcome, *zip(*jobs, strict=True), chunksize=5))
    for clutter in CLUTTERS:
        rows: list[tuple[Cell, ...]] = []
        for k, (amount, track, name) in enumerate(cases):
            if amount == clutter:
                rows.append((track, name, *_row(name, found[k * count : (k + 1) * count])))
        title = f"{clutter:.0%} clutter, seeds {first} to {seeds[-1]}, unknown association"
        print(Table(columns, tuple(rows), title).render("md"))
        print()


def _outcome(clutter: float, track: str, name: str, seed: int) -> world.Outcome:
    drive = world.drive(track, seed, world.Noise(clutter=clutter))
    return world.run(FILTERS[name](seed), drive)


def _row(name: str, found: list[world.Outcome]) -> tuple[Cell, ...]:
    right = float(np.mean([f.false_negatives == f.false_positives == 0 for f in found]))
    position_m = float(np.mean([f.position_m for f in found]))
    met = right >= RIGHT_AT_LEAST and position_m <= POSITION_AT_MOST_M[name.split()[0]]
    return (
        right,
        float(np.mean([f.false_negatives for f in found])),
        float(np.mean([f.false_positives for f in found])),
        position_m,
        max(f.position_m for f in found),
        float(np.nanmean([f.map_m for f in found])),
        "met" if met else "MISSED",
    )


if __name__ == "__main__":
    main()
