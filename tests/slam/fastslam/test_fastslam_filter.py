from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from fastslam_reference import BEARING_SIGMA_RAD, laps, polar_update, ring, seen_from

from geometry import Floats, wrap
from slam.config import PRESETS, LandmarkRules, MotionNoise, ObservationNoise
from slam.ekf import EkfSlam
from slam.fastslam.config import FASTSLAM_PRESETS, FastSlamConfig
from slam.fastslam.filter import FastSlam

STILL = MotionNoise(xy_sigma_m_per_sqrt_s=0.0, heading_sigma_rad_per_sqrt_s=0.0)
OBSERVATION = ObservationNoise(range_sigma_m=0.04, bearing_sigma_rad=BEARING_SIGMA_RAD)
R = np.diag([0.04**2, BEARING_SIGMA_RAD**2])
CONFIG = FastSlamConfig(
    motion=MotionNoise(
        xy_sigma_m_per_sqrt_s=0.01 * math.sqrt(15.0),
        heading_sigma_rad_per_sqrt_s=math.radians(0.5) * math.sqrt(15.0),
    ),
    observation=OBSERVATION,
    landmarks=dataclasses.replace(
        FASTSLAM_PRESETS["robust"].landmarks, confirm_log_odds=0.0, learns_field_of_view=False
    ),
    particles=50,
    new_density_per_m_rad=0.05,
    accept_gate=9.21,
    spawn_gate=25.0,
    resample_below=0.5,
)
NO_IDS = np.full(8, -1)


def still(**changes: object) -> FastSlamConfig:
    """One particle that stands without doubt at the origin: nothing but its landmark filters."""
    return dataclasses.replace(CONFIG, motion=STILL, **{"particles": 1, **changes})  # type: ignore[arg-type]  # field by field


def see(slam: FastSlam, t_ns: int, landmarks: Floats, ids: list[int] | None = None) -> None:
    known = np.array(ids) if ids else np.full(len(landmarks), -1)
    slam.update(t_ns, known, *seen_from(slam.pose, landmarks))


def test_a_landmark_is_filtered_as_by_the_polar_filter_of_the_book() -> None:
    random = np.random.default_rng(1)
    slam = FastSlam(still(), "known")
    pose, cone = np.zeros(3), np.array([[1.1, -0.7]])
    mean, P, log_weight = np.zeros(2), np.zeros((2, 2)), 0.0
    for k in range(30):
        pose = np.array([0.05 * k, 0.02 * k, 0.1 * k])
        slam._cloud.x[:], slam._cloud.y[:], slam._cloud.heading[:] = pose
        range_m, bearing = seen_from(pose, cone)
        range_m, bearing = (
            range_m + random.normal(0.0, 0.04),
            bearing + random.normal(0.0, math.radians(1.0)),
        )
        slam.update(k, np.array([4]), range_m, wrap(bearing))
        if k == 0:
            u = np.array([np.cos(pose[2] + bearing[0]), np.sin(pose[2] + bearing[0])])
            mean = pose[:2] + range_m[0] * u
            g = np.stack([u, range_m[0] * np.array([-u[1], u[0]])], axis=1)
            P = g @ R @ g.T
            np.testing.assert_allclose(slam._cloud.covariance[0, 0], P[[0, 0, 1], [0, 1, 1]])
        else:
            mean, P, density = polar_update(pose, mean, P, range_m[0], bearing[0], R)
            log_weight += math.log(density)
    cloud = slam._cloud
    found = np.array([cloud.landmark_x[0, 0], cloud.landmark_y[0, 0]])
    np.testing.assert_allclose(found, mean, atol=1e-3)
    np.testing.assert_allclose(cloud.covariance[0, 0], P[[0, 0, 1], [0, 1, 1]], rtol=0.03)


def test_a_particles_weight_is_the_likelihood_of_the_book_times_p0_for_each_stranger() -> None:
    p0 = 20.0
    config = still(particles=2, resample_below=0.0, new_density_per_m_rad=p0)
    slam = FastSlam(config, "likelihood")
    cone = np.array([[1.5, 0.4]])
    see(slam, 0, cone)
    other = slam._cloud
    other.landmark_x[1, 0] += 5.0  # the second particle knows nothing here
    mean = np.array([other.landmark_x[0, 0], other.landmark_y[0, 0]])
    c = other.covariance[0, 0]
    P = np.array([[c[0], c[1]], [c[1], c[2]]])
    range_m, bearing = seen_from(np.zeros(3), cone)
    density = polar_update(np.zeros(3), mean, P, range_m[0] + 0.03, bearing[0] + 0.01, R)[2]
    slam.update(1, NO_IDS[:1], range_m + 0.03, bearing + 0.01)
    assert 0.1 < density / p0 < 10.0
    np.testing.assert_allclose(slam._weights, np.array([density, p0]) / (density + p0), rtol=0.01)


