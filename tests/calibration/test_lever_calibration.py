from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figures_drive import FIGURES, Truth, write_session

from calibration import CalibrationError
from calibration.driven import driven_of
from calibration.lever.assumed import assumed_rings
from calibration.lever.calibrate import LeverResult, calibrate_lever, scene_text
from capture import configuration_from_text
from geometry import compose, inverse
from tracking import CarRings, Scene

LEVER = (0.012, -0.008, 0.02)
TRUTH = Truth(lever=LEVER)


def found(folder: Path, seed: int = 0, *, motor: bool = True, gyro: bool = True) -> LeverResult:
    session = write_session(folder / f"run{seed}", truth=TRUTH, seed=seed, motor=motor, gyro=gyro)
    return calibrate_lever([driven_of(session)], assumed_rings(session))


def test_the_lever_arm_within_2_mm(tmp_path: Path) -> None:
    result = found(tmp_path)
    assert result.calibration.accepted, result.calibration.reasons
    ahead, left, yaw = (result.calibration.value(n) for n in ("ahead_m", "left_m", "yaw_rad"))
    assert ahead == pytest.approx(LEVER[0], abs=2e-3)
    assert left == pytest.approx(LEVER[1], abs=2e-3)
    assert yaw == pytest.approx(LEVER[2], abs=2e-3)
    told = result.calibration.residuals
    assert told["sideways_rms_m"] < 0.2 * told["sideways_rms_before_m"]


def test_the_scene_that_it_tells_puts_base_link_where_it_is(tmp_path: Path) -> None:
    """A truth made with those rings has no lever arm left."""
    rings = found(tmp_path).rings
    scene = configuration_from_text(Scene, scene_text(rings), "scene")
    assert scene.car.front_x_m == pytest.approx(rings.front_x_m, abs=1e-4)
    before = CarRings()
    # The same rings seen from both base_links: pose_line_base of each leads to the same line.
    lever = compose(inverse(np.array(before.pose_line_base)), np.array(rings.pose_line_base))
    middle = 0.5 * (rings.front_x_m + rings.rear_x_m) - 0.5 * (before.front_x_m + before.rear_x_m)
    lever[:2] -= [middle, 0.0]
    np.testing.assert_allclose(lever, LEVER, atol=2e-3)


def test_without_a_tachometer_the_side_is_not_claimed(tmp_path: Path) -> None:
    result = found(tmp_path, motor=False)
    parameters = {one.name: one for one in result.calibration.parameters}
    assert parameters["ahead_m"].value == pytest.approx(LEVER[0], abs=2e-3)
    assert parameters["left_m"].source.startswith("prior")
    assert (parameters["left_m"].sigma or 0.0) > 0.01
    assert "metres_per_count" not in parameters


def test_errors_are_as_large_as_told(tmp_path: Path) -> None:
    rows = []
    for seed in range(10):
        result = found(tmp_path, seed, gyro=False)
        rows.append((result.fit.values[:3] - LEVER) / result.fit.sigma[:3])
    rms = np.sqrt((np.array(rows) ** 2).mean(axis=0))
    assert (rms < 1.7).all(), rms
    assert (rms > 0.2).all(), rms


def test_circles_to_one_side_or_too_few_are_refused(tmp_path: Path) -> None:
    one_side = driven_of(write_session(tmp_path / "left", FIGURES[:2]))
    with pytest.raises(CalibrationError, match="to the right; drive a full circle"):
        calibrate_lever([one_side], CarRings())
    fast = driven_of(write_session(tmp_path / "fast", ((9.0, 0.3, 2.2), (9.0, -0.3, 2.2))))
    with pytest.raises(CalibrationError, match="rolled gently in"):
        calibrate_lever([fast], CarRings())


def test_wheels_that_spin_do_not_spoil_it_and_a_car_that_drifts_is_rejected(tmp_path: Path) -> None:
    drive = driven_of(write_session(tmp_path / "run", truth=TRUTH))
    assert drive.counts is not None
    # For two seconds in a turn they turn half as fast again, and the tail goes out by 30 mm.
    burst = (drive.t_s > 8.0) & (drive.t_s < 10.0)
    spun = np.diff(drive.counts, prepend=drive.counts[:1])
    xy = drive.xy.copy()
    xy[burst, 0] += 0.03 * np.sin(9.0 * drive.t_s[burst])
    bursting = replace(drive, xy=xy, counts=drive.counts[0] + np.cumsum(spun * (1 + 0.5 * burst)))
    kept = calibrate_lever([bursting], CarRings())
    assert kept.calibration.accepted, kept.calibration.reasons
    np.testing.assert_allclose(kept.fit.values[:3], LEVER, atol=2.5e-3)
    sliding = write_session(tmp_path / "slides", truth=replace(TRUTH, slip=0.08))
    drifted = calibrate_lever([driven_of(sliding)], CarRings())
    assert not drifted.calibration.accepted
    assert "it drifted; drive gently" in drifted.calibration.reasons[-1]


def test_one_speed_leaves_the_tyres_in_doubt(tmp_path: Path) -> None:
    """At one speed a lever arm looks like the slip of the tyres: the sigma says so."""
    plan = ((9.0, 0.3, 0.8), (9.0, -0.3, 0.8))
    session = write_session(tmp_path / "run", plan, replace(TRUTH, slip=0.02))
    result = calibrate_lever([driven_of(session)], assumed_rings(session))
    assert not result.calibration.accepted
    assert "twice that" in result.calibration.reasons[0]
    off = abs(result.fit.values[0] - LEVER[0])
    assert off < 2.5 * result.fit.sigma[0]
