"""Makes `examples/loop`, the small recording that `trackside demo` scores.

    uv run python examples/make_loop.py

A car drives two and a half rounds of a loop between 14 cones on a floor of 4 x 4 m. Its odometry
slips in the turns, its sensor sees cones within 1.5 m with noise, misses some and sees some that
are not there. The noise is drawn from one seed, so that the example can be made again to the byte.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from capture import GroundTruth, Observations, Odometry, Session, SessionInfo
from geometry import Floats, LandmarkMap, Trajectory, between, compose, wrap

SEED = 20190611
START_NS = 1_557_835_200_000_000_000
ROUND_S = 11.0
ROUNDS = 2.5
ODOMETRY_HZ = 50
SCAN_HZ = 10
SEES_UP_TO_M = 1.5
RANGE_SIGMA_M = 0.03
BEARING_SIGMA_RAD = math.radians(1.0)
MISSED, CLUTTER_PER_SCAN = 0.08, 0.04


def main() -> None:
    """Write the session beside this file, or into the folder given."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "loop"
    random = np.random.default_rng(SEED)
    truth, cones = drive(), cone_map()
    info = SessionInfo(map="loop", power="low", trial=1, notes="made by examples/make_loop.py")
    with Session.create(target, info) as writer:
        writer.add_odometry(odometry(truth, random))
        writer.add_observations(observations(truth, cones, random))
        writer.add_ground_truth(
            GroundTruth(truth, cones, {"made_by": "examples/make_loop.py", "seed": SEED})
        )
    print(f"wrote {target}")


def drive() -> Trajectory:
    """The centre line, an oval with a dent, at ODOMETRY_HZ; starts and ends at rest."""
    n = int(ROUND_S * ROUNDS * ODOMETRY_HZ)
    t = np.linspace(0.0, 1.0, n)
    eased = t - np.sin(2.0 * np.pi * t) / (2.0 * np.pi)
    phase = 2.0 * np.pi * ROUNDS * eased
    radius = 1.25 + 0.15 * np.cos(2.0 * phase) + 0.10 * np.cos(3.0 * phase)
    x, y = 2.0 + radius * np.sin(phase), 2.0 - radius * np.cos(phase)
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    t_ns = START_NS + (np.arange(n) * (1e9 / ODOMETRY_HZ)).astype(np.int64)
    return Trajectory(t_ns, x, y, wrap(heading))


def cone_map() -> LandmarkMap:
    """Eight cones outside the line, six inside."""
    rows = []
    for count, offset, shift in ((8, 0.42, 0.2), (6, -0.45, 0.5)):
        phase = 2.0 * np.pi * (np.arange(count) + shift) / count
        radius = 1.25 + 0.15 * np.cos(2.0 * phase) + 0.10 * np.cos(3.0 * phase) + offset
        rows.append(np.stack([2.0 + radius * np.sin(phase), 2.0 - radius * np.cos(phase)], axis=1))
    positions = np.concatenate(rows)
    return LandmarkMap(np.arange(1, len(positions) + 1), positions)


def odometry(truth: Trajectory, random: np.random.Generator) -> Odometry:
    """Wheel odometry: 2 % too long, turning 4 % too much, with slip that grows with the turn."""
    steps = between(truth.poses[:-1], truth.poses[1:])
    steps[:, 0] *= 1.02 + random.normal(0.0, 0.02, len(steps))
    steps[:, 2] = steps[:, 2] * 1.04 + random.normal(0.0, 0.004, len(steps))
    poses = np.zeros((len(truth), 3))
    for k, step in enumerate(steps):
        poses[k + 1] = compose(poses[k], step)
    speed = np.append(steps[:, 0], 0.0) * ODOMETRY_HZ
    return Odometry("wheel", truth.t_ns, poses, speed, np.append(steps[:, 2], 0.0) * ODOMETRY_HZ)


def observations(
    truth: Trajectory, cones: LandmarkMap, random: np.random.Generator
) -> Observations:
    """Cones as a lidar's cone finder would give them, without ids."""
    stamps: list[int] = []
    seen: list[Floats] = []
    for k in range(0, len(truth), ODOMETRY_HZ // SCAN_HZ):
        offset = cones.positions - truth.positions[k]
        range_m = np.hypot(offset[:, 0], offset[:, 1])
        bearing = np.arctan2(offset[:, 1], offset[:, 0]) - truth.heading[k]
        found = (range_m < SEES_UP_TO_M) & (random.random(len(cones)) > MISSED)
        scan = np.stack([range_m[found], bearing[found]], axis=1)
        scan += random.normal(0.0, [RANGE_SIGMA_M, BEARING_SIGMA_RAD], scan.shape)
        ghosts = random.poisson(CLUTTER_PER_SCAN)
        clutter = random.uniform([0.4, -math.pi], [SEES_UP_TO_M, math.pi], (ghosts, 2))
        scan = np.concatenate([scan, clutter])
        stamps += [int(truth.t_ns[k])] * len(scan)
        seen.append(scan)
    columns = np.concatenate(seen)
    ids = np.full(len(columns), -1, dtype=np.int64)
    return Observations(
        np.array(stamps, dtype=np.int64), ids, columns[:, 0], np.asarray(wrap(columns[:, 1]))
    )


if __name__ == "__main__":
    main()