def test_many_observations_do_not_underflow_the_weights() -> None:
    """120 observations off by 3 sigma: linear weights would be 1e-235 and worse, then 0 / 0."""
    slam = FastSlam(dataclasses.replace(CONFIG, accept_gate=100.0), "known")
    ids, cones = np.arange(120), ring(120)
    ranges, bearings = seen_from(np.zeros(3), cones)
    slam.predict(np.array([[0.0, 0.0, 0.01]]), np.array([0.1]))
    slam.update(0, ids, ranges, bearings)
    for k in range(20):
        slam.predict(np.array([[0.0, 0.0, 0.01]]), np.array([0.1]))
        slam.update(k + 1, ids, ranges + 0.5 * (-1) ** k, bearings)
    assert np.isfinite(slam.pose).all()
    assert slam._weights.sum() == pytest.approx(1.0)


def test_particles_stand_still_with_the_odometry_unless_told_otherwise() -> None:
    slam, thesis = FastSlam(CONFIG, "known"), FastSlam(FASTSLAM_PRESETS["thesis"], "known")
    for one in (slam, thesis):
        one.predict(np.zeros((50, 3)), np.full(50, 0.02))
    assert not slam.pose_covariance.any()
    np.testing.assert_allclose(
        np.sqrt(np.diag(thesis.pose_covariance)),
        np.array([0.008, 0.008, math.radians(0.35)]) * math.sqrt(15.0),
        rtol=0.1,
    )


def test_the_spread_does_not_depend_on_the_rate_of_the_odometry() -> None:
    config = dataclasses.replace(CONFIG, particles=20_000)
    coarse, fine = FastSlam(config, "known", 1), FastSlam(config, "known", 2)
    coarse.predict(np.array([[0.5, 0.0, 0.0]]), np.array([1.0]))
    fine.predict(np.full((50, 3), [0.01, 0.0, 0.0]), np.full(50, 0.02))
    np.testing.assert_allclose(
        np.diag(coarse.pose_covariance)[2], np.diag(fine.pose_covariance)[2], rtol=0.05
    )


def test_prediction_gives_mean_and_spread_of_the_cloud_also_across_the_seam() -> None:
    slam = FastSlam(dataclasses.replace(CONFIG, particles=5000), "known")
    poses, covariances = slam.predict(
        np.array([[0.0, 0.0, math.pi], [0.1, 0.0, 0.0]]), np.array([0.1, 0.1])
    )
    cloud = slam._cloud
    assert np.ptp(cloud.heading) > 6.0
    assert abs(wrap(poses[1, 2] - math.pi)) < 0.01
    deviation = np.stack(
        [cloud.x - poses[1, 0], cloud.y - poses[1, 1], wrap(cloud.heading - poses[1, 2])]
    )
    np.testing.assert_allclose(covariances[1], deviation @ deviation.T / 5000, atol=1e-9)


def test_cones_dead_astern_make_no_duplicates() -> None:
    slam, random = FastSlam(CONFIG, "likelihood"), np.random.default_rng(3)
    cones = np.array([[-2.0, 0.0], [-1.2, 0.001], [2.0, 1.0]])
    for t in range(200):
        ranges, bearings = seen_from(np.zeros(3), cones)
        bearings = wrap(bearings + random.normal(0.0, 0.01, 3))
        slam.update(t, NO_IDS[:3], ranges + random.normal(0.0, 0.02, 3), bearings)
    assert len(slam.estimated_map()) == 3


def test_each_landmark_takes_the_likeliest_observation_and_no_second() -> None:
    slam = FastSlam(still(), "likelihood")
    see(slam, 0, np.array([[2.0, 0.0], [2.3, 0.0]]))
    report = slam.update(1, NO_IDS[:3], np.array([2.02, 2.07, 2.28]), np.zeros(3))
    assert (report.matched, report.ignored, report.added) == (2, 1, 0)
    x = slam._cloud.landmark_x[0, :2]
    np.testing.assert_allclose(x, [2.01, 2.29], atol=1e-6)


