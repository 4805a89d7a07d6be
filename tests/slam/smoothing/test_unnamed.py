from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from smoothing_world import CONFIG, World, world

from capture import Estimate, EstimatedMap, Observations
from geometry import Floats, LandmarkMap
from slam.errors import SlamError
from slam.observation import noise_array
from slam.smoothing import assignment
from slam.smoothing.config import UnnamedConfig
from slam.smoothing.hypothesis import Evidence, log_likelihood, smoothed
from slam.smoothing.unnamed import possible_ties, smooth_unnamed

UNNAMED = UnnamedConfig(smoothing=replace(CONFIG, loss="cauchy"))


def without_names(drive: World) -> Observations:
    return replace(drive.observations, landmark_id=np.full(drive.ids.size, -1))


def with_landmarks(estimate: Estimate, positions: Floats) -> Estimate:
    n = len(positions)
    return replace(
        estimate,
        map=EstimatedMap(
            LandmarkMap(np.arange(n) + 1, positions, np.tile(np.eye(2), (n, 1, 1))),
            t_added_ns=np.full(n, estimate.path.t_ns[0]),
            added_from=np.zeros((n, 2)),
            range_added_m=np.ones(n),
            n_seen=np.ones(n, dtype=np.int64),
            t_first_ns=np.full(n, estimate.path.t_ns[0]),
        ),
    )


def pairs_within(found: Estimate, landmarks: Floats, limit_m: float) -> int:
    assert found.map is not None
    offset = found.map.landmarks.positions[:, None] - landmarks[None]
    return int(np.sum(np.hypot(offset[..., 0], offset[..., 1]).min(axis=0) < limit_m))


@pytest.mark.parametrize("seed", range(3))
def test_without_names_it_ends_where_the_names_would_have_led(seed: int) -> None:
    drive = world(seed, duration_s=60.0)
    found = smooth_unnamed(drive.estimate, drive.odometry, without_names(drive), UNNAMED)
    assert found.map is not None
    assert len(found.map) == len(drive.landmarks)
    assert pairs_within(found, drive.landmarks, 0.15) == len(drive.landmarks)
    named = drive.smoothed(UNNAMED.smoothing)
    assert drive.path_error_m(found) <= 1.2 * drive.path_error_m(named) + 0.005
    assert drive.path_error_m(found) < drive.path_error_m(drive.estimate)


def test_a_map_that_stands_there_twice_becomes_one() -> None:
    drive = world(1, duration_s=60.0)
    copies = np.concatenate([drive.landmarks, drive.landmarks + np.array([0.5, -0.4])])
    start = with_landmarks(drive.estimate, copies)
    found = smooth_unnamed(start, drive.odometry, without_names(drive), UNNAMED)
    assert len(found.map or ()) == len(drive.landmarks)
    assert pairs_within(found, drive.landmarks, 0.15) == len(drive.landmarks)


def test_landmarks_that_the_filter_never_had_are_found_and_ghosts_go() -> None:
    drive = world(2, duration_s=60.0)
    ghosts = np.array([[9.0, 9.0], [-7.0, 3.0]])
    start = with_landmarks(drive.estimate, np.concatenate([drive.landmarks[:3], ghosts]))
    found = smooth_unnamed(start, drive.odometry, without_names(drive), UNNAMED)
    assert len(found.map or ()) == len(drive.landmarks)
    assert pairs_within(found, drive.landmarks, 0.15) == len(drive.landmarks)


def test_what_is_no_observation_and_what_is_clutter_changes_nothing() -> None:
    drive = world(0, duration_s=60.0)
    clean = without_names(drive)
    wrong = Observations(
        np.repeat(clean.t_ns[[5, 9, 9, 40]], 1), np.full(4, -1),
        np.array([np.nan, -1.0, 2.0, np.inf]), np.array([0.1, 0.2, np.nan, 0.0]),
    )  # fmt: skip
    order = np.argsort(np.concatenate([clean.t_ns, wrong.t_ns]), kind="stable")
    both = Observations(*(
        np.concatenate([getattr(clean, name), getattr(wrong, name)])[order]
        for name in ("t_ns", "landmark_id", "range_m", "bearing_rad")
    ))  # fmt: skip
    one = smooth_unnamed(drive.estimate, drive.odometry, clean, UNNAMED)
    other = smooth_unnamed(drive.estimate, drive.odometry, both, UNNAMED)
    np.testing.assert_array_equal(one.path.poses, other.path.poses)


