from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from figures_drive import FIGURES, START_NS, Truth, driven, ground_truth, imu_of

from calibration import CalibrationError
from calibration.imu.allan import allan_deviation, noise_of
from calibration.imu.calibrate import calibrate_imu
from calibration.imu.magnetometer import Ellipsoid, fit_ellipsoid
from calibration.imu.scale import scale_of_turns
from calibration.imu.still import glitch_rows, still_part
from calibration.turning import fit_gyro
from capture import Imu
from geometry import Floats

G = 9.80665


def lying(seconds: float, seed: int = 0, rate_hz: float = 100.0, white: float = 1e-3) -> Imu:
    """At rest, bias 0.01, -0.02, 0.03 rad/s; white noise of `white` rad/s each sample."""
    rng, n = np.random.default_rng(seed), round(seconds * rate_hz)
    gyro = rng.normal([0.01, -0.02, 0.03], white, (n, 3))
    force = rng.normal([0.0, 0.0, G], 0.02, (n, 3))
    return Imu(START_NS + np.rint(np.arange(n) * 1e9 / rate_hz).astype(np.int64), gyro, force)


def test_allan_deviation_of_white_noise_and_of_a_random_walk_are_the_closed_forms() -> None:
    rng, period_s, n = np.random.default_rng(4), 0.01, 200_000
    white = rng.normal(0.0, 1.0, (n, 1))
    tau, deviation = allan_deviation(white, period_s)
    some = tau < 20.0
    np.testing.assert_allclose(deviation[some, 0], 0.1 / np.sqrt(tau[some]), rtol=0.12)
    walk = np.cumsum(rng.normal(0.0, np.sqrt(period_s), (n, 1)), axis=0)
    tau, deviation = allan_deviation(walk, period_s)
    some = (tau > 0.1) & (tau < 20.0)
    np.testing.assert_allclose(deviation[some, 0], np.sqrt(tau[some] / 3.0), rtol=0.25)


def test_allan_deviation_is_the_textbook_sum() -> None:
    values, m = np.random.default_rng(1).normal(size=(60, 1)), 3
    means = np.array([values[k : k + m, 0].mean() for k in range(60 - m + 1)])
    dense = np.sqrt(0.5 * np.mean((means[m:] - means[:-m]) ** 2))
    tau, deviation = allan_deviation(values, 1.0)
    assert deviation[tau == m, 0] == pytest.approx(dense)


def test_noise_is_told_apart_and_what_does_not_show_is_not_told() -> None:
    rng, period_s, n = np.random.default_rng(7), 0.02, 400_000
    white = rng.normal(0.0, 0.01, n)
    only = noise_of(*_one(allan_deviation(white[:, None], period_s)))
    assert only.white == pytest.approx(0.01 * np.sqrt(period_s), rel=0.05)
    assert only.walk is None
    steps = rng.normal(0.0, 2e-4 * np.sqrt(period_s), n)
    both = noise_of(*_one(allan_deviation((white + np.cumsum(steps))[:, None], period_s)))
    assert both.white == pytest.approx(0.01 * np.sqrt(period_s), rel=0.05)
    assert both.walk == pytest.approx(2e-4, rel=0.4)


