from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from capture import Imu, MissingStreamError, Odometry, Session, SessionInfo, VescState
from dialogue import UsageError
from geometry import Floats, Stamps, Trajectory, between, planar_umeyama, transform_points, wrap
from slam.errors import SlamError
from slam.sources import SourceConfig, counted_odometry, gyro_aided, odometry_of

S = 1_000_000_000
START_NS = 1_700_000_000 * S
STAND_S, DRIVE_S = 3.0, 12.0


def speed_of(t_s: Floats) -> Floats:
    """Stands, then drives at 0.8 m/s."""
    return np.where(t_s < STAND_S, 0.0, 0.8)


def rate_of(t_s: Floats) -> Floats:
    return np.where(t_s < STAND_S, 0.0, 0.9 * np.sin(1.3 * (t_s - STAND_S)))


def truth(t_s: Floats) -> Floats:
    """Poses (n, 3) by fine integration of the two functions."""
    fine = np.linspace(0.0, STAND_S + DRIVE_S, 150_001)
    middle = 0.5 * (fine[1:] + fine[:-1])
    turn, step = rate_of(middle) * np.diff(fine), speed_of(middle) * np.diff(fine)
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    along = heading[:-1] + 0.5 * turn
    x = np.concatenate([[0.0], np.cumsum(step * np.cos(along))])
    y = np.concatenate([[0.0], np.cumsum(step * np.sin(along))])
    return np.stack([np.interp(t_s, fine, column) for column in (x, y, heading)], axis=1)


def stamps(t_s: Floats) -> Stamps:
    return START_NS + np.rint(t_s * 1e9).astype(np.int64)


def driven(over_turning: float = 1.0, rate_hz: float = 50.0) -> Odometry:
    """What wheels tell that turn `over_turning` times as much as the car."""
    t_s = np.arange(0.0, STAND_S + DRIVE_S, 1.0 / rate_hz)
    fine = np.linspace(0.0, STAND_S + DRIVE_S, 150_001)
    turn = over_turning * rate_of(0.5 * (fine[1:] + fine[:-1])) * np.diff(fine)
    step = speed_of(0.5 * (fine[1:] + fine[:-1])) * np.diff(fine)
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    x = np.concatenate([[0.0], np.cumsum(step * np.cos(heading[:-1] + 0.5 * turn))])
    y = np.concatenate([[0.0], np.cumsum(step * np.sin(heading[:-1] + 0.5 * turn))])
    pose = np.stack([np.interp(t_s, fine, c) for c in (x, y, heading)], axis=1)
    pose[:, 2] = wrap(pose[:, 2])
    return Odometry("vesc", stamps(t_s), pose, speed_of(t_s), over_turning * rate_of(t_s))


def gyro(bias: float = 0.0, phase_s: float = 0.0013, rate_hz: float = 200.0) -> Imu:
    t_s = np.arange(phase_s, STAND_S + DRIVE_S, 1.0 / rate_hz)
    rates = np.stack([0.1 * t_s, -0.2 * t_s, rate_of(t_s) + bias], axis=1)
    return Imu(stamps(t_s), rates, np.zeros((t_s.size, 3)))


def some(odometry: Odometry, kept: npt.NDArray[np.bool_]) -> Odometry:
    return Odometry(
        odometry.source,
        odometry.t_ns[kept],
        odometry.pose_odom_base[kept],
        odometry.speed_m_s[kept],
        odometry.yaw_rate_rad_s[kept],
    )


def error_of(odometry: Odometry) -> tuple[float, float]:
    """Largest error in metres and radians."""
    expected = truth(np.asarray((odometry.t_ns - START_NS) * 1e-9, dtype=np.float64))
    off = odometry.pose_odom_base - expected
    return float(np.hypot(off[:, 0], off[:, 1]).max()), float(np.abs(wrap(off[:, 2])).max())


def test_over_turning_wheels_are_mended_by_the_gyro() -> None:
    """A real F1/10 car over-turned 1.5 to 3.2 times (FrictionMaps DS1 and DS5)."""
    wheels = driven(over_turning=2.5)
    before_m, before_rad = error_of(wheels)
    after_m, after_rad = error_of(gyro_aided(wheels, gyro(), SourceConfig())[0])
    assert before_m > 1.0
    assert before_rad > 1.0
    assert after_m < 0.01
    assert after_rad < 0.005


