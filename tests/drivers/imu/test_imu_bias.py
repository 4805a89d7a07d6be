from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from drivers.imu import still_bias
from drivers.imu.bias import outlier_rows
from drivers.imu.mpu9250.protocol import Settings, samples_from_frames

# +-250 deg/s, +-2 g, as the recording was made; it ran at 245 Hz.
RECORDED = Settings(0x71, 3, 0x03, 0x00, 0x00, 0x03)
SECONDS = 7.7


@pytest.fixture(scope="module")
def recording(data_dir: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gyro (n, 3), acceleration (n, 3), temperature (n,) through the driver's own frames."""
    path = data_dir / "imu" / "mpu9250_static_raw.csv"
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    # accelerometer, temperature, gyro: the order of the registers
    counts = [[int(row[k]) for k in (0, 1, 2, 6, 3, 4, 5)] for row in rows]
    frames = np.array(counts).astype(">i2").tobytes()
    samples = samples_from_frames(frames, 0, RECORDED)
    return (
        np.array([s.angular_velocity_rad_s for s in samples]),
        np.array([s.linear_acceleration_m_s2 for s in samples]),
        np.array([s.temperature_c for s in samples]),
    )


@pytest.mark.realdata
def test_a_real_chip_at_rest(recording: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """The facts of data/README.md: |a| 1.049 g, bias 0.53/-0.06/-2.02 deg/s."""
    gyro, accel, temperature = recording
    bias = still_bias(gyro, accel, SECONDS, float(temperature.mean()))
    assert np.rad2deg(bias.bias_rad_s) == pytest.approx((0.53, -0.06, -2.02), abs=0.006)
    assert bias.gravity_m_s2 / 9.80665 == pytest.approx(1.049, abs=0.0006)
    assert 10.0 < bias.temperature_c < 20.0
    # The board was not quite at rest: y trembles by more than the 0.3 deg/s of a good bias.
    assert bias.faults == ("gyro y varies by 0.46 deg/s: the car moved",)


@pytest.mark.realdata
def test_the_two_slipped_rows_of_the_recording_are_left_out(
    recording: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Rows 8 and 808 of the file, its header being row 1."""
    gyro, accel, _ = recording
    out = outlier_rows(np.hstack((gyro, accel)))
    # Two more rows of the last moment, where somebody touched the board, are left out as well.
    assert (np.flatnonzero(out) + 1).tolist() == [8, 808, 1880, 1882]
    # With the slipped rows even the quiet z would seem to move.
    assert np.rad2deg(gyro[:, 2].std()) > 0.3 > np.rad2deg(gyro[~out, 2].std())


def still(n: int, std_deg_s: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    gyro = np.deg2rad([1.0, -2.0, 3.0]) + np.deg2rad(rng.normal(0.0, std_deg_s, (n, 3)))
    accel = np.array([0.0, 0.0, 9.80665]) + rng.normal(0.0, 0.02, (n, 3))
    return gyro, accel


def test_the_bias_is_the_mean() -> None:
    gyro, accel = still(1000, 0.1)
    bias = still_bias(gyro, accel, 5.0)
    assert bias.accepted
    assert np.rad2deg(bias.bias_rad_s) == pytest.approx((1.0, -2.0, 3.0), abs=0.02)
    assert np.rad2deg(bias.std_rad_s) == pytest.approx((0.1, 0.1, 0.1), rel=0.1)
    assert (bias.rows, bias.outliers) == (1000, 0)


@pytest.mark.parametrize(("std_deg_s", "accepted"), [(0.27, True), (0.33, False)])
def test_a_car_that_moves_gives_no_bias(std_deg_s: float, accepted: bool) -> None:
    bias = still_bias(*still(2000, std_deg_s), 5.0)
    assert bias.accepted is accepted
    assert accepted or "the car moved" in bias.faults[0]


def test_a_short_while_gives_no_bias() -> None:
    assert "too short" in still_bias(*still(100, 0.1), 1.9).faults[0]


def test_one_g_must_be_one_g() -> None:
    gyro, accel = still(1000, 0.1)
    (fault,) = still_bias(gyro, 2.0 * accel, 5.0).faults
    assert fault.startswith("the acceleration is 19.6")


def test_many_slipped_rows_are_a_fault_of_their_own() -> None:
    gyro, accel = still(1000, 0.1)
    gyro[::50] += 3.0
    bias = still_bias(gyro, accel, 5.0)
    assert bias.outliers == 20
    assert bias.faults == ("2.0 % of the rows do not belong: bad wires",)


def test_no_rows_are_no_bias() -> None:
    bias = still_bias(np.empty((0, 3)), np.empty((0, 3)), 5.0)
    assert not bias.accepted