def test_the_grey_zone_neither_matches_nor_spawns_and_beyond_it_is_new() -> None:
    sigma = 0.04 * math.sqrt(2.0)  # of the innovation after one sighting
    for off, wanted in ((2.5, (1, 0, 0)), (4.0, (0, 1, 0)), (5.5, (0, 0, 1))):
        slam = FastSlam(still(), "likelihood")
        see(slam, 0, np.array([[2.0, 0.0]]))
        report = slam.update(1, NO_IDS[:1], np.array([2.0 + off * sigma]), np.zeros(1))
        assert (report.matched, report.ignored, report.added) == wanted


def test_the_thesis_threshold_is_a_likelihood_per_metre_and_radian() -> None:
    """p0 = 1 with S = 2 Q: a squared distance of 9.47 (slam_scoring 3.4)."""
    for square, matched in ((9.3, 1), (9.7, 0)):
        config = dataclasses.replace(FASTSLAM_PRESETS["thesis"], motion=STILL, particles=1)
        slam = FastSlam(config, "likelihood")
        see(slam, 0, np.array([[2.0, 0.0]]))
        off = math.sqrt(2.0 * square) * 0.04
        report = slam.update(1, NO_IDS[:1], np.array([2.0 + off]), np.zeros(1))
        assert (report.matched, report.added) == (matched, 1 - matched)


def test_a_missed_landmark_goes_only_where_the_sensor_would_have_seen_it() -> None:
    blind, within, far = [0.4, 0.0], [0.0, 1.0], [-1.9, 0.0]
    slam = FastSlam(still(), "likelihood")
    see(slam, 0, np.array([blind, within, far]))
    removed = [slam.update(t, NO_IDS[:0], np.empty(0), np.empty(0)).removed for t in range(1, 9)]
    assert removed == [0, 1, 0, 0, 0, 0, 0, 0]
    np.testing.assert_allclose(
        sorted(slam.estimated_map().landmarks.positions.tolist()), [far, blind], atol=1e-9
    )


def test_twins_become_one_and_the_one_seen_more_often_stays() -> None:
    slam = FastSlam(still(), "likelihood")
    see(slam, 0, np.array([[1.0, 0.0], [0.0, -1.0]]))
    see(slam, 1, np.array([[1.0, 0.0], [0.0, -1.0]]))
    slam._cloud.landmark_x[0, 2:4] = [1.1, 0.1]  # two more that no cone can be
    slam._cloud.landmark_y[0, 2:4] = [0.0, -1.0]
    slam._cloud.covariance[0, 2:4] = [1e-5, 0.0, 1e-5]
    slam._cloud.seen[0, 2:4], slam._cloud.evidence[0, 2:4] = [1, 9], 5.0
    slam._cloud.landmarks[0] = 4
    report = slam.update(2, NO_IDS[:2], np.array([1.0, 1.0]), np.array([0.0, -math.pi / 2]))
    assert (report.removed, slam._cloud.landmarks[0]) == (2, 2)
    assert sorted(slam._cloud.seen[0, :2].tolist()) == [3, 9]


def test_what_stands_behind_another_cone_may_be_hidden() -> None:
    for radius, kept in ((0.1, 2), (0.0, 1)):
        rules = dataclasses.replace(CONFIG.landmarks, occluder_radius_m=radius)
        slam = FastSlam(still(landmarks=rules), "likelihood")
        for t in range(5):
            see(slam, t, np.array([[0.0, 0.7], [0.05, 1.3]]))
        for t in range(5, 15):
            see(slam, t, np.array([[0.0, 0.7]]))
        assert len(slam.estimated_map()) == kept


def test_outside_the_field_of_view_absence_is_no_evidence() -> None:
    for angle, kept in ((1.0, 1), (math.tau, 0)):
        rules = dataclasses.replace(CONFIG.landmarks, field_of_view_rad=angle)
        slam = FastSlam(still(landmarks=rules), "likelihood")
        see(slam, 0, np.array([[0.7, 0.7]]))
        for t in range(1, 20):
            slam.update(t, NO_IDS[:0], np.empty(0), np.empty(0))
        assert len(slam.estimated_map()) == kept


