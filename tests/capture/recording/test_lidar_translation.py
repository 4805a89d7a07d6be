from __future__ import annotations

import math

import numpy as np
import pytest

from capture.clock import UtcLine
from capture.messages import typestore
from capture.recording.lidar import LidarTranslator, even_scan
from capture.topics import POINTS_TOPIC, RAW_LIDAR_TOPIC, SCAN_TOPIC, SCAN_TYPE
from drivers import Chunk, Reading, Tick
from drivers.rplidar import Revolution
from geometry import Floats, Stamps, wrap

COUNT = 400
TURN_NS = 100_000_000


def turn(start_ns: int = 0, offset_rad: float = 0.0) -> tuple[Stamps, Floats]:
    """Times and bearings of a clockwise turn that begins at the lidar's zero."""
    k = np.arange(COUNT)
    return start_ns + k * TURN_NS // COUNT, wrap(-(k + 0.5) / COUNT * math.tau + offset_rad)


@pytest.mark.parametrize("offset_rad", [0.0, math.radians(-6.0), math.radians(1.0)])
def test_every_ray_has_the_range_and_the_time_of_its_beam(offset_rad: float) -> None:
    t_ns, bearing = turn(10**15, offset_rad)
    range_m = 2.0 + np.sin(bearing)
    scan = even_scan(t_ns, range_m, bearing, np.full(COUNT, 47.0))
    angle = (np.arange(COUNT) + 0.5) * scan.increment_rad
    assert scan.range_m == pytest.approx(2.0 + np.sin(angle), abs=0.02)
    # The time that the scan tells of each ray, against that of the beam nearest to it.
    told_ns = scan.stamp_ns + np.arange(COUNT) * scan.time_increment_s * 1e9
    off = np.abs(wrap(angle[:, None] - bearing[None, :]))
    beam = off.argmin(axis=1)
    # Where the turn ends and the next begins, a ray may be nearest to a beam a whole turn away.
    late_ns = np.abs(told_ns - t_ns[beam])
    assert np.median(late_ns) < TURN_NS / COUNT
    assert np.count_nonzero(late_ns > 2 * TURN_NS / COUNT) <= 8


def test_rays_without_an_echo_are_infinite_and_an_echo_wins_over_none() -> None:
    bearing = np.array([0.1, 0.11, 1.0, -2.0])
    range_m = np.array([np.nan, 1.5, np.nan, 3.0])
    scan = even_scan(np.arange(4) * 1000, range_m, bearing, np.array([0.0, 20.0, 0.0, 30.0]))
    assert sorted(scan.range_m.tolist()) == [1.5, 3.0, math.inf, math.inf]
    assert scan.intensity[scan.range_m == 1.5].tolist() == [20.0]


def test_a_reading_becomes_raw_bytes_points_and_a_scan() -> None:
    utc = UtcLine(0, 10**18)
    t_ns, bearing = turn()
    revolution = Revolution(t_ns, np.full(COUNT, 2.0), bearing, np.full(COUNT, 47, np.uint8))
    chunk = Chunk(7 * 10**9 + TURN_NS, b"bytes")
    ticks = (Tick(0, 7 * 10**9), Tick(TURN_NS, 7 * 10**9 + TURN_NS))
    translator = LidarTranslator(utc)
    raw, points, scan = translator.messages(Reading((chunk,), ticks, (revolution,)))
    assert [m.topic for m in (raw, points, scan)] == [RAW_LIDAR_TOPIC, POINTS_TOPIC, SCAN_TOPIC]
    assert {m.arrival_ns for m in (raw, points, scan)} == {chunk.t_ns}
    assert points.stamp_ns == 10**18 + 7 * 10**9
    message = typestore().deserialize_cdr(scan.data, SCAN_TYPE)
    assert message.time_increment < 0  # type: ignore[attr-defined]  # rosbags makes the type
    assert translator.state()["clock_restarts"] == 0


def test_a_turn_whose_clock_nobody_knows_is_in_the_raw_record_only() -> None:
    t_ns, bearing = turn()
    stray = Revolution(t_ns, np.full(COUNT, 2.0), bearing, np.full(COUNT, 47, np.uint8), epoch=5)
    reading = Reading((Chunk(10**9, b"x"),), (Tick(0, 10**9),), (stray,))
    topics = [m.topic for m in LidarTranslator(UtcLine(0, 0)).messages(reading)]
    assert topics == [RAW_LIDAR_TOPIC]
