from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import world
from dense import full

from geometry import Floats
from slam.association import expectations
from slam.config import PRESETS, EkfConfig, LandmarkRules
from slam.ekf import EkfSlam
from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.filter import FastSlam
from slam.interface import Slam, UpdateReport
from slam.landmarks import (
    Departed,
    chance_of_sight,
    detection_probability,
    gain,
    log_likelihood,
    loss,
    rules_array,
)
from slam.observation import noise_array

ROBUST = PRESETS["robust"]
RULES = ROBUST.landmarks
STEEP = dataclasses.replace(RULES, near_possible_m=0.574, far_possible_m=1.433)


def look(slam: EkfSlam, t_ns: int, cones: list[tuple[float, float]]) -> UpdateReport:
    """One scan that sees cones at these ranges and bearings."""
    seen = np.array(cones, dtype=np.float64).reshape(-1, 2)
    return slam.update(t_ns, np.full(len(seen), -1), seen[:, 0], seen[:, 1])


def with_rules(**changes: object) -> EkfConfig:
    rules = dataclasses.replace(RULES, **changes)  # type: ignore[arg-type]  # tests vary each kind
    return dataclasses.replace(ROBUST, landmarks=rules)


def test_detection_follows_the_geometry_of_the_lidar() -> None:
    rules = rules_array(RULES)
    wanted = {0.3: 0.0, 0.522: 0.0, 0.548: 0.45, 1.0: 0.9, 1.433: 0.9, 1.6715: 0.45, 1.95: 0.0}
    for range_m, probability in wanted.items():
        assert detection_probability(range_m, rules) == pytest.approx(probability, abs=1e-6)
    steep = [detection_probability(r, rules_array(STEEP)) for r in (0.573, 0.575, 1.432, 1.434)]
    assert steep == [0.0, 0.9, 0.9, 0.0]


def test_what_is_believed_has_the_benefit_of_the_doubt_and_what_is_not_has_none() -> None:
    def chances(range_m: float, doubt_m: float) -> tuple[float, float]:
        due = np.array([range_m, 0.0, max(doubt_m, 1e-4) ** 2, 0.0, 1e-8])
        return chance_of_sight(due, True, rules), chance_of_sight(due, False, rules)

    rules = rules_array(RULES)
    np.testing.assert_allclose(chances(0.65, 0.0), [0.9, 0.9])
    np.testing.assert_allclose(chances(0.65, 0.08), [0.0, 0.9])
    np.testing.assert_allclose(chances(1.6715, 0.0), [0.0, 0.45], atol=1e-9)
    np.testing.assert_allclose(chances(1.95, 0.0), [0.0, 0.0])
    narrow = rules_array(dataclasses.replace(RULES, field_of_view_rad=1.0))
    for believed in (True, False):
        assert chance_of_sight(np.array([1.0, 0.45, 1e-8, 0.0, 1e-8]), believed, narrow) == 0.9
        assert chance_of_sight(np.array([1.0, 0.45, 1e-8, 0.0, 0.04**2]), believed, narrow) == 0.0


def test_evidence_is_the_likelihood_ratio_against_clutter() -> None:
    rules, noise = rules_array(RULES), noise_array(ROBUST.observation)
    due = np.array([1.2, 0.3, 0.02**2, 1e-4, 0.03**2])
    S = np.array([[due[2], due[3]], [due[3], due[4]]])
    S += np.diag([0.04**2 + (0.05 * 1.25) ** 2, math.radians(1.0) ** 2])
    nu = np.array([0.05, -0.01])
    square = float(nu @ np.linalg.solve(S, nu))
    density = math.exp(-0.5 * square) / (2.0 * math.pi * math.sqrt(np.linalg.det(S)))
    found = gain(log_likelihood(square, due, 1.25, noise), 1.25, rules)
    assert found == pytest.approx(math.log(0.9 * density / RULES.clutter_density_per_m_rad))
    assert loss(0.9, rules) == pytest.approx(math.log(10.0))
    beyond = gain(0.0, 5.0, rules)  # seen all the same: unlikely, not impossible
    assert beyond == pytest.approx(math.log(RULES.false_match_probability / 0.05))