def test_evidence_is_weighed_as_by_the_ekf() -> None:
    """One particle without doubt and an EKF without doubt are the same filter."""
    still_ekf = dataclasses.replace(PRESETS["robust"], motion=STILL, tail_gate=1e9)
    ekf = EkfSlam(still_ekf, "nearest")
    fast = FastSlam(
        dataclasses.replace(FASTSLAM_PRESETS["robust"], particles=1, motion=STILL, tail_gate=1e9),
        "likelihood",
    )
    random = np.random.default_rng(4)
    cones = np.array([[1.0, 0.1], [-0.9, 0.8], [0.2, -1.6]])
    for t in range(12):
        seen = random.random(3) < (1.0 if t == 0 else 0.7)
        ranges, bearings = seen_from(np.zeros(3), cones[seen])
        ranges = ranges + random.normal(0.0, 0.02, ranges.size)
        for slam in (ekf, fast):
            slam.update(t, NO_IDS[: ranges.size], ranges, bearings)
        np.testing.assert_allclose(
            fast._cloud.evidence[0, :3], ekf._records["log_odds"][:3], atol=0.05
        )


def test_the_thesis_counts_up_and_down_by_one() -> None:
    config = dataclasses.replace(FASTSLAM_PRESETS["thesis"], motion=STILL, particles=1)
    slam, cone = FastSlam(config, "likelihood"), np.array([[1.0, 0.0]])
    for t in range(40):
        see(slam, t, cone)
    np.testing.assert_allclose(slam._cloud.evidence[0, 0], 40.0)
    misses = 0
    while slam._cloud.landmarks[0]:
        slam.update(100, NO_IDS[:0], np.empty(0), np.empty(0))
        misses += 1
    assert misses == 41


def test_removal_moves_everything_that_is_known_of_the_last_landmark() -> None:
    slam = FastSlam(still(), "likelihood")
    see(slam, 10, np.array([[1.0, 0.0]]))
    see(slam, 20, np.array([[1.0, 0.0], [-1.9, 0.0]]))
    cloud = slam._cloud
    assert cloud.landmarks[0] == 2
    columns = [column for column in cloud if column.ndim > 1]
    last = [column[0, 1].copy() for column in columns]
    while cloud.landmarks[0] == 2:
        slam.update(60, NO_IDS[:0], np.empty(0), np.empty(0))
    for column, wanted in zip(columns, last, strict=True):
        np.testing.assert_array_equal(column[0, 0], wanted)
    made = slam.estimated_map()
    assert made.t_added_ns is not None
    assert made.t_added_ns.tolist() == [20]


def test_a_landmark_that_came_back_knows_when_its_place_was_first_filled() -> None:
    slam = FastSlam(still(), "likelihood")
    see(slam, 10, np.array([[1.0, 0.0]]))
    for t in (20, 30):
        slam.update(t, NO_IDS[:0], np.empty(0), np.empty(0))
    assert len(slam.estimated_map()) == 0
    see(slam, 40, np.array([[1.0, 0.01]]))
    made = slam.estimated_map()
    assert made.t_added_ns is not None
    assert made.t_first_ns is not None
    assert made.added_from is not None
    assert (made.t_added_ns.tolist(), made.t_first_ns.tolist()) == ([40], [10])
    np.testing.assert_allclose(made.added_from, [[0.0, 0.0]])


def test_tentative_landmarks_are_not_reported() -> None:
    slam = FastSlam(still(min_seen=3), "known")
    for t in range(3):
        see(slam, t, ring(4)[: 4 - t], [8, 7, 6, 5][: 4 - t])
    made = slam.estimated_map()
    assert made.n_seen is not None
    assert (made.landmarks.ids.tolist(), made.n_seen.tolist()) == ([8, 7], [3, 3])


def test_a_contradicted_known_landmark_is_placed_anew() -> None:
    slam = FastSlam(still(innovation_gate=50.0), "known")
    see(slam, 0, ring(4), [1, 2, 3, 4])
    moved = np.array([[0.3, -3.0]])
    rejected = []
    for t in range(1, 4):
        report = slam.update(t, np.array([3]), *seen_from(np.zeros(3), moved))
        rejected.append(report.rejected)
    assert rejected == [1, 1, 0]
    made = slam.estimated_map()
    np.testing.assert_allclose(made.landmarks.positions[made.landmarks.ids == 3], moved, atol=1e-9)


