"""How well the clocks of car and film are told: error and honesty of sigma over many drives.

    uv run python benchmarks/clock_join.py [--seeds 200]

Synthetic drives of 13 s: a gyro of 200 Hz with bias, scale and noise, wheels of 2 mm counts that
run ahead under acceleration, a film of 30 Hz with gaps; true offset 0.4371 s, skew 15 ppm.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "calibration" / "clocks"))

from synthetic_drives import Drive

from calibration.clocks.clock_fit import fit_clock
from calibration.clocks.errors import ClockError
from dialogue import Table

GOAL_MS = 2.0
Row = tuple[str | float | int | None, ...]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    seeds = range(parser.parse_args().seeds)
    blurred = math.radians(0.3)
    rows = [
        _row("gyro and wheels", seeds, lambda k: Drive(seed=k)),
        _row("gyro", seeds, lambda k: Drive(seed=k), ("gyro",)),
        _row("wheels", seeds, lambda k: Drive(seed=k), ("wheels",)),
        _row("film at 15 Hz, 0.3 deg", seeds,
             lambda k: Drive(seed=k, film_hz=15.0, heading_sigma_rad=blurred)),
        _row("a minute", seeds, lambda k: Drive(seed=k, driven_s=56.0)),
        _row("clocks a year apart", seeds, lambda k: Drive(seed=k, offset_s=3.2e7)),
        _row("another run's film", seeds, lambda k: Drive(seed=k), other=True),
    ]  # fmt: skip
    columns = (
        "drives", "joined", "refused", "rms error [ms]", "worst [ms]", "mean sigma [ms]",
        "chi square / n", "time [ms]",
    )  # fmt: skip
    title = f"offset of the film's clock over {len(seeds)} drives; goal {GOAL_MS:g} ms"
    print(Table(columns, tuple(rows), title).render("md"))


def _row(
    name: str,
    seeds: range,
    drive: Callable[[int], Drive],
    sources: tuple[str, ...] = ("gyro", "wheels"),
    *,
    other: bool = False,
) -> Row:
    errors, sigmas, refused = [], [], 0
    spent_s = 0.0
    for seed in seeds:
        driven = drive(seed)
        filmed = drive(seed + 5000) if other else driven
        motions = [(getattr(driven, one)()[0], getattr(filmed, one)()[1]) for one in sources]
        begun_s = time.perf_counter()
        try:
            fit = fit_clock(motions)
            good = fit.good
        except ClockError:
            good = False
        spent_s += time.perf_counter() - begun_s
        if not good:
            refused += 1
            continue
        errors.append(fit.offset_s - driven.offset_at(fit.ref_ns))
        sigmas.append(fit.sigma_offset_s)
    joined, each_ms = len(errors), 1e3 * spent_s / len(seeds)
    if not joined:
        return (name, 0, refused, None, None, None, None, each_ms)
    error = np.array(errors)
    chi_square = float(np.mean((error / np.array(sigmas)) ** 2))
    rms_ms, worst_ms = 1e3 * float(np.sqrt(np.mean(error**2))), 1e3 * float(np.abs(error).max())
    return (
        name, joined, refused, rms_ms, worst_ms, 1e3 * float(np.mean(sigmas)), chi_square, each_ms,
    )  # fmt: skip


if __name__ == "__main__":
    main()