def test_where_wheels_and_gyro_agree_nothing_changes() -> None:
    wheels = driven()
    aided, _ = gyro_aided(wheels, gyro(), SourceConfig())
    rows = np.searchsorted(aided.t_ns, wheels.t_ns)
    np.testing.assert_allclose(
        aided.pose_odom_base[rows, :2], wheels.pose_odom_base[:, :2], atol=4e-3
    )


@pytest.mark.parametrize("bias", [-0.035, 0.0, 0.02])
def test_the_bias_is_measured_while_the_car_stands(bias: float) -> None:
    aided, report = gyro_aided(driven(), gyro(bias), SourceConfig())
    assert report.gyro_bias_rad_s == pytest.approx(bias, abs=1e-12)
    assert report.still_s == pytest.approx(STAND_S, abs=0.05)
    assert error_of(aided)[1] < 0.005
    assert f"{math.degrees(bias):.3f} deg/s" in str(report)


def test_a_push_while_standing_is_no_bias() -> None:
    imu = gyro(0.02)
    imu.angular_velocity_rad_s[100:130, 2] = 1.5
    _, report = gyro_aided(driven(), imu, SourceConfig())
    assert report.gyro_bias_rad_s == pytest.approx(0.02, abs=1e-12)


def test_a_car_that_never_stands_has_no_measured_bias_but_may_be_given_one() -> None:
    wheels = driven()
    kept = wheels.t_ns >= START_NS + round(4.0 * S)
    moving = some(wheels, kept)
    _, report = gyro_aided(moving, gyro(0.02), SourceConfig())
    assert (report.gyro_bias_rad_s, report.still_s) == (0.0, 0.0)
    assert "never stood" in str(report)
    told, report = gyro_aided(moving, gyro(0.02), SourceConfig(gyro_bias_rad_s=0.02))
    assert report.gyro_bias_rad_s == 0.02
    turned = told.pose_odom_base[-1, 2] - told.pose_odom_base[0, 2]
    at = truth(np.array([4.0, (told.t_ns[-1] - START_NS) * 1e-9]))
    assert float(wrap(turned - (at[1, 2] - at[0, 2]))) == pytest.approx(0.0, abs=0.005)


def test_standing_still_adds_no_motion_at_all() -> None:
    imu = gyro(0.02)
    imu.angular_velocity_rad_s[:, 2] += np.random.default_rng(1).normal(0.0, 0.05, imu.t_ns.size)
    aided, _ = gyro_aided(driven(), imu, SourceConfig())
    standing = aided.t_ns < START_NS + round((STAND_S - 0.05) * S)
    assert np.count_nonzero(standing) > 500
    assert not between(aided.pose_odom_base[:-1], aided.pose_odom_base[1:])[standing[1:]].any()
    assert not aided.yaw_rate_rad_s[standing].any()


def test_turning_on_the_spot_is_not_standing() -> None:
    t_s = np.arange(0.0, 4.0, 0.02)
    pose = np.stack([np.zeros(t_s.size), np.zeros(t_s.size), 0.5 * t_s], axis=1)
    spinning = Odometry("wheel", stamps(t_s), pose, np.zeros(t_s.size), np.full(t_s.size, 0.5))
    rates = np.zeros((t_s.size, 3))
    rates[:, 2] = 0.4
    aided, report = gyro_aided(spinning, Imu(stamps(t_s), rates, rates), SourceConfig())
    assert report.still_s == 0.0
    assert aided.pose_odom_base[-1, 2] == pytest.approx(0.4 * t_s[-1], abs=1e-9)


