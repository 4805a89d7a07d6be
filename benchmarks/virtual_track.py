"""The whole chain against exact truth: emulators, recorder, film, tracker, join, calibrate.

    uv run python benchmarks/virtual_track.py [--first-seed 100] [--figures 2]

Nine runs (three maps, three powers, each a seed of its own) are simulated with the camera
calibrated from rendered boards, joined and tracked by the commands of a track day. Compared are the
ground truth of the joined session with the simulator's: the car's position and heading at every
frame, the cones, and how far the joined clock is off over the run. Then the calibration drive:
filmed, joined, tracked and calibrated, against how the virtual car was built.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from itertools import product
from multiprocessing import get_context
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from capture import Session, read_measured_calibration
from capture.result_files import read_ground_truth
from dialogue import Cell, Table
from geometry import wrap
from simulation.build import AS_BUILT

MAPS, POWERS = ("turn", "s-curve", "loop"), ("low", "medium", "high")
LIMITS = {"position [mm]": 5.0, "heading [deg]": 0.5, "cones [mm]": 3.0, "clock [ms]": 2.0}
"""Root mean squares; of the clock the largest error within the run."""


@dataclass(frozen=True)
class Found:
    """Of one run: what `LIMITS` bounds, in its order, and the position's largest error."""

    name: str
    figures: tuple[float, ...]
    position_max_mm: float


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first-seed", type=int, default=100)
    parser.add_argument("--figures", type=int, default=2, help="calibration drives")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        quietly("simulate", "--site-only", "-o", str(folder / "site"))
        with ProcessPoolExecutor(args.jobs, mp_context=get_context("spawn")) as pool:
            runs = [
                pool.submit(_run, folder, map_name, power, args.first_seed + k)
                for k, (map_name, power) in enumerate(product(MAPS, POWERS))
            ]
            drives = [
                pool.submit(_calibrated, folder, args.first_seed + 50 + k)
                for k in range(args.figures)
            ]
            print(_chain([run.result() for run in runs]).render("md"))
            print()
            print(_car([drive.result() for drive in drives]).render("md"))


def quietly(*words: str) -> None:
    """A command of trackside, its words kept to itself unless it fails."""
    from trackside.cli import trackside

    with Path(os.devnull).open("w") as nobody, redirect_stdout(nobody), redirect_stderr(nobody):
        code = trackside.main(args=list(words), standalone_mode=False)
    if isinstance(code, int) and code:
        sys.exit(f"trackside {' '.join(words)}: exit code {code}")


def joined(folder: Path, map_name: str, power: str, seed: int, *more: str) -> Path:
    """A simulated run, filmed, joined and tracked; its folder, which holds `run` and `truth`."""
    day = folder / f"{map_name}_{power}_{seed}"
    quietly(
        *("simulate", "--map", map_name, "--power", power, "--seed", str(seed), "--jobs", "1"),
        *("--site", str(folder / "site"), "-o", str(day), *more),
    )
    quietly(
        *("join", str(day / "car"), str(day / "film"), "--scene", str(day / "scene.yaml")),
        *("--no-clip", "-o", str(day / "run")),
    )
    return day