def test_without_a_density_evidence_counts_the_same_wherever_it_is() -> None:
    rules = dataclasses.replace(RULES, clutter_density_per_m_rad=0.0)
    array = rules_array(rules)
    assert gain(3.0, 1.0, array) == gain(-3.0, 9.0, array) == pytest.approx(math.log(0.9 / 0.05))
    assert loss(0.9, array) == pytest.approx(math.log(0.95 / 0.1))
    assert loss(0.01, array) == 0.0  # clutter is missed more often still


def test_clutter_is_given_up_and_never_reported() -> None:
    slam = EkfSlam(ROBUST, "nearest")
    reports = [look(slam, 0, [(1.0, 0.0), (1.0, 2.0)])]
    for t in range(1, 8):
        reports.append(look(slam, t, [(1.0, 0.0)]))
        assert len(slam.estimated_map()) <= 1
    assert sum(r.removed for r in reports) == 1
    assert slam._n == 1
    assert slam.estimated_map().landmarks.ids.tolist() == [1]


def test_belief_takes_sightings_that_agree() -> None:
    """Chance hits between absences say too little, and one at the edge of the gate less."""

    def sightings(offset_m: float, seen: list[bool]) -> tuple[int, float]:
        slam = EkfSlam(ROBUST, "nearest")
        for t, there in enumerate(seen):
            look(slam, t, [(1.0 + offset_m * (t % 2), 0.0)] if there else [])
            if len(slam.estimated_map()):
                return t + 1, 0.0
        return 0, float(slam._records["log_odds"][0])

    assert sightings(0.0, [True] * 10)[0] == 3
    assert sightings(0.0, [True, False, False, True, False, False, False] * 4)[0] == 0
    assert sightings(0.26, [True, True])[1] < sightings(0.0, [True, True])[1] - 3.0


def test_chance_sightings_far_off_never_make_a_landmark() -> None:
    """Beyond the certain range absence says little at once, but not in a hundred scans."""
    slam = EkfSlam(ROBUST, "nearest")
    for t in range(400):
        look(slam, t, [(1.7, 0.0)] if t % 40 == 0 else [])
        assert len(slam.estimated_map()) == 0
    for t in range(400, 440):
        look(slam, t, [(1.7, 0.0)] if t % 2 == 0 else [])
    assert len(slam.estimated_map()) == 1


@pytest.mark.parametrize("association", ["nearest", "jcbb"])
def test_a_ghost_between_two_cones_does_not_keep_them_out_of_the_map(association: str) -> None:
    """Both cones lie in its grey zone: they would be ignored, and excuse it, for ever."""
    slam = EkfSlam(ROBUST, association)
    look(slam, 0, [(1.0, 0.0)])
    for t in range(1, 20):
        look(slam, t, [(1.0, -0.1), (1.0, 0.1)])
    found = np.sort(slam.estimated_map().landmarks.positions[:, 1])
    np.testing.assert_allclose(found, [-0.1, 0.1], atol=0.01)


def test_two_landmarks_nearer_than_cones_can_stand_become_one() -> None:
    """Twins take the sightings of one cone in turns: neither is ever missed for long."""
    for spacing_m, left in ((0.15, 1), (0.0, 2)):
        slam = EkfSlam(with_rules(spacing_m=spacing_m), "nearest")
        look(slam, 0, [(1.0, 0.0), (1.1, 0.0)])
        for t in range(1, 30):
            look(slam, t, [(1.0 + 0.1 * (t % 3 == 0), 0.0)])
        assert slam._n == left
        assert slam._records["n_seen"][0] >= 19


