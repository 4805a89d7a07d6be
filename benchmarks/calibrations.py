"""Errors of the car's calibrations over seeds, against drives whose car is known.

    uv run python benchmarks/calibrations.py [--seeds 10]

The drives are the tests' own: lines and circles to both sides at 0.6 to 1.2 m/s, truth at 30 Hz
with 0.6 mm and 0.23 deg of noise (one sigma), a gyro, a tachometer, a servo 60 ms late, tyres that
slip, a lidar of 15 Hz and 720 beams with 5 mm among six cones and two things that look like some.
The tape measure of the wheelbase has 2 mm (one sigma), drawn anew for each seed. `z` is the error
over the sigma that the calibration told, root mean square over the seeds. `*_errors` take any
sessions with the truth of their car, and are what is to be called with simulated ones.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "calibration"))

import numpy as np
from figures_drive import FIGURES, Truth, write_session

from calibration.driven import driven_of
from calibration.imu.calibrate import calibrate_imu
from calibration.imu.scale import scale_of_fits
from calibration.lever.assumed import assumed_rings
from calibration.lever.calibrate import calibrate_lever
from calibration.lidar.calibrate import calibrate_lidar
from calibration.odometry.calibrate import calibrate_odometry
from calibration.odometry.result import Tape
from calibration.turning import fit_gyro
from capture import MeasuredCalibration, Session
from dialogue import Cell, Table
from drivers.vesc import VescCalibration

Errors = Mapping[str, tuple[float, float]]
"""Parameter -> error and the sigma that was told for it."""
LEVER = (0.012, -0.008, 0.02)


def odometry_errors(sessions: Sequence[Session], car: VescCalibration, tape: Tape) -> Errors:
    """Of a calibration from sessions of a car that is so."""
    old = sessions[0].motor_calibration()
    assert old is not None
    drives = [driven_of(session) for session in sessions]
    names = ("speed_to_erpm_gain", "steering_angle_to_servo_gain", "steering_angle_to_servo_offset")
    true = {name: float(getattr(car, name)) for name in (*names, "wheelbase_m")}
    return _errors(calibrate_odometry(drives, old, tape).calibration, true)


def lever_errors(sessions: Sequence[Session], lever: tuple[float, float, float]) -> Errors:
    """Of a calibration from truths in whose base_link the true one has the pose `lever`."""
    drives = [driven_of(session) for session in sessions]
    found = calibrate_lever(drives, assumed_rings(sessions[0])).calibration
    return _errors(found, dict(zip(("ahead_m", "left_m", "yaw_rad"), lever, strict=True)))


def lidar_errors(sessions: Sequence[Session], mounting: tuple[float, float, float]) -> Errors:
    """Of a calibration from sessions of a car with its lidar there."""
    found = calibrate_lidar(sessions, np.zeros(3)).calibration
    return _errors(found, dict(zip(("x_m", "y_m", "yaw_rad"), mounting, strict=True)))


def imu_errors(session: Session, scale: float, bias_z_rad_s: float) -> Errors:
    """Of a calibration from a session with ground truth of an IMU that is so."""
    fit = fit_gyro(session.ground_truth().path, session.imu())
    assert fit is not None
    found = calibrate_imu(session.imu(), scale_of_fits([fit])).calibration
    # A gyro reads rate / scale + bias.
    return _errors(found, {"gyro_scale": scale, "gyro_bias_z_rad_s": bias_z_rad_s})


def _errors(calibration: MeasuredCalibration, true: Mapping[str, float]) -> Errors:
    told = {one.name: one for one in calibration.parameters}
    return {n: (told[n].value - value, told[n].sigma or np.nan) for n, value in true.items()}


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    seeds = parser.parse_args().seeds
    runs: dict[str, list[Errors]] = {"odometry": [], "markers": [], "lidar": [], "imu": []}
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(seeds):
            _run(Path(folder) / str(seed), seed, runs)
    rows = [row for kind, errors in runs.items() for row in _rows(kind, errors)]
    columns = ("calibration", "parameter", "mean error", "rms error", "worst", "z")
    print(Table(columns, tuple(rows), f"{seeds} seeds", digits=6).render("table"))


def _run(folder: Path, seed: int, runs: dict[str, list[Errors]]) -> None:
    folder.mkdir()
    truth, rng = Truth(), np.random.default_rng(1000 + seed)
    session = write_session(folder / "figures", FIGURES, truth, seed, scans=True)
    tape = Tape(truth.car.wheelbase_m + float(rng.normal(0.0, 0.002)), 0.002)
    runs["odometry"].append(odometry_errors([session], truth.car, tape))
    runs["lidar"].append(lidar_errors([session], truth.lidar))
    runs["imu"].append(imu_errors(session, truth.gyro_scale, truth.gyro_bias_rad_s))
    askew = write_session(folder / "rings", FIGURES, Truth(lever=LEVER), seed)
    runs["markers"].append(lever_errors([askew], LEVER))


def _rows(kind: str, runs: Sequence[Errors]) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for name in runs[0]:
        error, sigma = np.array([errors[name] for errors in runs]).T
        rows.append(
            (
                kind,
                name,
                float(error.mean()),
                float(np.sqrt((error**2).mean())),
                float(np.abs(error).max()),
                float(np.sqrt(((error / sigma) ** 2).mean())),
            )
        )
    return rows


if __name__ == "__main__":
    main()