def _run(folder: Path, map_name: str, power: str, seed: int) -> Found:
    day = joined(folder, map_name, power, seed, "--no-stereo")
    session, true = Session.open(day / "run"), read_ground_truth(day / "truth")
    truth, clock = session.ground_truth(), session.info.film_clock
    assert truth.landmarks is not None
    assert true.landmarks is not None
    assert clock is not None
    inside = (truth.path.t_ns >= true.path.t_ns[0]) & (truth.path.t_ns <= true.path.t_ns[-1])
    path = truth.path.selected(inside)
    exact = true.path.interpolated(path.t_ns)
    off = np.hypot(path.x - exact.x, path.y - exact.y)
    turned = np.degrees(np.asarray(wrap(path.heading - exact.heading)))
    apart = truth.landmarks.positions[:, None] - true.landmarks.positions[None]
    cones = np.linalg.norm(apart, axis=2).min(axis=1)
    if len(cones) != len(true.landmarks):
        sys.exit(f"{day.name}: {len(cones)} cones were found, {len(true.landmarks)} stand there")
    told = true.provenance["film_clock"]
    assert isinstance(told, dict)
    # When the film really was at the first and the last pose, against when it is said to have been.
    zero_ns, skew = int(true.path.t_ns[0]), float(told["skew"])
    ends = np.array([0, int(true.path.t_ns[-1]) - zero_ns])
    film_ns = zero_ns - round(float(told["offset_s"]) * 1e9) + np.rint(ends / (1.0 + skew))
    said_ns = np.array([clock.session_ns(int(t)) for t in film_ns])
    late_ms = 1e-6 * np.abs(said_ns - (zero_ns + ends)).max()
    figures = (_rms(1e3 * off), _rms(turned), _rms(1e3 * cones), float(late_ms))
    return Found(day.name, figures, float(1e3 * off.max()))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def _calibrated(folder: Path, seed: int) -> dict[str, float]:
    """Parameter -> what a calibration drive, filmed, gave; the wheelbase by a tape of 2 mm."""
    day = joined(folder, "figures", "low", seed, "--no-stereo")
    target = str(day / "calibration_made")
    found: dict[str, float] = {}
    tape_mm = 260.0 + 2.0 * float(np.random.default_rng(seed).standard_normal())
    for kind, words in (("odometry", ("--wheelbase", f"{tape_mm:.1f}mm")), ("lidar", ())):
        quietly("calibrate", kind, str(day / "run"), *words, "-o", target)
        made = read_measured_calibration(Path(target), kind)
        found |= {f"{kind} {one.name}": one.value for one in made.parameters}
    return found


def _chain(found: list[Found]) -> Table:
    rows: list[tuple[Cell, ...]] = [(one.name, *one.figures, one.position_max_mm) for one in found]
    worst = [max(one.figures[k] for one in found) for k in range(len(LIMITS))]
    rows.append(("worst", *worst, max(one.position_max_mm for one in found)))
    rows.append(("at most", *LIMITS.values(), None))
    met = [_met(figure <= limit) for figure, limit in zip(worst, LIMITS.values(), strict=True)]
    rows.append(("", *met, None))
    return Table(("run", *LIMITS, "largest position [mm]"), tuple(rows), "joined truth - exact")


def _car(found: list[dict[str, float]]) -> Table:
    built = AS_BUILT
    checks: list[tuple[str, str, float, Callable[[float, float], float], float]] = [
        (
            "speed gain [%]",
            "odometry speed_to_erpm_gain",
            built.vesc.speed_to_erpm_gain,
            _percent,
            1.0,
        ),
        (
            "steering gain [%]",
            "odometry steering_angle_to_servo_gain",
            built.vesc.steering_angle_to_servo_gain,
            _percent,
            1.0,
        ),
        ("wheelbase [mm]", "odometry wheelbase_m", built.vesc.wheelbase_m, _milli, 5.0),
        ("lidar x [mm]", "lidar x_m", built.lidar.x_m, _milli, 3.0),
        ("lidar y [mm]", "lidar y_m", built.lidar.y_m, _milli, 3.0),
        ("lidar yaw [deg]", "lidar yaw_rad", built.lidar.yaw_rad, _degrees, 0.3),
    ]
    rows: list[tuple[Cell, ...]] = []
    for name, key, true, error, limit in checks:
        off = [error(one[key], true) for one in found]
        worst = max(off, key=abs)
        rows.append((name, true, worst, limit, _met(abs(worst) <= limit)))
    title = f"the car as calibrated from {len(found)} filmed drives, the worst of them"
    return Table(("error of", "true", "found", "at most", ""), tuple(rows), title)


def _percent(found: float, true: float) -> float:
    return 100.0 * (found / true - 1.0)


def _milli(found: float, true: float) -> float:
    return 1e3 * (found - true)


def _degrees(found: float, true: float) -> float:
    return float(np.degrees(found - true))


def _met(met: bool) -> str:
    return "met" if met else "MISSED"


if __name__ == "__main__":
    main()