def test_in_gaps_of_the_gyro_the_source_turns_and_they_are_counted() -> None:
    imu, t_s = gyro(), (gyro().t_ns - START_NS) * 1e-9
    kept = (t_s < 5.0) | ((t_s > 6.0) & (t_s < 9.0)) | (t_s > 9.1)
    imu.angular_velocity_rad_s[(t_s > 11.0) & (t_s < 11.5), 2] = np.nan
    holed = Imu(imu.t_ns[kept], imu.angular_velocity_rad_s[kept], np.zeros((kept.sum(), 3)))
    aided, report = gyro_aided(driven(), holed, SourceConfig())
    # From the first odometry sample to the first of the gyro it is blind, too.
    assert report.gyro_gaps == 3
    assert report.gyro_gap_s == pytest.approx(1.5, abs=0.02)
    assert error_of(aided)[0] < 0.01
    over = gyro_aided(driven(over_turning=2.0), holed, SourceConfig())[0]
    assert error_of(over)[1] > 0.05


def test_gaps_of_the_source_are_counted() -> None:
    wheels = driven()
    kept = np.abs(wheels.t_ns - START_NS - 8 * S) > S // 2
    holed = some(wheels, kept)
    aided, report = gyro_aided(holed, gyro(), SourceConfig())
    assert report.source_gaps == 1
    assert error_of(aided)[1] < 0.005


def test_a_clock_that_runs_late_is_set_right() -> None:
    late = gyro()
    late = dataclasses.replace(late, t_ns=late.t_ns + round(0.3 * S))
    wrong = error_of(gyro_aided(driven(), late, SourceConfig())[0])
    right = error_of(gyro_aided(driven(), late, SourceConfig(imu_offset_s=-0.3))[0])
    assert wrong[1] > 0.1
    assert right[1] < 0.005


def test_backing_up_stays_backing_up() -> None:
    t_s = np.arange(0.0, 4.0, 0.02)
    zeros = np.zeros(t_s.size)
    back = Odometry(
        "vesc", stamps(t_s), np.stack([-0.5 * t_s, zeros, zeros], axis=1), zeros - 0.5, zeros
    )
    rates = np.zeros((t_s.size, 3))
    rates[:, 2] = 0.3
    aided, _ = gyro_aided(back, Imu(stamps(t_s), rates, rates), SourceConfig())
    radius, turned = 0.5 / 0.3, 0.3 * t_s[-1]
    expected = [-radius * math.sin(turned), -radius * (1.0 - math.cos(turned)), turned]
    np.testing.assert_allclose(aided.pose_odom_base[-1], expected, atol=1e-4)


def test_a_gyro_of_another_time_is_refused_with_both_ranges() -> None:
    other = gyro()
    other = dataclasses.replace(other, t_ns=other.t_ns + 100 * S)
    with pytest.raises(SlamError, match=r"covers .* s and odometry 'vesc' .* use --odometry vesc"):
        gyro_aided(driven(), other, SourceConfig())
    none = Imu(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(SlamError, match="covers nothing"):
        gyro_aided(driven(), none, SourceConfig())


def telemetry(counts_per_m: float = 460.0) -> VescState:
    t_s = np.arange(0.0, STAND_S + DRIVE_S, 0.02)
    counts = np.rint(counts_per_m * 0.8 * np.maximum(t_s - STAND_S, 0.0))
    zeros = np.zeros(t_s.size)
    return VescState(stamps(t_s), zeros, counts, zeros, zeros, zeros)


COUNTED = SourceConfig(metres_per_count=1.0 / 460.0)


def test_the_tachometer_tells_the_distance_and_the_gyro_the_turning() -> None:
    counted, resets = counted_odometry(telemetry(), COUNTED)
    assert resets == 0
    aided, report = gyro_aided(counted, gyro(0.02), COUNTED)
    assert report.gyro_bias_rad_s == pytest.approx(0.02, abs=1e-12)
    assert error_of(aided)[0] < 0.02


def test_a_reset_of_the_tachometer_is_left_out_and_counted() -> None:
    state = telemetry()
    state.tachometer[400:] -= state.tachometer[400]
    counted, resets = counted_odometry(state, COUNTED)
    assert resets == 1
    assert counted.pose_odom_base[-1, 0] == pytest.approx(0.8 * DRIVE_S, abs=0.05)


def test_a_tachometer_without_calibration_is_refused() -> None:
    with pytest.raises(UsageError, match="metres_per_count"):
        counted_odometry(telemetry(), SourceConfig())


@pytest.fixture
def session(tmp_path: Path) -> Session:
    info = SessionInfo(map="x", start_utc="2026-01-01T00:00:00+00:00")
    with Session.create(tmp_path / "run", info) as writer:
        writer.add_odometry(driven(over_turning=2.0))
    return Session.open(tmp_path / "run")


def test_a_stream_is_taken_as_it_is(session: Session) -> None:
    odometry, report = odometry_of(session, "vesc")
    assert odometry.source == "vesc"
    assert odometry.t_ns.size == driven().t_ns.size
    assert report.gyro_bias_rad_s is None
    assert "odometry: 0" in str(report)
    assert odometry_of(session, None)[0].source == "vesc"


def test_a_missing_stream_is_told_with_what_is_there(session: Session) -> None:
    with pytest.raises(MissingStreamError, match="vesc/odom"):
        odometry_of(session, "zed")
    with pytest.raises(MissingStreamError, match=r"IMU.*vesc/odom"):
        odometry_of(session, "imu+vesc")
    with pytest.raises(MissingStreamError, match=r"telemetry.*vesc/odom"):
        odometry_of(session, "imu+tachometer")


@pytest.mark.parametrize("words", ["", "imu+", "gps+vesc", "imu+imu+vesc"])
def test_words_that_name_no_source_are_told_what_would(session: Session, words: str) -> None:
    with pytest.raises(UsageError, match=r"this session has: vesc.*imu\+tachometer"):
        odometry_of(session, words)


def columns(file: Path) -> dict[str, Floats]:
    with file.open() as lines:
        names = lines.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(lines, delimiter=",").T, strict=True))


