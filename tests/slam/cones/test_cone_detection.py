from __future__ import annotations

import math
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lidar_world import PERIOD_NS, LidarWorld, room

from capture import Observations, Odometry, Scans, Session
from capture.import_bag import import_bag
from geometry import Floats, wrap
from slam.cones.config import CONE_PRESETS, cone_config
from slam.cones.detection import ConeDetections, detect_cones, observations_from_scans

ROBUST, THESIS = CONE_PRESETS["robust"], CONE_PRESETS["thesis"]
NO_FLOOR = ["floor.range_sigma_m=1e-6", "floor.bearing_sigma_rad=1e-6"]
RADIUS_M = 0.05


def points(observations: Observations) -> Floats:
    cos, sin = np.cos(observations.bearing_rad), np.sin(observations.bearing_rad)
    return np.stack([observations.range_m * cos, observations.range_m * sin], axis=1)


def errors(found: ConeDetections, world: LidarWorld) -> Floats:
    """(m, 2): range and bearing of each detection minus those of the true cone nearest to it."""
    observed, rows = found.observations, []
    for t_ns, point in zip(observed.t_ns.tolist(), points(observed), strict=True):
        truth = world.seen_from_car(t_ns)
        x, y = truth[np.argmin(np.hypot(*(truth - point).T))]
        rows.append((math.hypot(x, y), math.atan2(y, x)))
    expected = np.array(rows).reshape(-1, 2)
    return np.stack(
        [observed.range_m - expected[:, 0], wrap(observed.bearing_rad - expected[:, 1])], axis=1
    )


