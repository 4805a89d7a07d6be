"""Time to find the cones in one lidar revolution of 800 points, deskewing included, on one core.

    uv run python benchmarks/cones.py

Prints medians over many revolutions of a car that drives and turns among cones in a walled room.
"""

from __future__ import annotations

import time

import numpy as np

from capture import Odometry, Scans
from dialogue import Table
from geometry import Floats
from slam.cones.config import CONE_PRESETS, ConeConfig
from slam.cones.detection import detect_cones

BEAMS = 800
REVOLUTIONS = 300
PERIOD_NS = 66_666_667
GOAL_MS, STRETCH_MS = 0.5, 0.2
CONE_RADIUS_M = 0.05
ROOM_M = 2.4


def main() -> None:
    """Print the table."""
    turns = [_revolution(k) for k in range(REVOLUTIONS)]
    clutter = np.random.default_rng(1)
    worst = [
        (clutter.uniform(0.3, 2.0, 10_000), clutter.uniform(-np.pi, np.pi, 10_000))
        for _ in range(10)
    ]
    rows = [
        _row(f"{name}, {BEAMS} points", config, turns, GOAL_MS)
        for name, config in CONE_PRESETS.items()
    ]
    rows += [
        _row(f"{name}, 10000 points of clutter", config, worst, None)
        for name, config in CONE_PRESETS.items()
    ]
    columns = (
        "preset", "cones", "median [ms]", "p99 [ms]", "goal [ms]", "goal / median",
        "stretch / median",
    )  # fmt: skip
    print(Table(columns, tuple(rows), "cones of one lidar revolution").render("md"))


def _revolution(k: int) -> tuple[Floats, Floats]:
    """Ranges and bearings in a room of four walls with eight cones, as the car turns."""
    generator = np.random.default_rng(k)
    bearing = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False) + generator.uniform(0, 2e-3)
    range_m = ROOM_M / np.maximum(np.abs(np.cos(bearing)), np.abs(np.sin(bearing)))
    distances = np.array([0.6, 0.9, 1.2, 1.5, 1.8, 0.7, 1.1, 1.6])
    for distance, angle in zip(distances, np.arange(8) * 0.78 + 0.01 * k, strict=True):
        along, across = distance * np.cos(bearing - angle), distance * np.sin(bearing - angle)
        struck = (np.abs(across) < CONE_RADIUS_M) & (along > 0)
        depth = along - np.sqrt(np.maximum(CONE_RADIUS_M**2 - across**2, 0.0))
        range_m = np.where(struck, depth, range_m)
    return range_m + 0.008 * generator.standard_normal(BEAMS), bearing


def _row(
    name: str, config: ConeConfig, turns: list[tuple[Floats, Floats]], goal_ms: float | None
) -> tuple[str | float | int | None, ...]:
    scans = [_scans(k, *turn) for k, turn in enumerate(turns)]
    odometry = _odometry(len(turns))
    cones = sum(detect_cones(one, odometry, config).report.cones for one in scans)
    times = np.empty(len(scans))
    for i, one in enumerate(scans):
        start = time.perf_counter()
        detect_cones(one, odometry, config)
        times[i] = (time.perf_counter() - start) * 1e3
    median = float(np.median(times))
    ratios = (None, None) if goal_ms is None else (goal_ms / median, STRETCH_MS / median)
    return (name, cones, median, float(np.percentile(times, 99)), goal_ms, *ratios)


def _scans(k: int, range_m: Floats, bearing_rad: Floats) -> Scans:
    t_ns = np.array([k * PERIOD_NS])
    beam_t_ns = t_ns + np.arange(range_m.size) * (PERIOD_NS // range_m.size)
    starts = np.array([0, range_m.size])
    return Scans(t_ns, starts, beam_t_ns, range_m, bearing_rad, np.full(range_m.size, np.nan))


def _odometry(revolutions: int) -> Odometry:
    """A car at 0.02 m/s and 0.01 rad/s, 50 Hz: slow, for the cones above stand where they stand."""
    t_ns = np.arange(-2, revolutions * PERIOD_NS // 20_000_000 + 3) * 20_000_000
    t_s = t_ns * 1e-9
    poses = np.stack([0.02 * t_s, np.zeros(t_s.size), 0.01 * t_s], axis=1)
    return Odometry("benchmark", t_ns, poses, np.full(t_s.size, 0.02), np.full(t_s.size, 0.01))


if __name__ == "__main__":
    main()
