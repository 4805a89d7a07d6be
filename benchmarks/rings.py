"""How well and how fast ring markers are found and followed, on one core.

    uv run python benchmarks/rings.py [--seed N] [--quick]

Everything is rendered (`simulation.overhead`): 1080p, rings of 28 px, contrast 125 and noise 2.5
grey levels, unless a line says otherwise. Errors of centres are RMS per axis, errors on the floor
RMS of the distance. Times are medians; they depend on the machine and on who else uses it.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import cv2
import numpy as np
from ring_scenes import Drive, Run, image_shape, make_run, still_picture

from dialogue import Table
from geometry import Floats, RingShape, View, circle_centres, wrap
from simulation import Levels, oblique_view, straight_down_view
from tracking import RingSearch, State, find_rings

START_FRAMES = 3
NOISE, PSF_SIGMA_PX = 2.5, 0.7


@dataclass(frozen=True)
class Figure:
    """A line of the table: what was found, and how much it may be at most."""

    name: str
    found: float
    at_most: float
    stretch: float
    least: bool = False
    """Whether the figure must be at least that."""

    def row(self) -> tuple[str | float | None, ...]:
        """Name, found, limits, found over limit, verdict."""
        sign = -1.0 if self.least else 1.0

        def within(limit: float) -> bool:
            return sign * self.found <= sign * limit

        verdict = "MISSED"
        if within(self.at_most):
            verdict = "met, stretch too" if within(self.stretch) else "met"
        ratio = self.found / self.at_most if self.at_most else None
        return self.name, self.found, self.at_most, self.stretch, ratio, verdict


@dataclass(frozen=True)
class Effort:
    """Seed of the first scene, and how much is rendered."""

    seed: int
    scenes: int
    frames: int
    empty: int


Measurement: TypeAlias = Callable[[Effort], list[Figure]]


@dataclass(frozen=True, eq=False)
class Followed:
    """Errors of a run, frames after the start: pixels and metres, headings in degrees, times."""

    still_px: Floats
    car_px: Floats
    car_m: Floats
    heading_deg: Floats
    step_ms: Floats
    lost: int


def follow(run: Run, frames: int) -> Followed:
    """Track a run and compare with its truth."""
    tracker, rows, lost = run.tracker(), [], 0
    for k, (t_ns, heading, frame) in enumerate(run.frames(frames)):
        start = time.perf_counter()
        seen = tracker.step(frame.image, t_ns)
        took_ms = 1e3 * (time.perf_counter() - start)
        if k < START_FRAMES:
            continue
        lost += int((seen.states == State.LOST).sum())
        along = seen.xy_m[-2] - seen.xy_m[-1]
        off = np.degrees(wrap(np.arctan2(along[1], along[0]) - heading))
        pixels, metres = seen.centres_px - frame.centres_px, seen.xy_m - frame.xyz_m[:, :2]
        rows.append((pixels[:-2], pixels[-2:], metres[-2:], off, took_ms))
    still, car, floor, turn, ms = (np.array(column) for column in zip(*rows, strict=True))
    return Followed(still, car, floor, turn, ms, lost)


def rms(values: Floats) -> float:
    """Root mean square of what is not NaN: lost markers are counted in a line of their own."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def distance_mm(metres: Floats) -> float:
    """RMS length of vectors (..., 2) in millimetres."""
    return 1e3 * float(np.sqrt(2.0)) * rms(metres)