def test_the_history_of_a_landmark_is_that_of_its_first_sighting() -> None:
    drive = world(0, duration_s=60.0)
    found = smooth_unnamed(drive.estimate, drive.odometry, without_names(drive), UNNAMED)
    made = found.map
    assert made is not None
    assert made.t_added_ns is not None
    assert made.n_seen is not None
    assert made.range_added_m is not None
    offset = made.landmarks.positions[:, None] - drive.landmarks[None]
    of = np.hypot(offset[..., 0], offset[..., 1]).argmin(axis=1) + 1
    for row, name in enumerate(of.tolist()):
        seen = np.flatnonzero(drive.ids == name)
        assert made.t_added_ns[row] == drive.observations.t_ns[seen[0]]
        assert made.range_added_m[row] == drive.observations.range_m[seen[0]]
        assert abs(int(made.n_seen[row]) - seen.size) <= 0.02 * seen.size + 1


def test_the_true_map_is_likelier_than_one_too_many_or_one_too_few() -> None:
    drive = world(0, duration_s=60.0)
    evidence = Evidence.of(drive.estimate.path, drive.odometry, without_names(drive), UNNAMED)
    named = drive.smoothed(UNNAMED.smoothing)

    def likelihood(landmarks: Floats) -> float:
        worth = evidence.worths(named.path, landmarks, 0.5, 2.0)
        slots = assignment.assign_all(worth, evidence.starts)
        return log_likelihood(evidence, smoothed(evidence, named, landmarks, slots, 0.5))

    right = likelihood(drive.landmarks)
    twin = np.concatenate([drive.landmarks, drive.landmarks[:1] + 0.05])
    assert right > likelihood(drive.landmarks[1:]) + 10.0
    assert right > likelihood(twin) + 10.0


def test_landmarks_that_were_seen_together_are_never_tied() -> None:
    drive = world(0, duration_s=60.0)
    evidence = Evidence.of(drive.estimate.path, drive.odometry, without_names(drive), UNNAMED)
    slots = drive.ids - 1
    best = smoothed(evidence, drive.estimate, drive.landmarks, slots, 0.5)
    together = assignment.seen_together(slots, evidence.starts, len(drive.landmarks))
    for tie in possible_ties(evidence, best):
        assert all(together[pair] <= 1 + 0.03 * slots.size for pair in tie)


def test_each_landmark_is_seen_once_a_scan_and_the_worthiest_pair_comes_first() -> None:
    worth = np.array([[3.0, 5.0], [4.0, 6.0], [-1.0, np.nan]])
    slots = np.empty(3, dtype=np.int64)
    assert assignment.assign(worth, 0, 3, -1, slots) == 9.0
    assert slots.tolist() == [0, 1, -1]
    assert assignment.assign(worth, 0, 3, 1, slots) == 4.0
    assert slots.tolist() == [-1, 0, -1]
    starts = np.array([0, 3])
    need = assignment.needs(worth, starts, assignment.assign_all(worth, starts))
    assert need.tolist() == [9.0 - 6.0, 9.0 - 4.0]


def test_a_worth_is_the_density_with_heavy_tails() -> None:
    noise = noise_array(CONFIG.observation)
    pose, cone = np.array([[0.0, 0.0, 0.5]]), np.array([[2.0, 0.0]])
    found = assignment.worths(pose, cone, np.array([2.03]), np.array([-0.5]), noise, 1.5, 2.0)
    peak = 1.5 - np.log(2.0 * np.pi * 0.03 * 0.02)
    assert found[0, 0] == pytest.approx(peak - 2.0 * np.log1p(0.25))


def test_an_estimate_without_landmarks_is_refused() -> None:
    drive = world(0)
    with pytest.raises(SlamError, match="has no landmarks"):
        smooth_unnamed(replace(drive.estimate, map=None), drive.odometry, drive.observations)
