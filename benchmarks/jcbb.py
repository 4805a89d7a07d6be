"""Time of joint association (JCBB) of 8 observations, on one core.

    uv run python benchmarks/jcbb.py

The whole of it is timed: expectations, individual distances, search. A car that doubts its pose by
0.2 m and 0.15 rad stands among cones 0.7 m apart, so that several landmarks are compatible with an
observation; 2000 scenes.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time

import numpy as np

from dialogue import Table
from geometry import Floats, wrap
from slam.association import expectations, nearest_compatible, squared_distances
from slam.config import PRESETS
from slam.jcbb import joint_compatible, joint_gates
from slam.observation import noise_array

OBSERVATIONS = 8
SCENES = 2000
LIMIT_MS, STRETCH_MS = 0.15, 0.06
CONFIG = PRESETS["robust"]
NOISE = noise_array(CONFIG.observation)
GATES = joint_gates(CONFIG.joint_probability, OBSERVATIONS)


def main() -> None:
    """Print the table."""
    rows = [_row(n) for n in (10, 20, 50, 200)]
    columns = (
        "landmarks", "median [ms]", "p99 [ms]", "p99 at most [ms]", "stretch [ms]",
        "at most / p99", "right", "nearest right", "cut short",
    )  # fmt: skip
    print(Table(columns, tuple(rows), f"JCBB, {OBSERVATIONS} observations").render("md"))


def _row(n: int) -> tuple[float | int, ...]:
    random = np.random.Generator(np.random.PCG64(n))
    times, right, nearest_right, cut = np.empty(SCENES), 0, 0, 0
    for k in range(-5, SCENES):
        x, P, seen, ranges, bearings = _scene(n, random)
        started = time.perf_counter()
        distances = squared_distances(expectations(x, P, n), ranges, bearings, NOISE)
        chosen, cut_short = joint_compatible(
            x, P, distances, ranges, bearings, NOISE,
            CONFIG.accept_gate, CONFIG.spawn_gate, GATES, CONFIG.joint_nodes,
        )  # fmt: skip
        ended = time.perf_counter()
        nearest = nearest_compatible(distances, CONFIG.accept_gate, CONFIG.spawn_gate)
        if k >= 0:
            times[k] = (ended - started) * 1e3
            right += int(np.sum(chosen == seen))
            nearest_right += int(np.sum(nearest == seen))
            cut += int(cut_short)
    p99, all_pairs = float(np.percentile(times, 99)), SCENES * OBSERVATIONS
    return (
        n, float(np.median(times)), p99, LIMIT_MS, STRETCH_MS, LIMIT_MS / p99,
        right / all_pairs, nearest_right / all_pairs, cut,
    )  # fmt: skip


def _scene(
    n: int, random: np.random.Generator
) -> tuple[Floats, Floats, np.ndarray[tuple[int], np.dtype[np.int64]], Floats, Floats]:
    """State, covariance, the landmarks really seen, and their observations."""
    side = int(np.ceil(np.sqrt(n)))
    grid = np.stack(np.divmod(np.arange(n), side), axis=1) - 0.5 * side + 0.13
    x = np.concatenate([np.zeros(3), (0.7 * grid + random.normal(0.0, 0.05, (n, 2))).ravel()])
    root = 0.02 * random.normal(0.0, 1.0, (x.size, 8)) / np.sqrt(8)
    root[:3] += np.array([[0.2], [0.2], [0.15]]) * random.normal(0.0, 1.0, (3, 8)) / np.sqrt(8)
    P = root @ root.T + 1e-4 * np.eye(x.size)
    truth = x + root @ random.normal(0.0, 1.0, 8)
    offset = truth[3:].reshape(n, 2) - truth[:2]
    apart = np.hypot(*offset.T)
    # Closer than this a cone is in the blind zone of the lidar, and no gate is linear.
    seen = np.argsort(np.where(apart < 0.6, np.inf, apart))[:OBSERVATIONS].astype(np.int64)
    ranges = np.hypot(*offset[seen].T) + random.normal(0.0, 0.04, OBSERVATIONS)
    bearings = np.arctan2(offset[seen, 1], offset[seen, 0]) - truth[2]
    return x, P, seen, np.abs(ranges), np.asarray(wrap(bearings + random.normal(0.0, NOISE[1], 8)))


if __name__ == "__main__":
    main()