def centres_and_heading(effort: Effort) -> list[Figure]:
    """Centres in even light and shadows; the car's rings on the floor, and its heading."""
    seeds = range(effort.seed, effort.seed + effort.scenes)
    views = {"straight down": straight_down_view(), "oblique": oblique_view()}
    even = {
        name: [follow(make_run(v, 20, s), effort.frames) for s in seeds]
        for name, v in views.items()
    }
    down = views["straight down"]
    dark = [follow(make_run(down, 20, s, shadows=True), effort.frames) for s in seeds]
    limits = {"straight down": 0.3, "oblique": 0.5}

    def all_of(runs: list[Followed], what: str) -> Floats:
        return np.concatenate([getattr(run, what) for run in runs])

    lost = sum(run.lost for runs in (*even.values(), dark) for run in runs)
    still, shaded = (1e3 * rms(all_of(runs, "still_px")) for runs in (even["straight down"], dark))
    figures = [
        Figure("centre, even light [px/1000]", still, 15, 6),
        Figure("centre, shadow edges [px/1000]", shaded, 40, 15),
    ]
    for name, limit in limits.items():
        car = distance_mm(all_of(even[name], "car_m"))
        figures.append(Figure(f"car at 0.2 m, {name} [mm]", car, limit, 0.1))
    for name in limits:
        heading = rms(all_of(even[name], "heading_deg"))
        figures.append(Figure(f"heading, rings 0.2 m apart, {name} [deg]", heading, 0.1, 0.03))
    return [*figures, Figure("sights lost in these runs", lost, 0, 0)]


def tracking_time(effort: Effort) -> list[Figure]:
    """A frame of 20 and of 50 markers, two of them on a moving car.

    Each picture is copied into one buffer first: a decoder, too, has just written it.
    """
    figures = []
    for count, limits in ((20, (0.20, 0.10)), (50, (0.35, 0.18))):
        run = make_run(straight_down_view(), count, effort.seed)
        pictures = [(t_ns, frame.image) for t_ns, _, frame in run.frames(effort.frames)]
        times, buffer = [], np.empty_like(pictures[0][1])
        for _ in range(10):
            tracker = run.tracker()
            for k, (t_ns, image) in enumerate(pictures):
                np.copyto(buffer, image)
                start = time.perf_counter()
                tracker.step(buffer, t_ns)
                if k >= START_FRAMES:
                    times.append(1e3 * (time.perf_counter() - start))
        figures.append(Figure(f"tracking {count} markers [ms]", float(np.median(times)), *limits))
    return figures


def search_time(effort: Effort) -> list[Figure]:
    """A whole picture with 20 markers."""
    figures = []
    for rows, limits in ((1080, (12.0, 6.0)), (2160, (25.0, 14.0))):
        view = straight_down_view(rows)
        frame = still_picture(view, 20, effort.seed)
        search = RingSearch(smallest_px=20.0 * rows / 1080)
        times = []
        for _ in range(25):
            start = time.perf_counter()
            found = find_rings(frame.image, search)
            times.append(1e3 * (time.perf_counter() - start))
        assert len(found) == 20
        figures.append(
            Figure(f"full search, 20 markers, {rows} rows [ms]", float(np.median(times)), *limits)
        )
    return figures  # fmt: skip


def recall(effort: Effort) -> list[Figure]:
    """First frames with shadows and clutter; cluttered frames without a marker."""
    view, hits, total = straight_down_view(), 0, 0
    for seed in range(effort.seed, effort.seed + 2 * effort.scenes):
        frame = still_picture(view, 20, seed, shadows=True, clutter=True)
        found = find_rings(frame.image)
        apart = np.linalg.norm(found.centres_px[:, None] - frame.centres_px, axis=2)
        hits += int((apart.min(axis=0) < 1.0).sum())
        total += len(frame.centres_px)
    plain = gated = 0
    for seed in range(effort.seed, effort.seed + effort.empty):
        frame = still_picture(view, 0, seed, shadows=True, clutter=True)
        found = find_rings(frame.image)
        plain += len(found)
        gated += int(_on_the_floor(view, found.centres_px, found.diameters_px).sum())
    scale = 100.0 / effort.empty
    name = f"first-frame recall of {total}, shadows and clutter"
    return [
        Figure(name, hits / total, 0.97, 0.99, least=True),
        Figure("false positives in 100 cluttered frames", scale * plain, 3, 0),
        Figure("the same, of the size the floor demands", scale * gated, 3, 0),
    ]


