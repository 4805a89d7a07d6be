from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figures_drive import FIGURES, Truth, write_session

from calibration import CalibrationError
from calibration.lidar.calibrate import LidarResult, calibrate_lidar
from capture import Session, SessionInfo
from geometry import LandmarkMap

PLAN = FIGURES[1:3]
NOWHERE = np.zeros(3)


def found(folder: Path, truth: Truth, seed: int = 0) -> LidarResult:
    session = write_session(folder / f"run{seed}", PLAN, truth, seed, scans=True)
    return calibrate_lidar([session], NOWHERE)


@pytest.mark.parametrize(
    "truth",
    [
        Truth(lidar=(0.13, 0.0, 0.0262)),
        Truth(lidar=(0.11, 0.02, -3.1), range_bias_m=0.015),
        Truth(lidar=(0.13, -0.01, 1.6), lidar_late_s=0.008),
    ],
)
def test_the_pose_within_3_mm_and_a_third_of_a_degree_any_way_round(
    tmp_path: Path, truth: Truth
) -> None:
    """Among things that look like cones, and are none that are known."""
    result = found(tmp_path, truth)
    assert result.calibration.accepted, result.calibration.reasons
    np.testing.assert_allclose(result.mounting[:2], truth.lidar[:2], atol=3e-3)
    assert result.mounting[2] == pytest.approx(truth.lidar[2], abs=np.radians(0.3))
    assert result.calibration.value("range_bias_m") == pytest.approx(truth.range_bias_m, abs=2e-3)
    assert result.late_s == pytest.approx(truth.lidar_late_s, abs=2e-3)
    assert int(str(result.calibration.how["no_known_cone"])) > 50


@pytest.mark.slow
def test_errors_are_as_large_as_told(tmp_path: Path) -> None:
    truth = Truth()
    rows = []
    for seed in range(10):
        fit = found(tmp_path, truth, seed).fit
        rows.append((fit.values[:5] - [*truth.lidar, 0.0, 0.0]) / fit.sigma[:5])
    rms = np.sqrt((np.array(rows) ** 2).mean(axis=0))
    assert (rms[:4] < 1.8).all(), rms
    assert (rms[:4] > 0.2).all(), rms
    assert rms[4] < 3.0, rms


def test_cones_that_were_moved_are_refused(tmp_path: Path) -> None:
    session = write_session(tmp_path / "run", PLAN, scans=True)
    truth = session.ground_truth()
    assert truth.landmarks is not None
    other = Session.open(session.folder)
    moved = LandmarkMap(truth.landmarks.ids, truth.landmarks.positions + 40.0)
    other.write_ground_truth(replace(truth, landmarks=moved), replace=True)
    with pytest.raises(CalibrationError, match="drive among the cones"):
        calibrate_lidar([other], NOWHERE)


def test_a_truth_without_cones_is_refused(tmp_path: Path) -> None:
    session = write_session(tmp_path / "run", PLAN)
    bare = replace(session.ground_truth(), landmarks=None)
    with Session.create(tmp_path / "bare", SessionInfo()) as writer:
        writer.add_ground_truth(bare)
    with pytest.raises(CalibrationError, match="has no cones"):
        calibrate_lidar([Session.open(tmp_path / "bare")], NOWHERE)
