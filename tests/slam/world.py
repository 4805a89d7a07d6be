"""A small world: a car among cones, a lidar that finds cones by range, clutter. Plain numpy.

Not the simulator of the toolkit: just enough to ask whether a filter's map is right. The layouts
follow the thesis' turn, s-curve and loop: 13 to 16 cones inside 4 x 4 m, 0.5 to 0.9 m/s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, between, transform_points, wrap
from slam import Slam

RATE_HZ = 15.0
PAIRED_M = 0.3
HALF_LANE_M = 0.45
# Ten hits of a one-degree lidar on a cone of 0.1 m: blind below 0.52 m, none beyond 1.91 m.
RANGES_M = (0.522, 0.574, 1.433, 1.910)


@dataclass(frozen=True)
class Noise:
    """Of the world, per odometry step and per observation; clutter per true detection."""

    xy_m: float = 0.006
    heading_rad: float = np.radians(0.3)
    range_m: float = 0.03
    bearing_rad: float = np.radians(1.0)
    clutter: float = 0.05
    detected: float = 0.98


@dataclass(frozen=True)
class Drive:
    """What happened and what was measured; everything in the frame of the first pose.

    poses (k, 3) true, increments (k - 1, 3) measured; a list of scans (ranges, bearings), with the
    true cone of each observation or -1.
    """

    cones: Floats
    poses: Floats
    increments: Floats
    scans: list[tuple[npt.NDArray[np.int64], Floats, Floats]]


@dataclass(frozen=True)
class Outcome:
    """How a run ended, against the truth and without any alignment."""

    position_m: float
    map_m: float
    false_negatives: int
    false_positives: int


def centre_line(name: str) -> Floats:
    """(k, 2): the middle of the lane, densely."""
    if name == "turn":
        straight = np.stack([np.linspace(0.0, 1.8, 90), np.zeros(90)], axis=1)
        angle = np.linspace(-np.pi / 2, 0.0, 90)
        bend = np.stack([1.8 + 1.2 * np.cos(angle), 1.2 + 1.2 * np.sin(angle)], axis=1)
        up = np.stack([np.full(90, 3.0), np.linspace(1.2, 3.0, 90)], axis=1)
        return np.concatenate([straight, bend[1:], up[1:]])
    if name == "s-curve":
        along = np.linspace(0.0, 3.8, 300)
        return np.stack([along, 0.45 * np.sin(along / 3.8 * 2.0 * np.pi)], axis=1)
    angle = np.linspace(-np.pi / 2, -np.pi / 2 + 4.0 * np.pi, 900)
    return np.stack([1.3 * np.cos(angle), 1.3 * np.sin(angle)], axis=1)


def cones_beside(name: str) -> Floats:
    """(n, 2): cones on both sides of the lane."""
    line = centre_line(name)
    if name == "loop":
        outer, inner = np.arange(9) * 2.0 * np.pi / 9, np.arange(5) * 2.0 * np.pi / 5
        angle = np.concatenate([outer, inner])
        radius = np.repeat([1.3 + HALF_LANE_M, 1.3 - HALF_LANE_M], [9, 5])[:, None]
        circle: Floats = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return circle
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    sides = []
    for side, n in ((1.0, 7 if name == "turn" else 8), (-1.0, 7 if name == "turn" else 8)):
        at = np.linspace(0.35, travelled[-1] - 0.05, n)
        point = np.stack([np.interp(at, travelled, line[:, k]) for k in range(2)], axis=1)
        ahead = np.stack([np.interp(at + 0.02, travelled, line[:, k]) for k in range(2)], axis=1)
        behind = np.stack([np.interp(at - 0.02, travelled, line[:, k]) for k in range(2)], axis=1)
        along = (ahead - behind) / np.hypot(*(ahead - behind).T)[:, None]
        sides.append(point + side * HALF_LANE_M * np.stack([-along[:, 1], along[:, 0]], axis=1))
    return np.concatenate(sides)


def drive(name: str, seed: int, noise: Noise = Noise()) -> Drive:
    """One run through a layout; speed varies between 0.5 and 0.9 m/s, 1 s at rest first."""
    random = np.random.Generator(np.random.PCG64(seed))
    line = centre_line(name)
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    speed = 0.7 + 0.2 * np.sin(np.arange(0.0, 60.0, 1.0 / RATE_HZ) + random.uniform(0.0, 6.0))
    at = np.concatenate([np.zeros(15), np.cumsum(speed) / RATE_HZ])
    at = at[at < travelled[-1] - 0.03]
    x, y = (np.interp(at, travelled, line[:, k]) for k in range(2))
    x2, y2 = (np.interp(at + 0.03, travelled, line[:, k]) for k in range(2))
    world = np.stack([x, y, np.arctan2(y2 - y, x2 - x)], axis=1)
    poses = between(world[:1], world)
    cones = transform_points(between(world[0], np.zeros(3)), cones_beside(name))
    moved = between(poses[:-1], poses[1:])
    sigma = np.array([noise.xy_m, noise.xy_m, noise.heading_rad])
    at_rest = np.hypot(moved[:, 0], moved[:, 1]) < 1e-9
    errors = np.where(at_rest[:, None], 0.0, random.normal(0.0, sigma, moved.shape))
    return Drive(cones, poses, moved + errors, [scan(pose, cones, noise, random) for pose in poses])


def scan(
    pose: Floats, cones: Floats, noise: Noise, random: np.random.Generator
) -> tuple[npt.NDArray[np.int64], Floats, Floats]:
    """One revolution: true cones by detection probability, then clutter evenly over the disc."""
    dx, dy = cones[:, 0] - pose[0], cones[:, 1] - pose[1]
    ranges, bearings = np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - pose[2])
    probability = np.interp(ranges, RANGES_M, [0.0, noise.detected, noise.detected, 0.0])
    ids = np.flatnonzero(random.uniform(size=ranges.size) < probability)
    ranges = ranges[ids] + random.normal(0.0, noise.range_m, ids.size)
    bearings = bearings[ids] + random.normal(0.0, noise.bearing_rad, ids.size)
    false = random.poisson(noise.clutter * ids.size)
    anywhere = np.sqrt(random.uniform(0.3**2, 2.0**2, false))
    return (
        np.concatenate([ids, np.full(false, -1)]).astype(np.int64),
        np.concatenate([ranges, anywhere]),
        wrap(np.concatenate([bearings, random.uniform(-np.pi, np.pi, false)])),
    )


def run(slam: Slam, driven: Drive) -> Outcome:
    """Drive a filter through it, without telling it which cone is which."""
    dt = np.array([1.0 / RATE_HZ])
    errors = []
    for k, (ids, ranges, bearings) in enumerate(driven.scans):
        if k > 0:
            slam.predict(driven.increments[k - 1 : k], dt)
        slam.update(round(k / RATE_HZ * 1e9), np.full(ids.size, -1), ranges, bearings)
        errors.append(np.hypot(*(slam.pose - driven.poses[k])[:2]))
    found = slam.estimated_map().landmarks.positions
    distances = paired(driven.cones, found)
    return Outcome(
        float(np.mean(errors)),
        float(np.mean(distances)) if distances.size else float("nan"),
        len(driven.cones) - distances.size,
        len(found) - distances.size,
    )


def paired(cones: Floats, found: Floats) -> Floats:
    """Distances of the one-to-one pairs within 0.3 m, closest first (cones stand further apart)."""
    apart = np.hypot(cones[:, None, 0] - found[None, :, 0], cones[:, None, 1] - found[None, :, 1])
    distances = []
    while apart.size and apart.min() <= PAIRED_M:
        i, j = np.unravel_index(np.argmin(apart), apart.shape)
        distances.append(apart[i, j])
        apart = np.delete(np.delete(apart, i, axis=0), j, axis=1)
    return np.array(distances)
