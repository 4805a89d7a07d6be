"""Sources of odometry while they are recorded against the same when they are finished."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
import pytest
from recording import (
    COUNTS_PER_M,
    END_S,
    STAND_S,
    START_NS,
    WHEELBASE_M,
    Message,
    S,
    Streams,
    driven,
    messages,
    write,
)

from capture import Arrived, Drive, MissingStreamError, Odometry, Session, VescState, joined
from capture.log_reader import RawMessages
from dialogue import UsageError
from geometry import between
from slam.live_gyro import LiveGyroAided
from slam.live_sources import LiveOdometry, LiveStream, LiveTachometer
from slam.sources import SourceConfig, SourceReport, counted_odometry, odometry_of, steered

CONFIG = SourceConfig(metres_per_count=1.0 / COUNTS_PER_M, wheelbase_m=WHEELBASE_M)


def made(source: LiveOdometry, content: list[Message], seed: int) -> Odometry:
    """What a source gives when the messages come in uneven blocks."""
    random, at, blocks = np.random.default_rng(seed), 0, []
    while at < len(content):
        some = content[at : at + int(random.integers(1, 200))]
        at += len(some)
        blocks.append(source.take(arrived(some), some[-1][0], last=False))
    blocks.append(source.take(Arrived({}), content[-1][0], last=True))
    return reduce(joined, blocks)


def arrived(content: list[Message]) -> Arrived:
    return Arrived(
        {
            topic: RawMessages(
                topic,
                np.array([row[0] for row in content if row[2] == topic]),
                [row[4] for row in content if row[2] == topic],
            )
            for topic in {row[2] for row in content}
        }
    )


def same(one: Odometry, other: Odometry, tolerance: float) -> None:
    np.testing.assert_array_equal(one.t_ns, other.t_ns)
    # The gyro's turn rate at the end of a block is not final, and nothing that steps needs it.
    columns = ("pose_odom_base", "speed_m_s") + ("yaw_rate_rad_s",) * (tolerance == 0.0)
    for name in columns:
        np.testing.assert_allclose(
            getattr(one, name), getattr(other, name), rtol=0.0, atol=tolerance, err_msg=name
        )


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return write(tmp_path_factory.mktemp("sources") / "run", messages(Streams(scan=False)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("words", "live", "tolerance"),
    [
        ("vesc", lambda: LiveStream("vesc", CONFIG), 0.0),
        ("tachometer", lambda: LiveTachometer(CONFIG, steers=True), 0.0),
        ("imu+vesc", lambda: LiveGyroAided(LiveStream("vesc", CONFIG), CONFIG), 1e-9),
        (
            "imu+tachometer",
            lambda: LiveGyroAided(LiveTachometer(CONFIG, steers=False), CONFIG),
            1e-9,
        ),
    ],
)
def test_live_and_finished_are_the_same(
    session: Session, words: str, live: Callable[[], LiveOdometry], tolerance: float, seed: int
) -> None:
    whole, report = odometry_of(session, words, CONFIG)
    source = live()
    found = made(source, messages(Streams(scan=False)), seed)
    same(found, whole, tolerance)
    for name in vars(SourceReport()):
        assert getattr(source.report, name) == pytest.approx(getattr(report, name)), name


@pytest.mark.parametrize("words", ["vesc", "tachometer", "imu+vesc", "imu+tachometer"])
def test_every_source_tells_where_the_car_went_and_that_it_stood(
    session: Session, words: str
) -> None:
    found, _ = odometry_of(session, words, CONFIG)
    t_s = (found.t_ns - START_NS) * 1e-9
    off = found.pose_odom_base - driven(np.asarray(t_s))
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
    assert np.abs(off[:, 2]).max() < 0.03
    standing = between(found.pose_odom_base[:-1], found.pose_odom_base[1:])[
        t_s[1:] < STAND_S - 0.03
    ]
    assert standing.shape[0] > 50
    assert not standing.any()


def is_silent(t_s: float) -> bool:
    return 4.0 < t_s < 6.0 or t_s > 7.5


def test_a_gyro_that_falls_silent_is_a_gap_and_not_waited_for(tmp_path: Path) -> None:
    content = [
        row
        for row in messages(Streams(scan=False))
        if row[2] != "/imu/data_raw"
        or not (4 < (row[1] - START_NS) / S < 6 or row[1] > START_NS + 7.5 * S)
    ]
    whole, report = odometry_of(write(tmp_path / "run", content), "imu+vesc", CONFIG)
    assert report.gyro_gaps >= 2
    source = LiveGyroAided(LiveStream("vesc", CONFIG), CONFIG)
    same(made(source, content, 1), whole, 1e-9)
    assert source.report.gyro_gaps == report.gyro_gaps
    assert source.report.gyro_gap_s == pytest.approx(report.gyro_gap_s)
    # Live, half a second behind the longest allowed gap is the most that is waited.
    until = [row for row in content if row[0] < START_NS + 5 * S]
    given = made_until(LiveGyroAided(LiveStream("vesc", CONFIG), CONFIG), until)
    assert given == pytest.approx(5.0 - 0.2 - 0.5, abs=0.1)


def made_until(source: LiveOdometry, content: list[Message]) -> float:
    """How far a source has come, in seconds, when these messages are there."""
    found = source.take(arrived(content), content[-1][0], last=False)
    return float((found.t_ns[-1] - START_NS) * 1e-9)


def test_while_it_is_open_whether_the_car_stands_the_gyro_waits() -> None:
    content = messages(Streams(scan=False))
    early = [row for row in content if row[0] < START_NS + 0.7 * S]
    later = [row for row in content if row[0] < START_NS + 1.4 * S]
    for rows, expected in ((early, 0.0), (later, 1.38)):
        source = LiveGyroAided(LiveStream("vesc", CONFIG), CONFIG)
        assert made_until(source, rows) == pytest.approx(expected, abs=0.021)


def straight(n: int = 101, step_m: float = 0.02) -> Odometry:
    t_ns = np.arange(n) * 20_000_000
    pose = np.zeros((n, 3))
    pose[:, 0] = np.arange(n) * step_m
    return Odometry("tachometer", t_ns, pose, np.full(n, step_m * 50), np.zeros(n))


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.35])
@pytest.mark.parametrize("backwards", [1.0, -1.0])
def test_a_held_steering_angle_drives_its_circle(angle: float, backwards: float) -> None:
    config = replace(CONFIG, steering_offset_rad=0.05)
    drive = Drive(np.array([-5]), np.array([angle + 0.05]), np.zeros(1))
    found = steered(straight(step_m=0.02 * backwards), drive, config)
    along = 2.0 * backwards
    curvature = math.tan(angle) / WHEELBASE_M
    turned = along * curvature
    expected = (
        [along, 0.0, 0.0]
        if angle == 0.0
        else [math.sin(turned) / curvature, (1 - math.cos(turned)) / curvature, turned]
    )
    np.testing.assert_allclose(found.pose_odom_base[-1], expected, atol=2e-4)
    np.testing.assert_allclose(found.yaw_rate_rad_s, curvature * backwards, atol=1e-12)


def test_a_command_holds_from_its_time_on_and_before_it_the_wheels_are_straight() -> None:
    drive = Drive(np.array([40, 80]) * 20_000_000, np.array([0.3, np.nan]), np.zeros(2))
    heading = steered(straight(), drive, CONFIG).pose_odom_base[:, 2]
    turn = np.diff(heading)
    assert not turn[:40].any()
    np.testing.assert_allclose(turn[40:80], 0.02 * math.tan(0.3) / WHEELBASE_M)
    assert not turn[80:].any()
    none = Drive(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    assert not steered(straight(), none, CONFIG).pose_odom_base[:, 1:].any()


def test_what_the_tachometer_needs_is_asked_for(session: Session) -> None:
    with pytest.raises(UsageError, match=r"metres_per_count.*--set odometry\.metres_per_count"):
        odometry_of(session, "tachometer", SourceConfig())
    with pytest.raises(UsageError, match=r"axle to axle.*--set odometry\.wheelbase_m"):
        odometry_of(session, "tachometer", SourceConfig(metres_per_count=1.0))


def test_a_counter_that_was_reset_between_blocks_is_counted_once() -> None:
    content = messages(Streams(scan=False))
    whole = [row for row in content if row[2] == "/vesc/state"]
    source = LiveTachometer(replace(CONFIG, max_speed_m_s=1e-3), steers=False)
    found = made(source, whole, 2)
    steps = int((END_S - STAND_S) / 0.02)
    assert source.report.tachometer_resets == pytest.approx(steps, abs=2)
    assert not found.pose_odom_base.any()


def test_one_message_of_telemetry_is_a_car_that_stands() -> None:
    one = VescState(np.array([5]), *(np.array([7.0]) for _ in range(5)))
    found, resets = counted_odometry(one, CONFIG)
    assert (found.t_ns.tolist(), found.pose_odom_base.tolist(), resets) == ([5], [[0, 0, 0]], 0)


def test_without_commands_the_tachometer_alone_is_told_to_be_missing_them(tmp_path: Path) -> None:
    content = [row for row in messages(Streams(scan=False)) if row[2] != "/drive"]
    with pytest.raises(MissingStreamError, match="drive commands"):
        odometry_of(write(tmp_path / "run", content), "tachometer", CONFIG)