def _on_the_floor(view: View, centres: Floats, diameters: Floats) -> np.ndarray:
    """Which rings have both axes within 5 % and 0.6 px of a ring lying on the floor."""
    if not len(centres):
        return np.zeros(0, bool)
    radius = RingShape().radius_m
    slopes = view.plane_jacobian(circle_centres(view, centres, 0.0, radius), 0.0)
    demanded = 2.0 * radius * np.linalg.svd(slopes, compute_uv=False)
    return np.asarray((np.abs(diameters - demanded) < 0.05 * demanded + 0.6).all(axis=1))


def fast_car(effort: Effort) -> list[Figure]:
    """1 to 3 m/s at 5 m/s2, then a bend of 5 m/s2 at 3 m/s; 30 fps, exposure 5 ms."""
    drive = Drive(radius_m=1.8, start_m_s=1.0, top_m_s=3.0, along_m_s2=5.0)
    runs = [
        follow(make_run(straight_down_view(), 20, seed, drive=drive), 2 * effort.frames)
        for seed in range(effort.seed, effort.seed + effort.scenes)
    ]
    car = np.concatenate([run.car_m for run in runs])
    return [
        Figure("car at 3 m/s and 5 m/s2: sights lost", sum(run.lost for run in runs), 0, 0),
        Figure("the same: place of its rings [mm]", distance_mm(car), 0.3, 0.1),
    ]


MEASUREMENTS: tuple[Measurement, ...] = (
    centres_and_heading,
    tracking_time,
    search_time,
    recall,
    fast_car,
)


def cramer_rao_px() -> float:
    """Bound of a centre, per axis (reference/ring_markers.md 6.2), for the rings measured here."""
    levels, shape = Levels(), RingShape()
    slopes = straight_down_view().plane_jacobian(np.zeros(2), 0.0)
    radius_px = shape.radius_m * float(np.sqrt(abs(np.linalg.det(slopes))))
    blur = np.sqrt(PSF_SIGMA_PX**2 + 1.0 / 12.0)
    noise = NOISE / (levels.paper - levels.ring)
    return float(noise * np.sqrt(2.0 * blur / np.sqrt(np.pi) / radius_px / (1.0 + shape.ratio)))


def yardstick_us() -> float:
    """Median time of a `remap` of 20 x 432 samples: 14 us where the limits of time were set.

    (reference/ring_markers.md 6.6.) How much slower this machine is just now.
    """
    image = np.zeros((1080, 1920), np.uint8)
    points = np.random.default_rng(0).uniform(200.0, 240.0, (20, 432, 2)).astype(np.float32)
    nothing, times = np.zeros((0, 0), np.float32), []
    for _ in range(2000):
        start = time.perf_counter()
        cv2.remap(image, points, nothing, cv2.INTER_LINEAR)
        times.append(1e6 * (time.perf_counter() - start))
    return float(np.median(times))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="a fifth of the pictures")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    effort = Effort(chosen.seed, 2, 12, 10) if chosen.quick else Effort(chosen.seed, 5, 40, 100)
    figures = [figure for measure in MEASUREMENTS for figure in measure(effort)]
    columns = ("figure", "found", "at most", "stretch", "found / at most", "")
    rows, columns_px = image_shape(straight_down_view())
    note = (
        f"{columns_px}x{rows}, seed {chosen.seed}; recall: at least. Cramer-Rao bound of a centre "
        f"in even light: {1e3 * cramer_rao_px():.2f} px/1000. A remap of 20x432 samples takes "
        f"{yardstick_us():.0f} us just now, 14 us where the limits of time were set."
    )
    table = Table(columns, tuple(figure.row() for figure in figures), "ring markers", note=note)
    print(table.render("md"))


if __name__ == "__main__":
    main()
