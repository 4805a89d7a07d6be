"""Five real robots whose landmarks nobody names: how many are found, and the path. MRCLAM set 7.

    uv run python benchmarks/mrclam_unknown.py [DIR_OF_MRCLAM_SETS]

The barcodes are not looked at. One preset (robust) for all robots, no `--set`. FastSLAM runs with
SEEDS seeds, each followed by the final pass (`--smooth`), and of the seeds the one is taken whose
result makes the data likeliest by the pass's own account: the truth has no part in it. EKF-SLAM
(nearest, jcbb) runs once, with the same pass. Path error after `--align path`, map error after
`--align map` with c = 0.5 m. Known: EKF-SLAM with the barcodes, and that smoothed.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from mrclam import ROBOTS, against, data_dir, scored, trackside

from capture import Estimate, Session
from dialogue import Cell, Table
from slam.algorithms import Request, estimate_session

SEEDS = 4
RATIO_AT_MOST, LANDMARKS, SPARE = 1.5, 15, 1
REQUESTS = {
    **{
        f"fastslam-{seed}": Request(
            algorithm="fastslam", association="likelihood", smooth=True, seed=seed
        )
        for seed in range(SEEDS)
    },
    "nearest": Request(association="nearest", smooth=True),
    "jcbb": Request(association="jcbb", smooth=True),
    "known": Request(),
    "known-smoothed": Request(smooth=True),
}


@dataclass(frozen=True)
class Result:
    """One run of one robot."""

    path_m: float
    worst_m: float
    map_m: float | None
    landmarks: int
    pairs: int
    likelihood: float
    seconds: float


def main() -> None:
    """Print a table for each way, and how the best stands against the goal."""
    with tempfile.TemporaryDirectory() as folder:
        for robot in ROBOTS:
            words = ("--robot", robot, "-o", Path(folder) / f"robot{robot}")
            trackside("import", "mrclam", data_dir() / "MRCLAM_Dataset7", *words)
        jobs = [(Path(folder) / f"robot{robot}", name) for name in REQUESTS for robot in ROBOTS]
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            found = dict(zip(jobs, pool.map(run, *zip(*jobs, strict=True)), strict=True))
    results = {name: [r for (_, n), r in found.items() if n == name] for name in REQUESTS}
    seeds = [results[f"fastslam-{seed}"] for seed in range(SEEDS)]
    likeliest = [max(of_robot, key=lambda r: r.likelihood) for of_robot in zip(*seeds, strict=True)]
    known = results["known"]
    tables = {
        f"FastSLAM robust, likelihood, --smooth, the likeliest of {SEEDS} seeds": likeliest,
        "EKF-SLAM robust, nearest, --smooth": results["nearest"],
        "EKF-SLAM robust, jcbb, --smooth": results["jcbb"],
    }
    for title, rows in tables.items():
        print(table(title, rows, known, results["known-smoothed"]).render("md"))
        print()
    print(seeds_table(seeds).render("md"))
    print()
    reached = sum(is_reached(r, k) for r, k in zip(likeliest, known, strict=True))
    print(
        against({"robots missed": 2.0}, {"robots missed": float(len(ROBOTS) - reached)}).render(
            "md"
        )
    )


def run(folder: Path, name: str) -> Result:
    """One estimate of one session, and its score."""
    session, started = Session.open(folder), time.perf_counter()
    estimate = estimate_session(session, REQUESTS[name], name)[0]
    seconds = time.perf_counter() - started
    session.write_estimate(estimate)
    path, landmarks = scored(folder, name, "path"), scored(folder, name, "map")
    return Result(
        path["errors"]["pose"],
        path["errors"]["max_pose"],
        landmarks["errors"]["map"],
        len(estimate.map or ()),
        int(landmarks["counts"]["pairs"]),
        likelihood_of(estimate),
        seconds,
    )


def likelihood_of(estimate: Estimate) -> float:
    """What the final pass without names makes of its result; 0 where there was none."""
    smoothing = estimate.provenance.get("smoothing")
    unnamed = smoothing.get("unnamed") if isinstance(smoothing, dict) else None
    return float(unnamed["log_likelihood"]) if isinstance(unnamed, dict) else 0.0


def is_reached(result: Result, known: Result) -> bool:
    """15 +- 1 landmarks, and a path error of at most 1.5 times that with known ids."""
    right = abs(result.landmarks - LANDMARKS) <= SPARE
    return right and result.path_m <= RATIO_AT_MOST * known.path_m


def table(title: str, results: list[Result], known: list[Result], smoothed: list[Result]) -> Table:
    """A row per robot."""
    rows: list[tuple[Cell, ...]] = [
        (
            f"robot {robot}", r.landmarks, f"{r.pairs} of 15", r.path_m, r.worst_m, r.map_m,
            r.path_m / k.path_m, r.path_m / s.path_m, r.seconds,
            "met" if is_reached(r, k) else "MISSED",
        )
        for robot, r, k, s in zip(ROBOTS, results, known, smoothed, strict=True)
    ]  # fmt: skip
    columns = (
        "robot", "landmarks", "pairs", "path mean [m]", "path max [m]", "map [m]", "/ known",
        "/ known smoothed", "seconds", "",
    )  # fmt: skip
    return Table(columns, tuple(rows), title)


def seeds_table(seeds: list[list[Result]]) -> Table:
    """What each seed gave: landmarks, path error, log-likelihood."""
    rows: list[tuple[Cell, ...]] = []
    for robot, of_robot in zip(ROBOTS, zip(*seeds, strict=True), strict=True):
        cells = [f"{r.landmarks}, {r.path_m:.3f} m, {r.likelihood:.0f}" for r in of_robot]
        rows.append((robot, *cells))
    columns = ("robot", *(f"seed {seed}" for seed in range(len(seeds))))
    return Table(columns, tuple(rows), "Each seed: landmarks, path, log-likelihood")


if __name__ == "__main__":
    main()