def scans_of(*revolutions: tuple[Floats, Floats]) -> Scans:
    """Revolutions of (range, bearing), one every 0.1 s, beams spread over it."""
    starts = np.cumsum([0, *(ranges.size for ranges, _ in revolutions)], dtype=np.int64)
    t_ns = np.arange(len(revolutions)) * 100_000_000
    times = [
        start + np.arange(ranges.size) * (100_000_000 // max(ranges.size, 1))
        for start, (ranges, _) in zip(t_ns.tolist(), revolutions, strict=True)
    ]
    return Scans(
        t_ns,
        starts,
        np.concatenate([np.zeros(0, np.int64), *times]),
        np.concatenate([np.zeros(0), *(ranges for ranges, _ in revolutions)]),
        np.concatenate([np.zeros(0), *(bearings for _, bearings in revolutions)]),
        np.full(starts[-1], np.nan),
    )


@pytest.mark.parametrize("distance_m", [0.6, 0.9, 1.2, 1.5, 1.8])
def test_centres_lie_on_the_axis_and_scatter_as_they_say(distance_m: float) -> None:
    cone = distance_m * np.array([[math.cos(0.4), math.sin(0.4)]])
    world = LidarWorld(cone, room(4.0), range_sigma_m=0.01)
    settings_here = [*NO_FLOOR, "hit.range_sigma_m=0.01", "hit.range_sigma_per_m=0"]
    found = detect_cones(world.scans(400), None, cone_config("robust", settings_here))
    assert found.report.cones == 400
    error = errors(found, world) * (1.0, distance_m)
    predicted = np.sqrt(found.covariance[:, [0, 1], [0, 1]].mean(axis=0)) * (1.0, distance_m)
    assert np.all(np.abs(error.mean(axis=0)) < 0.0015)
    assert np.all(error.std(axis=0) < 1.15 * predicted)
    assert np.all(error.std(axis=0) > 0.7 * predicted)


def test_the_covariance_is_a_covariance_and_grows_by_the_floor() -> None:
    world = LidarWorld(np.array([[0.9, 0.2], [-0.3, 1.4]]), mounting=(0.3, 0.1, 0.5))
    scans = world.scans(5)
    found = detect_cones(scans, None, ROBUST)
    bare = detect_cones(scans, None, cone_config("robust", NO_FLOOR))
    assert np.all(np.linalg.eigvalsh(bare.covariance) > 0.0)
    added = found.covariance - bare.covariance
    floor = np.diag([ROBUST.floor.range_sigma_m**2, ROBUST.floor.bearing_sigma_rad**2])
    np.testing.assert_allclose(added, np.broadcast_to(floor, added.shape), atol=1e-11)


@pytest.mark.parametrize(
    ("centre", "bias_m"), [("centroid", -RADIUS_M * math.pi / 4), ("shifted", 0)]
)
def test_the_mean_of_the_hits_lies_in_front_of_the_axis(centre: str, bias_m: float) -> None:
    world = LidarWorld(np.array([[1.2, 0.0], [0.0, 0.8]]), beams=360)
    found = detect_cones(world.scans(200), None, cone_config("thesis", [f"centre={centre}"]))
    assert found.report.cones == 400
    error = errors(found, world)
    assert error[:, 0].mean() == pytest.approx(bias_m, abs=1.5e-3)
    assert np.all(error[:, 1].std() < np.sqrt(found.covariance[:, 1, 1]))


def test_the_thesis_is_blind_near_the_car_and_the_geometry_is_not() -> None:
    near = LidarWorld(np.array([[0.45, 0.0]]), beams=360)
    assert detect_cones(near.scans(50), None, THESIS).report.refused == {"too many hits": 50}
    assert detect_cones(near.scans(50), None, ROBUST).report.cones == 50
    far = LidarWorld(np.array([[2.0, 0.0]]), beams=360)
    assert detect_cones(far.scans(50), None, THESIS).report.cones == 0


def test_deskewing_removes_what_the_motion_of_the_car_adds() -> None:
    cones = np.array([[1.3, 0.5], [0.2, 1.5], [-1.2, -0.7], [0.6, -1.1]])
    world = LidarWorld(cones, speed_m_s=0.9, yaw_rate_rad_s=1.0, mounting=(0.1, 0.0, 0.2))
    config = replace(ROBUST, mounting=replace(ROBUST.mounting, x_m=0.1, yaw_rad=0.2))
    scans, odometry = world.scans(12), world.odometry(12)

    def worst_m(found: ConeDetections) -> float:
        error = errors(found, world) * np.stack(
            [np.ones(found.hits.size), found.observations.range_m], 1
        )
        return float(np.hypot(*error.T).max())

    still = detect_cones(scans, None, config)
    moved = detect_cones(scans, odometry, config)
    assert still.report.not_deskewed == 12
    assert moved.report.not_deskewed == 0
    assert worst_m(still) > 0.03  # from the middle; from the first beam it would be twice that
    assert worst_m(moved) < 0.0005
    assert moved.report.cones >= 40


def test_observations_are_stamped_in_the_middle_of_the_revolution() -> None:
    world = LidarWorld(np.array([[1.0, 0.0]]))
    observations, _ = observations_from_scans(world.scans(3), world.odometry(3), ROBUST)
    middle = (world.beams - 1) * (PERIOD_NS // world.beams) // 2
    assert observations.t_ns.tolist() == [k * PERIOD_NS + middle for k in range(3)]
    assert observations.landmark_id.tolist() == [-1, -1, -1]


def test_a_gap_in_the_odometry_is_counted_and_its_end_is_carried_on() -> None:
    world = LidarWorld(np.array([[1.0, 0.3]]), speed_m_s=0.5)
    scans, full = world.scans(30), world.odometry(30)

    def with_rows(keep: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Odometry:
        return Odometry(
            "cut", full.t_ns[keep], full.pose_odom_base[keep], full.speed_m_s[keep],
            full.yaw_rate_rad_s[keep],
        )  # fmt: skip

    gap = (full.t_ns < 500_000_000) | (full.t_ns > 1_500_000_000)
    assert detect_cones(scans, with_rows(gap), ROBUST).report.not_deskewed in (15, 16, 17)
    last_beam = int(scans.beam_t_ns[-1])
    short = with_rows(full.t_ns < last_beam - 60_000_000)
    report = detect_cones(scans, short, ROBUST)
    assert report.report.not_deskewed == 0
    np.testing.assert_allclose(errors(report, world)[:, 0], 0.0, atol=0.003)
    one_sample = with_rows(full.t_ns == 0)
    assert detect_cones(scans, one_sample, ROBUST).report.not_deskewed == 30


def test_odometry_that_is_no_motion_is_not_used() -> None:
    world = LidarWorld(np.array([[1.0, 0.3]]), speed_m_s=0.5)
    scans, good = world.scans(10), world.odometry(10)
    poses, times = good.pose_odom_base.copy(), good.t_ns.copy()
    poses[55], times[60:] = np.nan, times[60:] - 200_000_000
    for bad in (replace(good, pose_odom_base=poses), replace(good, t_ns=times)):
        found = detect_cones(scans, bad, ROBUST)
        assert 1 <= found.report.not_deskewed <= 10
        assert np.abs(errors(found, world)).max() < 0.05


@pytest.mark.parametrize("preset", ["robust", "thesis"])
def test_walls_are_no_cones(preset: str) -> None:
    for half_m in (0.8, 1.4, 1.9):
        world = LidarWorld(np.zeros((0, 2)), room(half_m), range_sigma_m=0.01)
        assert detect_cones(world.scans(20), None, cone_config(preset)).report.cones == 0


def test_walls_crossing_the_range_limit_or_seen_between_cones_are_none() -> None:
    cones = np.array([[0.8, 0.12], [0.8, -0.12], [0.2, 0.9], [0.45, 0.85]])
    slanted = [(-4.0, 2.9, 4.0, 3.1), (1.2, -5.0, 1.6, 5.0)]
    world = LidarWorld(cones, slanted, range_sigma_m=0.01)
    found = detect_cones(world.scans(40), None, ROBUST)
    error = errors(found, world)
    assert np.all(np.abs(error[:, 0]) < 0.03)
    assert found.report.cones == 160
    assert found.report.refused["hidden"] >= 40


def test_a_cone_half_hidden_by_another_is_refused_in_robust() -> None:
    world = LidarWorld(np.array([[0.8, 0.0], [1.6, 0.09]]))
    found = detect_cones(world.scans(10), None, ROBUST)
    assert found.report.cones == 10
    assert found.report.refused == {"hidden": 10}


def test_cones_side_by_side_are_told_apart() -> None:
    world = LidarWorld(np.array([[1.0, -0.15], [1.0, 0.15], [1.3, 0.0]]), range_sigma_m=0.01)
    found = detect_cones(world.scans(20), None, ROBUST)
    assert found.report.cones == 60


def test_a_cone_across_the_seam_is_one_cone() -> None:
    world = LidarWorld(np.array([[-1.0, 0.0]]))
    found = detect_cones(world.scans(50), None, ROBUST)
    assert found.report.cones == 50
    ahead = detect_cones(LidarWorld(np.array([[1.0, 0.0]])).scans(50), None, ROBUST)
    assert abs(found.hits.mean() - ahead.hits.mean()) < 0.5
    np.testing.assert_allclose(np.abs(found.observations.bearing_rad), math.pi, atol=0.01)


def test_the_order_of_the_beams_does_not_matter() -> None:
    world = LidarWorld(np.array([[1.0, 0.2], [-0.5, 0.9]]), room(2.5), speed_m_s=0.9)
    scans, odometry = world.scans(1), world.odometry(1)
    mixed = np.random.default_rng(1).permutation(world.beams)
    shuffled = replace(
        scans,
        beam_t_ns=scans.beam_t_ns[mixed],
        range_m=scans.range_m[mixed],
        bearing_rad=scans.bearing_rad[mixed] + 4 * math.pi,
    )
    one, other = (detect_cones(s, odometry, ROBUST) for s in (scans, shuffled))
    assert one.report.cones == 2
    np.testing.assert_allclose(points(one.observations), points(other.observations), atol=1e-9)


def test_cones_are_told_from_the_car_and_not_from_the_lidar() -> None:
    mounting = (0.25, -0.04, math.pi)
    world = LidarWorld(np.array([[1.2, 0.3], [-0.4, -0.9]]), mounting=mounting)
    config = cone_config(
        "robust", ["mounting.x_m=0.25", "mounting.y_m=-0.04", f"mounting.yaw_rad={math.pi}"]
    )
    found = detect_cones(world.scans(5), None, config)
    assert found.report.cones == 10
    assert np.abs(errors(found, world)).max() < 0.003


def test_the_report_counts_every_beam_and_says_it() -> None:
    world = LidarWorld(np.array([[1.0, 0.0]]), [(2.5, -0.5, 2.5, 0.5)])
    found = detect_cones(world.scans(4), None, THESIS)
    report = found.report
    used = report.beams - report.beams_without_echo - report.beams_out_of_range
    assert report.beams == 3200
    assert report.beams_out_of_range > 0
    assert used == pytest.approx(4 * 2 * math.asin(0.05) / (2 * math.pi / 800), abs=4)
    assert "0 cones in 4 lidar revolutions of 3200 beams" in report.text()
    assert "4 too many hits" in report.text()
    assert "4 not corrected for the motion" in report.text()
    told: list[int] = []
    detect_cones(world.scans(4), world.odometry(4), ROBUST, told.append)
    assert told == [1, 1, 1, 1]


def test_empty_silent_and_single_beams() -> None:
    bearings = np.linspace(-3, 3, 100)
    silent = [np.zeros(100), np.full(100, np.nan), np.full(100, np.inf), np.full(100, -1.0)]
    one, none = (np.ones(1), np.zeros(1)), (np.zeros(0), np.zeros(0))
    nowhere = (np.ones(100), np.full(100, np.nan))
    revolutions = [*((ranges, bearings) for ranges in silent), one, none, nowhere]
    for config in (ROBUST, THESIS):
        found = detect_cones(scans_of(*revolutions), None, config)
        assert found.report.cones == 0
        assert found.report.without_echo == 6
        assert found.report.beams_without_echo == 500
        assert found.report.refused == {"too few hits": 1}
    assert "6 without any echo" in found.report.text()
    assert detect_cones(scans_of(), None, ROBUST).report.revolutions == 0


def test_the_number_of_beams_may_change_from_revolution_to_revolution() -> None:
    worlds = [LidarWorld(np.array([[1.0, 0.3]]), beams=beams) for beams in (800, 360, 1600, 500)]
    turns = [(scans.range_m, scans.bearing_rad) for scans in (w.scans(1) for w in worlds)]
    found = detect_cones(scans_of(*turns), None, ROBUST)
    assert found.report.cones == 4
    assert np.all(np.diff(found.hits[[1, 3, 0, 2]]) > 0)


def test_revolutions_whose_time_does_not_increase_are_left_out_and_counted() -> None:
    world = LidarWorld(np.array([[1.0, 0.0]]))
    scans = world.scans(10)

    def shifted(revolution: int, by_ns: int) -> Scans:
        t_ns, beam_t_ns = scans.t_ns.copy(), scans.beam_t_ns.copy()
        t_ns[revolution:] += by_ns
        beam_t_ns[scans.starts[revolution] :] += by_ns
        return replace(scans, t_ns=t_ns, beam_t_ns=beam_t_ns)

    back = detect_cones(shifted(5, -7 * PERIOD_NS), None, ROBUST)
    assert back.report.out_of_order == 5
    assert np.all(np.diff(back.observations.t_ns) > 0)
    future = shifted(4, 10**15)
    beams = future.beam_t_ns.copy()
    beams[future.starts[5] :] -= 10**15
    one_wrong = detect_cones(replace(future, beam_t_ns=beams), None, ROBUST)
    assert one_wrong.report.out_of_order == 1
    assert "1 left out because their time does not increase" in one_wrong.report.text()
    twice = detect_cones(shifted(5, -PERIOD_NS), None, ROBUST)
    assert twice.report.out_of_order == 1


def test_beams_whose_own_times_are_impossible_are_taken_at_the_stamp() -> None:
    world = LidarWorld(np.array([[1.0, 0.0]]))
    scans = world.scans(3)
    beam_t_ns = scans.beam_t_ns.copy()
    beam_t_ns[900] = np.iinfo(np.int64).min
    beam_t_ns[1700] = np.iinfo(np.int64).max
    found = detect_cones(replace(scans, beam_t_ns=beam_t_ns), world.odometry(3), ROBUST)
    assert found.report.not_deskewed == 2
    assert found.observations.t_ns[1:].tolist() == [PERIOD_NS, 2 * PERIOD_NS]
    assert found.report.cones == 3


def test_ten_thousand_points_of_clutter_cost_bounded_time() -> None:
    generator = np.random.default_rng(7)
    worst = np.full(10_000, 0.31), generator.uniform(-math.pi, math.pi, 10_000)
    clutter = generator.uniform(0.0, 3.0, 10_000), worst[1]
    for config in (ROBUST, THESIS):
        detect_cones(scans_of(clutter), None, config)
        started_s = time.process_time()
        found = detect_cones(scans_of(clutter, worst), None, config)
        assert time.process_time() - started_s < 1.0
        assert found.report.beams == 20_000


VALUES = st.floats(allow_nan=True, allow_infinity=True) | st.floats(0.0, 3.0)


@settings(max_examples=200)
@given(st.lists(st.tuples(VALUES, VALUES | st.floats(-4, 4), st.integers(-(2**63), 2**63 - 1))))
def test_no_beams_make_it_fall_over(beams: list[tuple[float, float, int]]) -> None:
    ranges = np.array([beam[0] for beam in beams])
    bearings = np.array([beam[1] for beam in beams])
    scans = scans_of((ranges, bearings), (ranges, bearings))
    wild = replace(scans, beam_t_ns=np.array([beam[2] for beam in beams] * 2, np.int64))
    careless = cone_config("thesis", ["min_range_m=0", "max_range_m=.inf", "min_hits=1"])
    for each in (scans, wild):
        for config in (ROBUST, THESIS, careless):
            found = detect_cones(each, None, config)
            assert found.report.beams <= 2 * len(beams)
            assert np.all(np.isfinite(points(found.observations)))


def rplidar_text_log(file: Path) -> Scans:
    """A log of Slamtec's ultra_simple: clockwise degrees, millimetres, S where a turn begins."""
    rows = re.findall(r"^(S?)\s+theta: (\S+) Dist: (\S+)", file.read_text(), re.MULTILINE)
    begins = np.array([mark == "S" for mark, _, _ in rows])
    values = np.array([(float(theta), float(dist)) for _, theta, dist in rows])
    cut = np.flatnonzero(begins)
    turns = np.split(np.stack([values[:, 1] * 1e-3, wrap(-np.radians(values[:, 0]))], 1), cut)
    return scans_of(*((turn[:, 0], turn[:, 1]) for turn in turns))


@pytest.mark.realdata
def test_a_real_a2_in_a_room_without_cones(data_dir: Path) -> None:
    for name in ("test12", "test18", "test20"):
        scans = rplidar_text_log(data_dir / "rplidar" / "a2_logs" / f"{name}.csv")
        found, again = (detect_cones(scans, None, ROBUST) for _ in range(2))
        report = found.report
        assert report == again.report
        assert 0.01 < report.beams_without_echo / report.beams < 0.04
        assert report.cones <= 0.1 * report.revolutions
        assert report.revolutions > 20
        assert report.out_of_order == report.without_echo == 0


@pytest.mark.realdata
def test_a_real_hokuyo_sees_the_same_things_in_every_scan(data_dir: Path, tmp_path: Path) -> None:
    bag = data_dir / "bags" / "hokuyo_circles.bag"
    import_bag(bag, tmp_path / "session", {"scan": "/front_scan"})
    scans = Session.open(tmp_path / "session").scans()
    found, again = (detect_cones(scans, None, ROBUST) for _ in range(2))
    assert found.report == again.report
    np.testing.assert_array_equal(found.covariance, again.covariance)
    assert found.report.revolutions == 331
    assert 331 < found.report.cones < 4 * 331
    # A thing of a cone's size stands at about (0.97, 1.16) m; the legs beside it are too thin.
    xy = points(found.observations)
    there = np.hypot(*(xy - (0.97, 1.16)).T) < 0.15
    assert np.unique(found.observations.t_ns[there]).size == np.count_nonzero(there) > 320
    assert np.all(xy[there].std(axis=0) < 0.01)
    thin = detect_cones(scans, None, cone_config("robust", ["cone_radius_m=0.02"])).observations
    assert np.count_nonzero(np.hypot(*(points(thin) - (1.0, -0.7)).T) < 0.15) > 300
