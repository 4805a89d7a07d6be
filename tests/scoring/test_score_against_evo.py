"""Agreement with evo, the field's trajectory scorer, on the same files."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from score_scenes import lap

from capture import Estimate, GroundTruth, read_planar_tum, read_tum
from capture.errors import TextFileError
from geometry import Trajectory
from scoring import ScoreOptions, score, score_space

STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "sse")


def _evo_path(trajectory: Trajectory) -> Any:
    from evo.core.trajectory import PoseTrajectory3D

    zeros = np.zeros(len(trajectory))
    half = trajectory.heading / 2
    return PoseTrajectory3D(
        positions_xyz=np.stack([trajectory.x, trajectory.y, zeros], axis=1),
        orientations_quat_wxyz=np.stack([np.cos(half), zeros, zeros, np.sin(half)], axis=1),
        timestamps=(trajectory.t_ns - trajectory.t_ns[0]) * 1e-9,
    )


def _evo_statistics(metric: Any, reference: Any, estimate: Any) -> dict[str, float]:
    metric.process_data((reference, estimate))
    statistics: dict[str, float] = metric.get_all_statistics()
    return statistics


def _planar_pair() -> tuple[Trajectory, Trajectory]:
    rng = np.random.default_rng(0)
    truth = lap(400)
    drift = np.cumsum(rng.normal(0, 0.002, (3, 400)), axis=1)
    bent = Trajectory(truth.t_ns, truth.x + drift[0], truth.y + drift[1], truth.heading + drift[2])
    return truth, bent.transformed(np.array([1.0, -2.0, 0.7]))


@pytest.mark.parametrize(("unit", "delta"), [("f", 1), ("f", 7), ("m", 0.4)])
def test_a_planar_pair_has_evos_statistics(unit: str, delta: float) -> None:
    from evo.core.metrics import APE, RPE, PoseRelation, Unit

    truth, estimate = _planar_pair()
    options = ScoreOptions(align="path", rpe_unit=unit, rpe_delta=delta)  # type: ignore[arg-type]  # f or m
    ours = score(GroundTruth(truth), Estimate("e", estimate), options).metrics
    reference, aligned = _evo_path(truth), _evo_path(estimate)
    aligned.align(reference, correct_scale=False)
    units = {"f": Unit.frames, "m": Unit.meters}
    relations = {
        "rpe": PoseRelation.translation_part,
        "rpe_rotation": PoseRelation.rotation_angle_rad,
    }
    theirs = {"ate": _evo_statistics(APE(PoseRelation.translation_part), reference, aligned)}
    for name, relation in relations.items():
        metric = RPE(relation, delta, units[unit])
        theirs[name] = _evo_statistics(metric, reference, copy.deepcopy(aligned))
    for name, statistics in theirs.items():
        # evo takes the rotation angle from a trace: near zero only half the digits are left.
        tolerance = 1e-7 if name == "rpe_rotation" else 1e-9
        for key in STATISTICS:
            assert ours[f"{name}_{key}"] == pytest.approx(statistics[key], abs=tolerance), (
                name,
                key,
            )


@pytest.mark.realdata
def test_fr1_xyz_in_space_has_the_published_numbers_and_evos(data_dir: Path) -> None:
    from evo.core.metrics import APE, RPE, PoseRelation
    from evo.core.sync import associate_trajectories
    from evo.tools.file_interface import read_tum_trajectory_file

    files = [
        data_dir / "trajectories" / f"freiburg1_xyz-{n}.txt" for n in ("groundtruth", "rgbdslam")
    ]
    options = ScoreOptions(space="3d", align="path", sync="nearest", max_diff_s=0.01)
    truth, estimate = (read_tum(file).path for file in files)
    result = score_space(truth, estimate, "rgbdslam", options)
    published = {
        "ate_rmse": 0.013470,
        "ate_mean": 0.012024,
        "ate_median": 0.011183,
        "ate_max": 0.034760,
        "ate_std": 0.006071,
        "rpe_rmse": 0.005764,
    }
    for name, value in published.items():
        assert result.metrics[name] == pytest.approx(value, abs=1e-6), name
    reference, aligned = associate_trajectories(
        *(read_tum_trajectory_file(str(file)) for file in files), max_diff=0.01
    )
    aligned.align(reference, correct_scale=False)
    assert result.counts["poses"] == aligned.num_poses
    for name, metric in (
        ("ate", APE(PoseRelation.translation_part)),
        ("rpe", RPE(PoseRelation.translation_part)),
    ):
        theirs = _evo_statistics(metric, reference, aligned)
        for key in STATISTICS:
            assert result.metrics[f"{name}_{key}"] == pytest.approx(theirs[key], abs=1e-9)


@pytest.mark.realdata
def test_fr1_xyz_is_refused_in_the_plane(data_dir: Path) -> None:
    with pytest.raises(TextFileError, match=r"leaves the plane.*--space 3d"):
        read_planar_tum(data_dir / "trajectories" / "freiburg1_xyz-groundtruth.txt")
