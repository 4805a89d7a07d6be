"""All algorithms side by side: right maps, error, consistency and time, simulated and real.

    uv run python benchmarks/algorithms.py [SEEDS] [DIR_OF_MRCLAM_SETS]

Each with its preset `robust`. Simulated: the three tracks of tests/slam/world.py among 5 % clutter,
without names, without alignment; "right" are the runs without any missed and without any false
landmark (c = 0.3 m); time is per scan, driving included, the median over the runs. Consistency: 50
laps of 10 s with known ids (tests/slam/gaussian/laps.py), noise as the filter is told, heading
noise 0.2 and 5 degrees a step; NEES of the pose, averaged over the laps: the median scan, and the
share of scans at which it lies within the 95 % bounds [2.36, 3.72]. Real: UTIAS MRCLAM set 7
through the real commands, known ids, means over five robots, where that set is to be found.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import dataclasses
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

TESTS = Path(__file__).parent.parent / "tests" / "slam"
sys.path[:0] = [str(TESTS), str(TESTS / "gaussian")]

import laps
import world
from mrclam import ROBOTS, data_dir, scored, trackside

from dialogue import Cell, Progress, Table
from slam.catalogue import ALGORITHMS
from slam.config import MotionNoise
from slam.interface import Slam

NAMES = ("ekf", "ekf-fej", "ukf", "fastslam", "fastslam2", "smoother")
TRACKS = ("turn", "s-curve", "loop")
STEP_NOISE_DEG = (0.2, 5.0)
LAPS, BOUNDS = 50, (2.36, 3.72)


@dataclass(frozen=True)
class Run:
    """How one drive ended, and what a scan of it cost."""

    outcome: world.Outcome
    scan_ms: float

    @property
    def right(self) -> bool:
        """Whether the map holds every landmark and no other."""
        return self.outcome.false_negatives == self.outcome.false_positives == 0


@dataclass(frozen=True)
class Consistency:
    """NEES of the pose averaged over laps: the median over the scans, and the share in bounds."""

    median: float
    inside: float


def main() -> None:
    """Print the tables, and how what is promised of the new ones stands."""
    seeds = int(sys.argv.pop(1)) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 30
    with Progress("simulated", len(NAMES)) as progress:
        runs, consistency = {}, {}
        for name in NAMES:
            runs[name] = {track: driven(name, track, seeds) for track in TRACKS}
            consistency[name] = [nees(name, np.radians(noise)) for noise in STEP_NOISE_DEG]
            progress.advance(1)
    print(simulated(runs, seeds).render("md"))
    print()
    print(consistent(consistency).render("md"))
    print()
    print(verdicts(runs, consistency).render("md"))
    if (data_dir() / "MRCLAM_Dataset7").is_dir():
        print()
        print(real(data_dir() / "MRCLAM_Dataset7").render("md"))


def made(name: str, association: int, seed: int, motion: MotionNoise | None = None) -> Slam:
    """The algorithm with its preset, or with the noise of the laps if `motion` is that."""
    algorithm = ALGORITHMS[name]
    config = algorithm.presets["robust"]
    if motion is not None:
        config = dataclasses.replace(config, motion=motion, observation=laps.CONFIG.observation)
    return algorithm.make(config, algorithm.associations[association], seed)


def driven(name: str, track: str, seeds: int) -> list[Run]:
    """A run per seed, the kernels compiled before."""
    runs = []
    for seed in range(-1, seeds):
        drive = world.drive(track, max(seed, 0))
        started = time.process_time()
        outcome = world.run(made(name, 1, max(seed, 0)), drive)
        runs.append(Run(outcome, (time.process_time() - started) * 1e3 / len(drive.scans)))
    return runs[1:]


def nees(name: str, step_noise_rad: float) -> Consistency:
    """Of 50 laps with this heading noise per step."""
    motion = laps.with_heading_noise(step_noise_rad).motion
    found = [laps.pose_nees(made(name, 0, seed, motion), motion, seed) for seed in range(LAPS)]
    average = np.mean(found, axis=0)
    inside = (average > BOUNDS[0]) & (average < BOUNDS[1])
    return Consistency(float(np.median(average)), float(inside.mean()))


def simulated(runs: dict[str, dict[str, list[Run]]], seeds: int) -> Table:
    """A row per track and algorithm."""
    rows: list[tuple[Cell, ...]] = []
    for track in TRACKS:
        for name in NAMES:
            some = runs[name][track]
            positions = [run.outcome.position_m for run in some]
            rows.append(
                (
                    track,
                    name,
                    float(np.mean([run.right for run in some])),
                    float(np.mean([run.outcome.false_negatives for run in some])),
                    float(np.mean([run.outcome.false_positives for run in some])),
                    float(np.mean(positions)),
                    max(positions),
                    float(np.nanmean([run.outcome.map_m for run in some])),
                    float(np.median([run.scan_ms for run in some])),
                )
            )
    columns = (
        "track", "algorithm", "right", "FN", "FP", "position [m]", "worst [m]", "map [m]",
        "scan [ms]",
    )  # fmt: skip
    return Table(columns, tuple(rows), f"5% clutter, {seeds} seeds, unknown association")


def consistent(found: dict[str, list[Consistency]]) -> Table:
    """A row per algorithm: median and share in bounds for each noise."""
    columns = ["algorithm"]
    for noise in STEP_NOISE_DEG:
        columns += [f"NEES, {noise} deg", f"in bounds, {noise} deg"]
    rows: list[tuple[Cell, ...]] = [
        (name, *(figure for one in found[name] for figure in (one.median, one.inside)))
        for name in NAMES
    ]
    title = f"Consistency over {LAPS} laps of 10 s, known ids; a perfect filter has 3.0"
    return Table(tuple(columns), tuple(rows), title)


def verdicts(runs: dict[str, dict[str, list[Run]]], found: dict[str, list[Consistency]]) -> Table:
    """What is promised of each new algorithm against the one it is to better."""
    position = {
        name: float(np.mean([r.outcome.position_m for t in TRACKS for r in runs[name][t]]))
        for name in NAMES
    }
    ekf = found["ekf"][1]
    promised = (
        ("position, fastslam2 with 100 particles / fastslam with 500",
         position["fastslam2"], position["fastslam"]),
        ("position, smoother / ekf", position["smoother"], position["ekf"]),
        ("NEES at 5 deg, ekf-fej / ekf", found["ekf-fej"][1].median, ekf.median),
        ("NEES at 5 deg, ukf / ekf", found["ukf"][1].median, ekf.median),
        ("scans out of bounds at 5 deg, ekf-fej / ekf",
         1.0 - found["ekf-fej"][1].inside, 1.0 - ekf.inside),
        ("scans out of bounds at 5 deg, ukf / ekf",
         1.0 - found["ukf"][1].inside, 1.0 - ekf.inside),
    )  # fmt: skip
    rows = tuple(
        (what, one, other, one / other, "met" if one <= other else "MISSED")
        for what, one, other in promised
    )
    return Table(("figure", "found", "at most", "found / at most", ""), rows)


def real(dataset: Path) -> Table:
    """A row per algorithm: means over the robots of MRCLAM, scored by `trackside score`."""
    rows: list[tuple[Cell, ...]] = []
    with tempfile.TemporaryDirectory() as folder, Progress("MRCLAM", len(NAMES)) as progress:
        sessions = [Path(folder) / f"robot{robot}" for robot in ROBOTS]
        for robot, session in zip(ROBOTS, sessions, strict=True):
            trackside("import", "mrclam", dataset, "--robot", robot, "-o", session)
        for name in NAMES:
            figures = [of_robot(session, name) for session in sessions]
            rows.append((name, *np.mean(figures, axis=0).tolist(), max(f[0] for f in figures)))
            progress.advance(1)
    columns = ("algorithm", "path [m]", "map [m]", "slam, whole process [s]", "worst robot [m]")
    return Table(columns, tuple(rows), "UTIAS MRCLAM 7, known ids, means over five robots")


def of_robot(session: Path, name: str) -> tuple[float, float, float]:
    """Path and map error, and the seconds that the whole command took."""
    words = ("--association", "known", "--algorithm", name)
    if name not in {path.name for path in session.parent.glob("robot*/estimates/*")}:
        trackside("slam", session, *words, "--name", f"compile-{name}")
    started = time.perf_counter()
    trackside("slam", session, *words)
    took_s = time.perf_counter() - started
    path, landmarks = scored(session, name, "path"), scored(session, name, "map")
    return path["errors"]["pose"], landmarks["errors"]["map"], took_s


if __name__ == "__main__":
    main()
