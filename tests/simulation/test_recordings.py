"""Recordings of the virtual track: one seed gives one recording, and it holds what was true."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capture import Session
from capture.recording.check import checked
from geometry import wrap
from simulation.drive import Drive
from simulation.overhead_film import FilmClock, FilmScene, hung_view
from simulation.recordings import (
    CarClock,
    exact_truth,
    film_clock,
    film_to_car,
    record_car,
    record_film,
)
from simulation.sensors import ImuNoise
from simulation.world import World, world
from tracking import find_rings


@pytest.fixture(scope="module")
def made() -> World:
    return world("turn", "high", 2)


@pytest.fixture(scope="module")
def car(made: World, tmp_path_factory: pytest.TempPathFactory) -> Session:
    folder = tmp_path_factory.mktemp("car")
    record_car(made, folder, trial=1)
    return Session.open(folder)


def test_the_recording_is_good_and_its_check_says_so_too(car: Session) -> None:
    assert car.info.verdict == "good"
    facts, verdict = checked(car)
    assert verdict.verdict == "good"
    assert {stream.device for stream in facts.streams} == {"lidar", "vesc", "mpu9250", "zed"}
    assert car.info.configuration["rig"] is not None
    assert car.motor_calibration() is not None


def test_one_seed_gives_the_same_log_to_the_byte(car: Session, tmp_path: Path) -> None:
    record_car(world("turn", "high", 2), tmp_path, trial=1)
    assert (tmp_path / "car.mcap").read_bytes() == (car.folder / "car.mcap").read_bytes()


def test_stamps_of_the_gyro_are_true(made: World, car: Session) -> None:
    imu = car.imu()
    truth = exact_truth(made)
    bias = imu.angular_velocity_rad_s[imu.t_ns < CarClock().zero_utc_ns + 2 * 10**9, 2].mean()
    rate = (imu.angular_velocity_rad_s[:, 2] - bias) / made.built.gyro_gain
    told = np.concatenate([[0.0], np.cumsum(rate[1:] * np.diff(imu.t_ns) * 1e-9)])
    inside = (imu.t_ns > truth.path.t_ns[0]) & (imu.t_ns < truth.path.t_ns[-1])
    true = np.unwrap(truth.path.interpolated(imu.t_ns[inside]).heading)
    apart = (told[inside] - told[inside][0]) - (true - true[0])
    assert np.abs(apart).max() < np.radians(0.6)
    assert ImuNoise().rate_hz == pytest.approx(imu.t_ns.size / (np.ptp(imu.t_ns) * 1e-9), rel=0.01)


def test_lidar_echoes_lie_on_cones_walls_and_boxes(made: World, car: Session) -> None:
    scans, truth = car.scans(), exact_truth(made)
    seen = np.isfinite(scans.range_m) & (scans.beam_t_ns > truth.path.t_ns[0])
    seen &= scans.beam_t_ns < truth.path.t_ns[-1]
    pose = made.drive.poses(scans.beam_t_ns[seen] - CarClock().zero_utc_ns)
    place = made.built.lidar
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x = pose[:, 0] + cos * place.x_m - sin * place.y_m
    y = pose[:, 1] + sin * place.x_m + cos * place.y_m
    exact, _ = made.around.distances(x, y, pose[:, 2] + place.yaw_rad + scans.bearing_rad[seen])
    off = scans.range_m[seen] - exact
    sigma = 0.006 + 0.004 * exact
    near = np.abs(off) < 5.0 * sigma + 0.004
    # The rest are strays, and beams that pass an edge within the resolution of the encoder.
    assert near.mean() > 0.97
    assert abs(np.median(off)) < 1e-3


def test_the_car_that_is_driven_through_the_controller_has_its_commands_on_record(
    tmp_path: Path,
) -> None:
    made = world("turn", "low", 1)
    record_car(made, tmp_path, commanded=True)
    session = Session.open(tmp_path)
    told = session.drive()
    assert session.odometry_sources == ("vesc",)
    believed, true = made.drawn.vesc, made.built.vesc
    sent = made.drive.commands[:, 2]
    expected = believed.steering_angle_rad(
        true.steering_angle_to_servo_gain * float(np.abs(sent).max())
        + true.steering_angle_to_servo_offset
    )
    largest = np.nanmax(np.abs(told.steering_rad - believed.steering_angle_rad(
        true.steering_angle_to_servo_offset)))  # fmt: skip
    straight = believed.steering_angle_rad(true.steering_angle_to_servo_offset)
    assert largest == pytest.approx(abs(expected - straight), rel=0.02)


def test_a_film_clock_goes_there_and_back() -> None:
    clock = FilmClock(5_000_000_000_000, 18e-6)
    assert clock.world_ns(clock.own_ns(12_345_678_901)) == pytest.approx(12_345_678_901, abs=1)
    assert clock.own_ns(10**12) - clock.own_ns(0) == 10**12 + 18_000_000


def test_the_film_shows_the_rings_where_they_are(made: World) -> None:
    view = hung_view()
    picture = FilmScene(made, view).image(0)
    found = find_rings(picture)
    assert len(found.centres_px) == 4 + len(made.cones) + 2


def test_film_and_car_clocks_are_apart_as_the_truth_says(made: World) -> None:
    offset_s, skew = film_to_car(made)
    clock, utc = film_clock(made)
    for world_ns in (0, 10**10):
        t_film = utc.utc(clock.own_ns(world_ns))
        since_s = (t_film - utc.utc(clock.zero_ns)) * 1e-9
        t_car = t_film + round((offset_s + skew * since_s) * 1e9)
        assert t_car == pytest.approx(CarClock().zero_utc_ns + world_ns, abs=50)
    assert 0.0 < abs(offset_s) < 2.0


def test_a_short_film_is_recorded_on_its_own_clock(tmp_path: Path) -> None:
    whole = world("turn", "low", 1)
    made = replace(whole, drive=Drive(whole.drive.rows[:1200], whole.drive.commands))
    assert record_film(made, hung_view(480), tmp_path).verdict == "good"
    session = Session.open(tmp_path)
    clock, utc = film_clock(made)
    first = next(iter(session.overhead_images()))
    exposed_ns = utc.utc(clock.own_ns(-1_300_000_000)) + 2_000_000
    # The driver throws the first frames away while the camera settles.
    frames = (first.t_ns - exposed_ns) * 1e-9 * 30.0
    assert 0 <= frames < 20
    assert frames == pytest.approx(round(frames), abs=0.01)
    assert session.overhead_count == pytest.approx(30 * 2.5 - frames, abs=2)


def test_the_exact_truth_is_wrapped_and_on_the_clock_of_the_log(made: World) -> None:
    truth = exact_truth(made)
    assert truth.path.t_ns[0] == CarClock().zero_utc_ns
    assert np.array_equal(truth.path.heading, wrap(truth.path.heading))
    assert truth.landmarks is not None
    assert len(truth.landmarks) == 14
