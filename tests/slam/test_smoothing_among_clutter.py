"""The final pass without names on the simulated tracks: no harm to the map, good for the path."""

from __future__ import annotations

import numpy as np
import world

from capture import Observations, Odometry
from geometry import Floats, compose
from slam.config import PRESETS
from slam.ekf import EkfSlam
from slam.run import run_slam
from slam.smoothing.unnamed import smooth_unnamed


def data_of(drive: world.Drive) -> tuple[Odometry, Observations]:
    poses: list[Floats] = [np.zeros(3)]
    for increment in drive.increments:
        poses.append(compose(poses[-1], increment))
    t_ns = np.round(np.arange(len(poses)) / world.RATE_HZ * 1e9).astype(np.int64)
    nothing = np.zeros(len(poses))
    sizes = [ids.size for ids, _, _ in drive.scans]
    seen = Observations(
        np.repeat(t_ns, sizes),
        np.full(sum(sizes), -1),
        np.concatenate([ranges for _, ranges, _ in drive.scans]),
        np.concatenate([bearings for _, _, bearings in drive.scans]),
    )
    return Odometry("wheel", t_ns, np.array(poses), nothing, nothing), seen


def test_the_same_pass_that_serves_a_camera_serves_the_cars() -> None:
    before: list[float] = []
    after: list[float] = []
    for track in ("turn", "s-curve", "loop"):
        for seed in range(3):
            drive = world.drive(track, seed, world.Noise(clutter=0.1))
            odometry, seen = data_of(drive)
            filtered, _ = run_slam(EkfSlam(PRESETS["robust"], "nearest"), odometry, seen, name="x")
            smoothed = smooth_unnamed(filtered, odometry, seen)
            assert smoothed.map is not None
            pairs = world.paired(drive.cones, smoothed.map.landmarks.positions)
            assert len(smoothed.map) == pairs.size == len(drive.cones)
            for errors, estimate in ((before, filtered), (after, smoothed)):
                found = estimate.path.interpolated(odometry.t_ns).positions
                errors.append(float(np.hypot(*(found - drive.poses[:, :2]).T).mean()))
    assert np.mean(after) < 0.9 * np.mean(before)