def test_the_map_is_that_of_the_best_particle_before_resampling() -> None:
    config = dataclasses.replace(FASTSLAM_PRESETS["thesis"], particles=100)
    slam = FastSlam(config, "known", 5)
    see(slam, 0, ring(5), [1, 2, 3, 4, 5])
    assert slam._best == 0  # all alike: the lowest index
    slam.predict(np.array([[0.3, 0.0, 0.1]]), np.array([0.3]))
    truth = np.array([0.3, 0.0, 0.1])
    errors = np.hypot(slam._cloud.x - 0.3, slam._cloud.y) + abs(slam._cloud.heading - 0.1)
    slam.update(1, np.arange(1, 6), *seen_from(truth, ring(5)))
    assert errors[slam._best] < np.percentile(errors, 5)
    assert slam._cloud.log_weight.max() == slam._cloud.log_weight.min() == 0.0


def test_the_same_seed_gives_the_same_and_batches_do_not_matter() -> None:
    def run(seed: int, batch: int) -> tuple[Floats, Floats]:
        slam = FastSlam(CONFIG, "likelihood", seed)
        for t in range(5):
            for _ in range(0, 12, batch):
                slam.predict(np.full((batch, 3), [0.01, 0.0, 0.02]), np.full(batch, 0.02))
            see(slam, t, ring(6))
        return slam.pose, slam.estimated_map().landmarks.positions

    one, same, other = run(3, 12), run(3, 4), run(4, 12)
    np.testing.assert_array_equal(one[0], same[0])
    np.testing.assert_array_equal(one[1], same[1])
    assert not np.array_equal(one[0], other[0])


def test_the_synthetic_laps_are_driven_within_two_centimetres() -> None:
    """Shared problem of slam_scoring 1.5: N = 200, known ids, after aligning the path."""
    config = dataclasses.replace(CONFIG, particles=200)
    drives = [laps(FastSlam(config, "known", seed), seed) for seed in range(6)]
    assert np.mean([d.aligned_error_m for d in drives]) <= 0.02
    assert all((d.missing, d.surplus) == (0, 0) for d in drives)


def test_clutter_does_not_enter_the_map_of_robust_and_floods_that_of_the_thesis() -> None:
    config = dataclasses.replace(
        FASTSLAM_PRESETS["robust"], motion=CONFIG.motion, observation=OBSERVATION
    )
    drives = [laps(FastSlam(config, "likelihood", s), s, clutter=0.05) for s in range(5)]
    assert sum((d.missing, d.surplus) == (0, 0) for d in drives) >= 4
    assert np.mean([d.aligned_error_m for d in drives]) <= 0.02
    thesis = dataclasses.replace(FASTSLAM_PRESETS["thesis"], particles=200)
    assert laps(FastSlam(thesis, "likelihood", 0), 0, clutter=0.05).surplus > 10


def test_a_storm_of_clutter_is_bounded_and_counted() -> None:
    config = dataclasses.replace(
        CONFIG,
        landmarks=LandmarkRules(max_landmarks=40),
    )
    for association in ("likelihood", "known"):
        slam, random = FastSlam(config, association), np.random.default_rng(0)
        for t in range(3):
            ranges, bearings = random.uniform(0.1, 9.0, 10_000), random.uniform(-4, 4, 10_000)
            report = slam.update(t, np.arange(10_000) + 9 * t, ranges, bearings)
            assert report.over_limit >= 10_000 - 128
            assert sum(dataclasses.astuple(report)) == 10_000
        assert slam._cloud.landmarks.max() == slam._cloud.evidence.shape[1] == 40


def test_values_that_are_no_numbers_are_counted_and_left_out() -> None:
    slam = FastSlam(CONFIG, "likelihood")
    ranges = np.array([np.nan, np.inf, -1.0, 0.0, 1.0, 1.0])
    report = slam.update(0, NO_IDS[:6], ranges, np.array([0.0, 0.0, 0.0, 0.0, np.nan, 0.5]))
    assert (report.invalid, report.added) == (5, 1)
    report = slam.update(1, NO_IDS[:0], np.empty(0), np.empty(0))
    assert report.matched == 0
    assert np.isfinite(slam.pose).all()


def test_the_presets_differ_where_the_documents_say() -> None:
    thesis, robust = FASTSLAM_PRESETS["thesis"], FASTSLAM_PRESETS["robust"]
    assert (thesis.particles, thesis.resample_below, thesis.min_seen) == (2000, 1.0, 1)
    assert thesis.landmarks.far_certain_m == 1.25
    assert thesis.motion.xy_sigma_m_per_sqrt_s / math.sqrt(15.0) == pytest.approx(0.008)
    assert robust.spawn_gate == 25.0
    assert robust.resample_below == 0.5