@pytest.mark.parametrize(
    "cone", [(0.4, 1.0), (1.95, 0.0), (0.5, math.pi)], ids=["blind zone", "beyond reach", "astern"]
)
def test_absence_where_nothing_could_be_seen_is_no_evidence(cone: tuple[float, float]) -> None:
    slam = EkfSlam(ROBUST, "nearest")
    for t in range(20):
        look(slam, t, [cone])
    assert len(slam.estimated_map()) == 1
    for t in range(200):
        look(slam, 10 + t, [])
    assert len(slam.estimated_map()) == 1


def test_outside_the_field_of_view_absence_is_no_evidence() -> None:
    for angle, kept in ((1.0, 1), (math.tau, 0)):
        slam = EkfSlam(with_rules(field_of_view_rad=angle, learns_field_of_view=False), "nearest")
        for t in range(10):
            look(slam, t, [(1.0, 0.8)])
        for t in range(20):
            look(slam, 10 + t, [])
        assert slam._n == kept


def test_a_cone_behind_another_may_be_hidden() -> None:
    for radius, kept in ((0.1, 2), (0.0, 1)):
        slam = EkfSlam(with_rules(occluder_radius_m=radius), "nearest")
        for t in range(10):
            look(slam, t, [(0.7, 0.0), (1.3, 0.05)])
        for t in range(20):
            look(slam, 10 + t, [(0.7, 0.0)])
        assert slam._n == kept


def test_an_old_landmark_outlives_a_bounded_number_of_misses() -> None:
    slam = EkfSlam(ROBUST, "nearest")
    for t in range(500):
        look(slam, t, [(1.0, 0.0)])
    misses = 0
    while slam._n:
        look(slam, 500 + misses, [])
        misses += 1
    assert 6 <= misses <= 10


def test_a_place_remembers_when_a_landmark_first_stood_there() -> None:
    slam = EkfSlam(ROBUST, "nearest")
    for t in range(3):
        look(slam, t, [(1.0, 0.0), (1.2, 2.0)] if t == 0 else [(1.2, 2.0)])
    for t in range(3, 10):
        look(slam, t, [(1.2, 2.0)])
    for t in range(20, 40):
        look(slam, t, [(1.05, 0.0), (1.2, 2.0)])
    found = slam.estimated_map()
    assert found.t_added_ns is not None
    assert found.t_first_ns is not None
    by_id = dict(zip(found.landmarks.ids.tolist(), range(len(found)), strict=True))
    assert found.t_added_ns[by_id[3]] == 20
    assert found.t_first_ns[by_id[3]] == 0
    assert found.t_first_ns[by_id[2]] == 0


def test_departed_places_that_coincide_are_one_and_their_number_is_bounded() -> None:
    departed = Departed(0.3)
    for t in (9, 5, 7):
        departed.add(1.0, 0.01 * t, t)
    places, added = np.array([[1.0, 0.0], [3.0, 0.0]]), np.array([8, 8])
    assert departed.first_times(places, added).tolist() == [5, 8]
    assert departed._t_ns.size == 1


def test_removal_moves_place_covariance_and_record_together() -> None:
    slam = EkfSlam(ROBUST, "nearest")
    cones = [(1.0, 0.5 * k) for k in range(6)]
    slam.predict(np.array([[0.2, 0.0, 0.1]]), np.array([0.3]))
    for t in range(12):
        look(slam, t, cones)
    slam.predict(np.array([[0.05, 0.0, 0.02]]), np.array([0.1]))
    before, P = slam._records[:6].copy(), full(slam._P, 15)
    x = slam._x[:15].copy()
    for gone in (1, 3):
        slam._remove(gone)
    # Slot 1 got the last (5), then slot 3 got the last of the rest (4).
    slots = [0, 5, 2, 4]
    columns = [0, 1, 2, *np.ravel([[3 + 2 * s, 4 + 2 * s] for s in slots])]
    np.testing.assert_array_equal(slam._records[:4], before[slots])
    np.testing.assert_array_equal(slam._x[:11], x[columns])
    np.testing.assert_array_equal(full(slam._P, 11), P[np.ix_(columns, columns)])
    due = expectations(slam._x, slam._P, 4)
    assert np.all(np.isfinite(due))
    for t in range(30, 40):
        look(slam, t, cones)
    assert np.all(np.linalg.eigvalsh(full(slam._P, 3 + 2 * slam._n)) > 0)


