"""What scoring costs: `uv run python benchmarks/scoring_speed.py`.

In process: the score of 10 000 poses and 20 landmarks; OSPA with GOSPA of 200 landmarks. Cold: the
whole process `trackside score` against `evo_ape tum` on the same files, of which evo scores the
path only. Medians; times depend on the machine, the ratio hardly.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from capture import (
    Estimate,
    EstimatedMap,
    GroundTruth,
    write_estimated_map,
    write_landmarks,
    write_tum,
)
from geometry import Floats, LandmarkMap, Trajectory
from scoring import score
from scoring.map_metrics import gospa, ospa

POSES, LANDMARKS, CONES = 10_000, 20, 200
PROGRAMS = Path(sys.executable).parent


def scene(rng: np.random.Generator) -> tuple[GroundTruth, Estimate]:
    """Eight laps of a circle at 100 Hz, path and landmarks estimated to about 5 cm."""
    t_ns = 1_700_000_000_000_000_000 + np.arange(POSES) * 10_000_000
    angle: Floats = np.arange(float(POSES)) * (16.0 * np.pi / POSES)
    truth = Trajectory(t_ns, 3.0 * np.cos(angle), 3.0 * np.sin(angle), angle + np.pi / 2)
    path = Trajectory(
        t_ns + 1_000_000,
        truth.x + rng.normal(0.0, 0.01, POSES),
        truth.y + rng.normal(0.0, 0.01, POSES),
        truth.heading,
    )
    ids, places = np.arange(LANDMARKS), rng.uniform(-4.0, 4.0, (LANDMARKS, 2))
    seen = LandmarkMap(ids, places + rng.normal(0.0, 0.05, places.shape))
    added_ns = path.t_ns[100 + 40 * ids]
    return (
        GroundTruth(truth, LandmarkMap(ids, places)),
        Estimate("bench", path, EstimatedMap(seen, t_added_ns=added_ns)),
    )


def median_ms(job: Callable[[], object], repeats: int) -> float:
    """Median of `repeats` runs after one that is not counted."""
    times = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        job()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times[1:])


def cold_ms(command: list[str], repeats: int = 5) -> float:
    """Median of the whole process, which must succeed."""
    return median_ms(lambda: subprocess.run(command, check=True, capture_output=True), repeats)


def main() -> None:
    """Measure and print."""
    rng = np.random.default_rng(0)
    truth, estimate = scene(rng)
    assert truth.landmarks is not None
    assert estimate.map is not None
    in_process = median_ms(lambda: score(truth, estimate), 30)
    print(f"score(), {POSES} poses + {LANDMARKS} landmarks: {in_process:.1f} ms")
    cones = rng.uniform(0.0, 20.0, (CONES, 2))
    seen = cones + rng.normal(0.0, 0.1, cones.shape)
    sets = median_ms(lambda: (ospa(cones, seen, 0.3, 1.0), gospa(cones, seen, 0.6, 1.0)), 50)
    print(f"OSPA and GOSPA, {CONES} landmarks: {sets:.2f} ms")
    with tempfile.TemporaryDirectory() as name:
        files = {kind: str(Path(name) / kind) for kind in ("truth", "path", "cones", "map")}
        write_tum(Path(files["truth"]), truth.path)
        write_tum(Path(files["path"]), estimate.path)
        write_landmarks(Path(files["cones"]), truth.landmarks)
        write_estimated_map(Path(files["map"]), estimate.map)
        flags = [word for kind, file in files.items() for word in (f"--{kind}", file)]
        ours = cold_ms([str(PROGRAMS / "trackside"), "score", *flags])
        evos = cold_ms([str(PROGRAMS / "evo_ape"), "tum", files["truth"], files["path"]])
    print(f"cold, path and map, trackside score: {ours / 1e3:.2f} s")
    print(f"cold, path only, evo_ape tum: {evos / 1e3:.2f} s")
    print(f"ratio: {evos / ours:.1f}")


if __name__ == "__main__":
    main()
