from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figures_drive import BELIEVED, FIGURES, Plan, Truth, write_session

from calibration import CalibrationError
from calibration.driven import driven_of
from calibration.odometry.calibrate import calibrate_odometry
from calibration.odometry.result import OdometryResult, Tape

CAR = Truth().car
SEEDS = 10


def found(
    folder: Path, seed: int = 0, tape: Tape | None = None, *, gyro: bool = True
) -> OdometryResult:
    session = write_session(folder / f"run{seed}", seed=seed, gyro=gyro)
    return calibrate_odometry([driven_of(session)], BELIEVED, tape)


def value(result: OdometryResult, name: str) -> float:
    got = result.calibration.value(name)
    assert got is not None
    return got


@pytest.mark.parametrize("gyro", [True, False])
def test_gains_within_a_percent_and_the_wheelbase_within_5_mm(tmp_path: Path, gyro: bool) -> None:
    """The tape is 1 mm off; gyro or no gyro."""
    result = found(tmp_path, tape=Tape(0.261, 0.002), gyro=gyro)
    assert result.calibration.accepted, result.calibration.reasons
    assert value(result, "speed_to_erpm_gain") == pytest.approx(CAR.speed_to_erpm_gain, rel=2e-3)
    gain = CAR.steering_angle_to_servo_gain
    assert value(result, "steering_angle_to_servo_gain") == pytest.approx(gain, rel=0.01)
    offset = CAR.steering_angle_to_servo_offset
    assert value(result, "steering_angle_to_servo_offset") == pytest.approx(offset, abs=2e-3)
    assert value(result, "wheelbase_m") == pytest.approx(CAR.wheelbase_m, abs=5e-3)
    assert value(result, "servo_lag_s") == pytest.approx(Truth().servo_lag_s, abs=6e-3)
    # The tape does not touch what the drive tells.
    bent = 1.0 / (gain * CAR.wheelbase_m)
    assert value(result, "curvature_per_servo_per_m") == pytest.approx(bent, rel=0.01)
    left = result.calibration.residuals
    assert left["path_rms_m"] < 0.1 < left["path_rms_before_m"]


def test_the_wheelbase_rests_on_the_tape_and_without_one_nothing_is_claimed(tmp_path: Path) -> None:
    taped = found(tmp_path, tape=Tape(0.26, 0.002)).calibration
    sources = {one.name: one.source for one in taped.parameters}
    assert "tape measure" in sources["wheelbase_m"]
    assert sources["speed_to_erpm_gain"] == "data"
    bare = calibrate_odometry([driven_of(write_session(tmp_path / "bare"))], BELIEVED).calibration
    assert not bare.accepted
    assert any("give --wheelbase" in reason for reason in bare.reasons)
    sigma = {one.name: one.sigma for one in bare.parameters}["wheelbase_m"]
    assert sigma is not None
    assert sigma > 0.01


@pytest.mark.slow
def test_errors_are_as_large_as_told(tmp_path: Path) -> None:
    names = (
        "speed_to_erpm_gain",
        "steering_angle_to_servo_offset",
        "curvature_per_servo_per_m",
        "servo_lag_s",
    )
    car = CAR
    true = (
        car.speed_to_erpm_gain,
        car.steering_angle_to_servo_offset,
        1.0 / (car.steering_angle_to_servo_gain * car.wheelbase_m),
        Truth().servo_lag_s,
    )
    rows = []
    for seed in range(SEEDS):
        result = found(tmp_path, seed, Tape(0.26, 0.002), gyro=False)
        sigma = {one.name: one.sigma for one in result.calibration.parameters}
        rows.append(
            [(value(result, n) - t) / (sigma[n] or 0.0) for n, t in zip(names, true, strict=True)]
        )
    standardised = np.array(rows)
    rms = np.sqrt((standardised**2).mean(axis=0))
    assert (rms < 1.7).all(), rms
    assert (rms > 0.1).all(), rms


@pytest.mark.parametrize(
    ("plan", "words"),
    [
        (((8.0, 0.3, 0.7),), "to the right; drive a full circle"),
        (((20.0, 0.02, 0.7), (20.0, -0.02, 0.7)), "steer further"),
        (((30.0, 0.3, 0.1), (30.0, -0.3, 0.1)), "slower than 700 ERPM"),
        (((1.0, 0.3, 0.7), (1.0, -0.3, 0.7)), "drive 5 m or more"),
    ],
)
def test_a_drive_that_shows_nothing_is_refused_with_what_to_drive(
    tmp_path: Path, plan: Plan, words: str
) -> None:
    drive = driven_of(write_session(tmp_path / "run", plan))
    with pytest.raises(CalibrationError, match=words):
        calibrate_odometry([drive], BELIEVED, Tape(0.26, 0.002))


def test_without_commands_the_distance_alone_is_found(tmp_path: Path) -> None:
    drive = driven_of(write_session(tmp_path / "run", FIGURES[:2], drive=False))
    with pytest.raises(CalibrationError, match=r"has no /drive.*--speed-only"):
        calibrate_odometry([drive], BELIEVED)
    result = calibrate_odometry([drive], BELIEVED, speed_only=True)
    assert result.calibration.accepted, result.calibration.reasons
    assert value(result, "speed_to_erpm_gain") == pytest.approx(CAR.speed_to_erpm_gain, rel=3e-3)
    assert value(result, "wheelbase_m") == BELIEVED.wheelbase_m
    assert result.paths_after is None


def test_a_motor_that_counts_backwards_is_told(tmp_path: Path) -> None:
    drive = driven_of(write_session(tmp_path / "run"))
    assert drive.counts is not None
    reverse = replace(drive, counts=-drive.counts)
    result = calibrate_odometry([reverse], BELIEVED, Tape(0.26, 0.002))
    assert value(result, "direction") == -1.0
    assert value(result, "speed_to_erpm_gain") == pytest.approx(CAR.speed_to_erpm_gain, rel=2e-3)
    gain = CAR.steering_angle_to_servo_gain
    assert value(result, "steering_angle_to_servo_gain") == pytest.approx(gain, rel=0.01)
