"""Right maps among clutter: simulated thesis-like tracks, no names, 30 seeds each.

    uv run python benchmarks/slam_accuracy.py [SEEDS]

The world is tests/slam/world.py: 14 to 16 cones inside 4 x 4 m, 0.5 to 0.9 m/s, 15 Hz; range noise
0.03 m, bearing 1 deg, odometry 0.006 m and 0.3 deg a step; cones found by range as a one-degree
lidar finds them; clutter 5 % (and 10 %) of the true detections. No alignment: the car knows where
it starts. "right" are the runs without any missed and without any false landmark (c = 0.3 m).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "slam"))

import world

from dialogue import Cell, Table
from slam import PRESETS, Slam
from slam.ekf import EkfSlam

TRACKS = ("turn", "s-curve", "loop")
RIGHT_AT_LEAST, POSITION_AT_MOST_M = 0.8, 0.025
FILTERS: dict[str, Callable[[], Slam]] = {
    "EKF robust, nearest": lambda: EkfSlam(PRESETS["robust"], "nearest"),
    "EKF robust, jcbb": lambda: EkfSlam(PRESETS["robust"], "jcbb"),
    "EKF thesis, nearest": lambda: EkfSlam(PRESETS["thesis"], "nearest"),
}


def main() -> None:
    """Print one table for each amount of clutter."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    columns = (
        "track", "filter", "right", "FN", "FP", "position [m]", "worst [m]", "map [m]", ""
    )  # fmt: skip
    for clutter in (0.05, 0.10):
        rows: list[tuple[Cell, ...]] = []
        for track in TRACKS:
            drives = [world.drive(track, s, world.Noise(clutter=clutter)) for s in range(seeds)]
            rows += [(track, name, *_row(make, drives)) for name, make in FILTERS.items()]
        title = f"{clutter:.0%} clutter, {seeds} seeds, unknown association"
        print(Table(columns, tuple(rows), title).render("md"))
        print()


def _row(make: Callable[[], Slam], drives: list[world.Drive]) -> tuple[Cell, ...]:
    found = [world.run(make(), driven) for driven in drives]
    right = float(np.mean([f.false_negatives == f.false_positives == 0 for f in found]))
    position_m = float(np.mean([f.position_m for f in found]))
    met = right >= RIGHT_AT_LEAST and position_m <= POSITION_AT_MOST_M
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
