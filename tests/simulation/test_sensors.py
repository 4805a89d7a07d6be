"""What the emulated devices are moved by, against the truth of the drive."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.vesc import VescCalibration
from simulation.build import AS_BUILT
from simulation.drive import Drive
from simulation.sensors import ImuNoise, ImuWorld, LidarNoise, LidarWorld, VescWorld
from simulation.surfaces import ConeShape, Room, Surroundings
from simulation.world import World, world

ZERO_NS = 7_000_000_000
QUIET = LidarNoise(sigma_m=0.0, sigma_per_m=0.0, lost=0.0, grazing_cos=0.0, stray=0.0)
STILL = ImuNoise(
    gyro_density=0.0, accel_density=0.0, bias_rad_s=0.0, vibration_m_s2=0.0,
    vibration_rad_s=0.0, tilt_sigma_rad=0.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def turned() -> World:
    return world("turn", "low", 1)


def standing() -> Drive:
    rows = np.zeros((1000, 11))
    rows[:, :3] = 1.0, 2.0, math.pi / 2
    return Drive(rows, np.zeros((0, 3)))


def test_rays_meet_circles_and_walls_where_geometry_says() -> None:
    around = Surroundings(
        np.array([[3.0, 0.0]]), np.array([0.5]), np.array([[-2.0, -5.0, -2.0, 5.0]])
    )
    zero = np.zeros(4)
    angles = np.array([0.0, math.asin(0.4 / 3.0), math.pi, math.pi / 2])
    far, cosine = around.distances(zero, zero, angles)
    aside = 3.0 * math.cos(angles[1]) - 0.3
    assert far == pytest.approx([2.5, aside, 2.0, np.inf])
    assert cosine[:3] == pytest.approx([1.0, 0.6, 1.0])


def test_a_nearer_thing_hides_what_is_behind_it() -> None:
    around = Surroundings(
        np.array([[1.0, 0.0], [3.0, 0.0]]), np.array([0.1, 0.1]), np.array([[2.0, -1.0, 2.0, 1.0]])
    )
    far, _ = around.distances(np.zeros(1), np.zeros(1), np.zeros(1))
    assert far == pytest.approx([0.9])


def test_a_beam_is_shot_from_where_the_lidar_is_at_its_own_time() -> None:
    walls = np.array([[-50.0, 10.0, 50.0, 10.0]])
    around = Surroundings(np.zeros((1, 2)) - 99.0, np.array([0.1]), walls)
    rows = np.zeros((2001, 11))
    rows[:, 1] = np.arange(2001) * 1e-3  # one metre a second along y
    rows[:, 2] = math.pi / 2
    mounting = np.array([0.2, 0.0, 0.1])
    lidar = LidarWorld(
        Drive(rows, np.zeros((0, 3))), around, mounting, ZERO_NS, np.random.default_rng(0), QUIET
    )
    t_ns = ZERO_NS + np.array([0, 500_000_000, 2_000_000_000])
    told = lidar(t_ns, np.full(3, -0.1))
    assert told == pytest.approx([9.8, 9.3, 7.8])


def test_lidar_noise_is_as_stated() -> None:
    walls = np.array([[-50.0, 4.0, 50.0, 4.0]])
    around = Surroundings(np.zeros((1, 2)) - 99.0, np.array([0.1]), walls)
    noise = LidarNoise(sigma_m=0.006, sigma_per_m=0.004, lost=0.1, stray=0.0)
    lidar = LidarWorld(standing(), around, np.zeros(3), ZERO_NS, np.random.default_rng(1), noise)
    told = lidar(np.full(20_000, ZERO_NS), np.zeros(20_000))
    assert np.isnan(told).mean() == pytest.approx(0.1, abs=0.01)
    assert np.nanstd(told) == pytest.approx(0.006 + 0.004 * 2.0, rel=0.03)
    assert np.nanmean(told) == pytest.approx(2.0, abs=0.001)


def test_grazing_beams_are_lost() -> None:
    around = Surroundings(
        np.zeros((1, 2)) - 99.0, np.array([0.1]), np.array([[0.0, -0.5, 60.0, -0.5]])
    )
    lidar = LidarWorld(
        Drive(np.zeros((2, 11)), np.zeros((0, 3))), around, np.zeros(3), ZERO_NS,
        np.random.default_rng(1), LidarNoise(lost=0.0, stray=0.0),
    )  # fmt: skip
    told = lidar(np.full(2, ZERO_NS), np.array([-0.05, -1.0]))
    assert np.isnan(told[0])
    assert np.isfinite(told[1])


def test_the_gyro_integrates_to_the_heading_and_feels_what_the_car_feels(turned: World) -> None:
    imu = ImuWorld(turned.drive, ZERO_NS, np.random.default_rng(0), STILL, gain=1.0)
    t_ns = ZERO_NS + np.arange(0, turned.drive.end_ns, 5_000_000)
    felt = [imu(int(t)) for t in t_ns]
    turn = sum(one.angular_velocity_rad_s[2] for one in felt) * 5e-3
    assert turn == pytest.approx(turned.drive.rows[-1, 2] - turned.drive.rows[0, 2], abs=2e-3)
    standing_up = felt[100].linear_acceleration_m_s2
    assert standing_up == pytest.approx((0.0, 0.0, 9.80665))
    ahead = sum(one.linear_acceleration_m_s2[0] for one in felt[: 4 * 200 - 100]) * 5e-3
    assert ahead == pytest.approx(turned.drive.at(3_500_000_000).ahead_m_s, abs=0.05)


def test_gyro_noise_has_the_density_that_it_states() -> None:
    noise = ImuNoise(bias_rad_s=0.0, tilt_sigma_rad=0.0)
    imu = ImuWorld(standing(), ZERO_NS, np.random.default_rng(0), noise)
    told = np.array([imu(ZERO_NS).angular_velocity_rad_s for _ in range(4000)])
    expected = noise.gyro_density * math.sqrt(noise.rate_hz / 2.0)
    assert told.std(axis=0) == pytest.approx(np.full(3, expected), rel=0.05)


def test_the_tachometer_counts_what_the_wheels_rolled(turned: World) -> None:
    tied = VescCalibration(
        speed_to_erpm_gain=4000.0, steering_angle_to_servo_gain=-1.0,
        steering_angle_to_servo_offset=0.5, wheelbase_m=0.26, direction=-1,
    )  # fmt: skip
    motor = VescWorld(turned.drive, tied, ZERO_NS)
    end = motor(ZERO_NS + turned.drive.end_ns)
    assert end.tachometer is not None
    assert end.tachometer * tied.metres_per_count == pytest.approx(
        turned.drive.rows[-1, 9], abs=0.003
    )
    assert end.tachometer < 0
    middle = motor(ZERO_NS + 6_000_000_000)
    assert tied.speed_m_s(middle.erpm) == pytest.approx(
        turned.drive.at(6 * 10**9).wheel_m_s, abs=1e-3
    )


def test_the_room_keeps_the_square_free() -> None:
    for seed in range(5):
        around = Room().around(np.zeros((0, 2)), 0.16, np.random.default_rng(seed))
        boxes = around.walls[4:].reshape(-1, 2)
        inside = ((boxes > 0.0) & (boxes < 4.0)).all(axis=1)
        assert not inside.any()
        assert not ((around.centres > 0.0) & (around.centres < 4.0)).all(axis=1).any()


def test_a_cone_is_as_wide_as_the_cone_finder_expects_in_the_plane_of_the_lidar() -> None:
    assert ConeShape().radius_m(AS_BUILT.lidar.height_m) == pytest.approx(0.05)
