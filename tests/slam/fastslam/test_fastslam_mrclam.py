"""FastSLAM on five real robots with known ids."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from capture import Session
from capture.import_mrclam import import_mrclam
from geometry import planar_umeyama, transform_points
from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FastSlam
from slam.run import run_slam

CONFIG = dataclasses.replace(FASTSLAM_PRESETS["robust"], particles=200)


@pytest.mark.realdata
@pytest.mark.slow
def test_five_real_robots_are_followed_within_a_quarter_metre(
    data_dir: Path, tmp_path: Path
) -> None:
    """Mean position error after aligning the path, averaged over robots and three seeds.

    A single seed can miss it: of six, five averaged 0.18 to 0.22 m over the robots, one 0.26 m.
    """
    errors = []
    for robot in range(1, 6):
        folder = tmp_path / str(robot)
        import_mrclam(data_dir / "mrclam" / "MRCLAM_Dataset7", robot, folder)
        session = Session.open(folder)
        truth = session.ground_truth().path
        for seed in range(3):
            estimate, _ = run_slam(
                FastSlam(CONFIG, "known", seed=seed),
                session.odometry(None),
                session.observations(),
                name="fastslam",
                path_period_s=CONFIG.path_period_s,
            )
            t_ns = estimate.path.t_ns
            both = (t_ns >= truth.t_ns[0]) & (t_ns <= truth.t_ns[-1])
            true = truth.interpolated(t_ns[both]).positions
            found = estimate.path.positions[both]
            moved = transform_points(planar_umeyama(found, true), found)
            errors.append(float(np.mean(np.hypot(*(moved - true).T))))
            assert estimate.map is not None
            assert len(estimate.map) == 15
    assert np.mean(errors) <= 0.25, errors