def test_where_the_sensor_names_its_landmarks_they_stay() -> None:
    slam = EkfSlam(dataclasses.replace(ROBUST, min_seen=1), "known")
    slam.update(0, np.array([7]), np.array([1.0]), np.array([0.0]))
    for t in range(50):
        slam.update(1 + t, np.array([8]), np.array([1.0]), np.array([2.0]))
    assert slam.estimated_map().landmarks.ids.tolist() == [7, 8]


@pytest.mark.parametrize("association", ["known", "nearest", "jcbb"])
def test_what_is_no_observation_is_left_out_and_counted(association: str) -> None:
    slam, clean = EkfSlam(ROBUST, association), EkfSlam(ROBUST, association)
    bad: Floats = np.array([np.nan, np.inf, -1.0, 0.0, 1.0, 1.0, 1.2])
    bearings = np.array([0.0, 0.0, 0.0, 0.0, np.nan, np.inf, 0.4])
    ids = np.arange(7)
    for t in range(4):
        assert slam.update(t, ids, bad, bearings).invalid == 6
        clean.update(t, ids[6:], bad[6:], bearings[6:])
    np.testing.assert_array_equal(slam._x[:5], clean._x[:5])
    np.testing.assert_array_equal(slam._P, clean._P)


@pytest.mark.parametrize("association", ["known", "nearest", "jcbb"])
@pytest.mark.parametrize("preset", ["thesis", "robust"])
def test_ten_thousand_clutter_points_leave_time_and_map_bounded(
    preset: str, association: str
) -> None:
    random = np.random.default_rng(0)
    rules = dataclasses.replace(PRESETS[preset].landmarks, max_landmarks=300)
    config = dataclasses.replace(PRESETS[preset], landmarks=rules)
    slam = EkfSlam(config, association)
    total = UpdateReport()
    for t in range(4):
        slam.predict(np.array([[0.05, 0.0, 0.01]]), np.array([0.1]))
        ranges, bearings = random.uniform(0.1, 5.0, 10_000), random.uniform(-3.1, 3.1, 10_000)
        total += slam.update(t, np.arange(10_000) + 10_000 * t, ranges, bearings)
    assert slam._n <= 300
    counted = total.matched + total.added + total.ignored + total.rejected + total.over_limit
    assert counted == 40_000
    assert total.over_limit >= 4 * (10_000 - config.max_observations)


@pytest.mark.parametrize("filter_", ["nearest", "jcbb", "fastslam"])
@pytest.mark.parametrize("name", ["turn", "s-curve", "loop"])
def test_among_clutter_the_map_is_right(name: str, filter_: str) -> None:
    """Some of benchmarks/slam_accuracy.py, with a tenth of clutter."""

    def slam(seed: int) -> Slam:
        if filter_ == "fastslam":
            return FastSlam(FASTSLAM_PRESETS["robust"], "likelihood", seed)
        return EkfSlam(ROBUST, filter_)

    drives = [world.drive(name, seed, world.Noise(clutter=0.1)) for seed in range(4)]
    found = [world.run(slam(seed), drive) for seed, drive in enumerate(drives)]
    assert [(f.false_negatives, f.false_positives) for f in found] == [(0, 0)] * 4
    assert np.mean([f.position_m for f in found]) <= (0.03 if filter_ == "fastslam" else 0.025)


def test_as_the_thesis_had_it_the_same_drive_leaves_many_false_landmarks() -> None:
    found = world.run(EkfSlam(PRESETS["thesis"], "nearest"), world.drive("turn", 0))
    assert found.false_positives >= 10


def test_rules_off_are_the_default() -> None:
    assert PRESETS["thesis"].landmarks == LandmarkRules()