def _one(found: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    return found[0], found[1][:, 0]


def test_bias_and_its_error_and_noise_densities() -> None:
    off = []
    for seed in range(12):
        result = calibrate_imu(lying(30.0, seed))
        told = {one.name: one for one in result.calibration.parameters}
        for axis, true in zip("xyz", (0.01, -0.02, 0.03), strict=True):
            one = told[f"gyro_bias_{axis}_rad_s"]
            off.append((one.value - true) / (one.sigma or 0.0))
        white = told["gyro_noise_z_rad_s_per_sqrt_hz"].value
        assert white == pytest.approx(1e-4, rel=0.2)
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.4
    assert result.calibration.accepted


def test_glitches_and_a_drive_in_between_do_not_spoil_the_bias() -> None:
    truth = Truth()
    imu = imu_of(driven(FIGURES, truth), truth, np.random.default_rng(3))
    # Slipped bytes while it stands and while it drives.
    for row in (100, 101, 300, 4000):
        imu.angular_velocity_rad_s[row] = (17.0, -9.0, 11.0)
    found = still_part(imu)
    assert found.mean[2] == pytest.approx(truth.gyro_bias_rad_s, abs=4 * found.sigma[2] + 1e-5)
    assert 1.5 <= found.seconds < 4.0
    assert found.glitches >= 3


def test_an_imu_that_never_lies_still_is_refused() -> None:
    imu = lying(20.0)
    imu.angular_velocity_rad_s[:] += np.random.default_rng(0).normal(0.0, 0.2, (2000, 3))
    with pytest.raises(CalibrationError, match="leave the car alone"):
        still_part(imu)


def test_the_scale_against_the_film_with_the_delay_of_the_stamps() -> None:
    truth = Truth(gyro_scale=0.985, gyro_late_s=0.006)
    off = []
    for seed in range(10):
        rng, motion = np.random.default_rng(seed), driven(FIGURES, truth)
        fit = fit_gyro(ground_truth(motion, truth, rng).path, imu_of(motion, truth, rng))
        assert fit is not None
        assert fit.scale == pytest.approx(0.985, abs=1e-3)
        assert fit.late_s == pytest.approx(0.006, abs=2e-3)
        values = [fit.scale, fit.bias_rad_s, fit.late_s]
        off.append((values - np.array([0.985, 0.02, 0.006])) / np.sqrt(np.diag(fit.covariance)))
    rms = np.sqrt((np.array(off) ** 2).mean(axis=0))
    assert (rms < 1.8).all(), rms
    assert (rms > 0.2).all(), rms


def test_a_path_that_does_not_turn_tells_no_scale() -> None:
    truth = Truth()
    rng, motion = np.random.default_rng(0), driven(((5.0, 0.0, 0.5),), truth)
    assert fit_gyro(ground_truth(motion, truth, rng).path, imu_of(motion, truth, rng)) is None


def by_hand(turns: float, scale: float) -> Imu:
    imu = lying(30.0, 5)
    rows = slice(800, 2200)
    imu.angular_velocity_rad_s[rows, 2] += turns * 2.0 * np.pi / 14.0 / scale
    return imu


def test_the_scale_by_turns_of_the_hand_either_way() -> None:
    for turns in (5.0, -5.0):
        imu = by_hand(turns, 1.02)
        found = scale_of_turns(imu, still_part(imu), 5.0)
        assert found.value == pytest.approx(1.02, abs=3.0 * found.sigma)
        assert found.sigma < 0.004
    with pytest.raises(CalibrationError, match=r"saw 4\.90 turns about z, not 3"):
        scale_of_turns(imu, still_part(imu), 3.0)
    with pytest.raises(CalibrationError, match="not turned between two rests"):
        scale_of_turns(lying(10.0), still_part(lying(10.0)), 5.0)


def sphere(n: int, seed: int = 0) -> Floats:
    points = np.random.default_rng(seed).normal(size=(n, 3))
    return np.asarray(48e-6 * points / np.linalg.norm(points, axis=1)[:, None])


def test_hard_and_soft_iron_are_found_among_outliers() -> None:
    iron = np.array([[1.1, 0.05, 0.0], [0.05, 0.95, 0.03], [0.0, 0.03, 1.0]])
    centre = np.array([12e-6, -30e-6, 7e-6])
    read = sphere(2000) @ iron + centre + np.random.default_rng(1).normal(0.0, 0.3e-6, (2000, 3))
    read[::100] += 40e-6
    found = fit_ellipsoid(read)
    assert isinstance(found, Ellipsoid)
    np.testing.assert_allclose(found.hard_iron_t, centre, atol=0.3e-6)
    corrected = (read - found.hard_iron_t) @ found.soft_iron
    size = np.linalg.norm(np.delete(corrected, slice(None, None, 100), axis=0), axis=1)
    assert size.std() / size.mean() < 0.01
    assert np.linalg.det(found.soft_iron) == pytest.approx(1.0)
    assert found.left_out >= 15


def test_a_car_on_the_floor_shows_an_ellipse_and_half_a_turn_nothing() -> None:
    angle = np.linspace(0.0, 4.0 * np.pi, 800)
    flat = np.stack([20e-6 * np.cos(angle) + 5e-6, 15e-6 * np.sin(angle), 0 * angle - 4e-5], axis=1)
    flat += np.random.default_rng(2).normal(0.0, 0.2e-6, flat.shape)
    found = fit_ellipsoid(flat)
    assert isinstance(found, Ellipsoid)
    np.testing.assert_allclose(found.hard_iron_t, [5e-6, 0.0], atol=0.2e-6)
    half = fit_ellipsoid(flat[:200])
    assert isinstance(half, str)
    assert "turn the car twice right round" in half


@pytest.mark.realdata
def test_a_real_chip(data_dir: Path) -> None:
    """The facts of data/README.md: 1.049 g, 0.53/-0.06/-2.02 deg/s, slips in rows 8 and 808."""
    with (data_dir / "imu" / "mpu9250_static_raw.csv").open(newline="") as file:
        counts = np.array([[float(v) for v in row[:6]] for row in list(csv.reader(file))[1:]])
    force, gyro = counts[:, :3] / 16384.0 * G, np.deg2rad(counts[:, 3:] / 131.072)
    t_ns = START_NS + np.rint(np.arange(len(counts)) * 1e9 * 7.7 / len(counts)).astype(np.int64)
    imu = Imu(t_ns, gyro, force)
    slipped = np.flatnonzero(glitch_rows(np.hstack([gyro, force])))
    assert {7, 807} <= set(slipped.tolist())
    assert slipped.size < 6
    result = calibrate_imu(imu)
    told = [float(np.rad2deg(v)) for v in result.still.mean[:3]]
    assert told == pytest.approx((0.53, -0.06, -2.02), abs=0.007)
    gravity = result.calibration.value("gravity_m_s2")
    assert gravity is not None
    assert gravity / G == pytest.approx(1.049, abs=6e-4)
    # It lay askew, so its z axis is not that of a car's turning.
    assert "tilted by 2" in result.calibration.reasons[0]
