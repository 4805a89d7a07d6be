"""Five real robots through the real commands: import, slam, score. Prints the table of results.md.

    uv run python benchmarks/mrclam.py [DIR_OF_MRCLAM_SETS]

Every robot with the same preset and no `--set`; path error after `--align path`, map error after
`--align map` with c = 0.5 m. Dead reckoning (the odometry alone, scored the same way) stands
beside it as the anchor. Times are whole processes with the kernels in the cache.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from dialogue import Cell, Table

ROBOTS = (1, 2, 3, 4, 5)
SLAM = ("--association", "known", "--preset", "robust")
LIMITS = {"mean path": 0.22, "worst path": 0.32, "mean map": 0.09, "slowest": 3.0}


@dataclass(frozen=True)
class Result:
    """What one robot's run scored."""

    robot: int
    dead_reckoning_m: float
    path_m: float
    worst_m: float
    map_m: float
    pairs: int
    false_negatives: int
    false_positives: int
    slam_s: float


def main() -> None:
    """Print the table and how the figures stand against their limits."""
    with tempfile.TemporaryDirectory() as folder:
        results = [run(data_dir() / "MRCLAM_Dataset7", robot, Path(folder)) for robot in ROBOTS]
    print(table(results).render("md"))
    print()
    print(verdicts(results).render("md"))


def run(dataset: Path, robot: int, folder: Path) -> Result:
    """One robot through the commands; sessions go into `folder`."""
    session = folder / f"robot{robot}"
    trackside("import", "mrclam", dataset, "--robot", robot, "-o", session)
    if robot == ROBOTS[0]:
        trackside("slam", session, *SLAM, "--name", "compile")
    started = time.perf_counter()
    trackside("slam", session, *SLAM, "--name", "ekf")
    slam_s = time.perf_counter() - started
    path = scored(session, "ekf", "path")
    landmarks = scored(session, "ekf", "map")
    trackside("export", "tum", session, "-o", folder / f"tum{robot}")
    odometry = folder / f"tum{robot}" / "odometry_wheel.tum"
    truth = session / "ground_truth" / "car.tum"
    words = ("--truth", truth, "--path", odometry, "--align", "path", "--format", "json")
    dead = json.loads(trackside("score", *words))["scores"][0]
    return Result(
        robot,
        dead["errors"]["pose"],
        path["errors"]["pose"],
        path["errors"]["max_pose"],
        landmarks["errors"]["map"],
        int(landmarks["counts"]["pairs"]),
        int(landmarks["errors"]["false_negatives"]),
        int(landmarks["errors"]["false_positives"]),
        slam_s,
    )


def scored(session: Path, name: str, align: str) -> dict[str, dict[str, float]]:
    """The JSON score of an estimate under one alignment, pairing distance 0.5 m."""
    words = ("--estimate", name, "--align", align, "--cutoff", "0.5", "--no-report")
    found = json.loads(trackside("score", session, *words, "--format", "json"))
    one: dict[str, dict[str, float]] = found["scores"][0]
    return one


def trackside(*words: object) -> str:
    """Run one command as a user does; its standard output."""
    command = [sys.executable, "-m", "trackside", *map(str, words)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def table(results: list[Result]) -> Table:
    """A row per robot and their mean."""
    rows: list[tuple[Cell, ...]] = [
        (
            f"robot {r.robot}",
            r.dead_reckoning_m,
            r.path_m,
            r.worst_m,
            r.map_m,
            f"{r.pairs} of 15",
            r.false_negatives,
            r.false_positives,
            r.slam_s,
        )
        for r in results
    ]
    mean = [
        sum(values) / len(results)
        for values in zip(
            *((r.dead_reckoning_m, r.path_m, r.worst_m, r.map_m) for r in results), strict=True
        )
    ]
    rows.append(("mean", *mean, "", None, None, sum(r.slam_s for r in results) / len(results)))
    columns = (
        "", "dead reckoning [m]", "path mean [m]", "path max [m]", "map [m]", "pairs", "FN", "FP",
        "slam, whole process [s]",
    )  # fmt: skip
    return Table(columns, tuple(rows), "EKF-SLAM on UTIAS MRCLAM 7, preset robust, known ids")


def verdicts(results: list[Result]) -> Table:
    """Each figure that is promised against its limit."""
    n = len(results)
    found = {
        "mean path": sum(r.path_m for r in results) / n,
        "worst path": max(r.path_m for r in results),
        "mean map": sum(r.map_m for r in results) / n,
        "slowest": max(r.slam_s for r in results),
    }
    return against(LIMITS, found)


def against(limits: dict[str, float], found: dict[str, float]) -> Table:
    """Figures beside the limits of the same name."""
    rows = tuple(
        (name, found[name], limit, found[name] / limit, "met" if found[name] <= limit else "MISSED")
        for name, limit in limits.items()
    )
    return Table(("figure", "found", "at most", "found / at most", ""), rows)


def data_dir() -> Path:
    """Where the MRCLAM sets lie: the first argument, or in `TRACKSIDE_DATA`."""
    if len(sys.argv) > 1:
        return Path(sys.argv[1])
    shared = Path(__file__).parent.parent.parent / "shared" / "data"
    return Path(os.environ.get("TRACKSIDE_DATA", shared)) / "mrclam"


if __name__ == "__main__":
    main()