def in_time(table: dict[str, Floats]) -> tuple[Stamps, dict[str, Floats]]:
    """Stamps that increase, and the columns there."""
    t_ns = table["s"].astype(np.int64) * S + table["ns"].astype(np.int64)
    kept = np.append(True, t_ns[1:] > np.maximum.accumulate(t_ns)[:-1])
    return t_ns[kept], {name: column[kept] for name, column in table.items()}


def planar(table: dict[str, Floats]) -> Floats:
    heading = wrap(2.0 * np.arctan2(table["q.z"], table["q.w"]))
    return np.stack([table["x"], table["y"], heading], axis=1)


@pytest.mark.realdata
@pytest.mark.parametrize(("name", "before_m", "after_m"), [("DS1", 5.0, 0.6), ("DS5", 20.0, 9.0)])
def test_a_real_car_that_over_turns_is_mended(
    data_dir: Path, name: str, before_m: float, after_m: float
) -> None:
    """FrictionMaps: against the pose of its particle filter; the IMU there is in deg/s."""
    folder = data_dir / "frictionmaps" / name
    odom_ns, odom = in_time(columns(folder / "odomData.csv"))
    imu_ns, imu = in_time(columns(folder / "imuData.csv"))
    filter_ns, filtered = in_time(columns(folder / "pfPoseData.csv"))
    wheels = Odometry("vesc", odom_ns, planar(odom), odom["vx"], np.zeros(odom_ns.size))
    rates = np.radians(np.stack([imu["wx"], imu["wy"], imu["wz"]], axis=1))
    aided, report = gyro_aided(wheels, Imu(imu_ns, rates, np.zeros_like(rates)), SourceConfig())
    assert report.gyro_bias_rad_s is not None
    assert abs(report.gyro_bias_rad_s) < np.radians(1.0)
    inside = (filter_ns >= odom_ns[0]) & (filter_ns <= odom_ns[-1])
    expected = Trajectory.from_poses(filter_ns, planar(filtered)).selected(inside)
    turned = np.unwrap(expected.heading)[-1] - expected.heading[0]
    errors, excess = [], []
    for odometry in (wheels, aided):
        path = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
        path = path.interpolated(expected.t_ns)
        placed = transform_points(
            planar_umeyama(path.positions, expected.positions), path.positions
        )
        errors.append(np.hypot(*(placed - expected.positions).T).mean())
        excess.append(abs(np.unwrap(path.heading)[-1] - path.heading[0] - turned))
    assert errors[0] > before_m
    assert errors[1] < after_m
    assert excess[1] < 0.15 * excess[0]
