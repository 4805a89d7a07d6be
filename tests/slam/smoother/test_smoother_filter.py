from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from capture import Observations, Odometry
from geometry import Floats, compose, wrap
from slam.config import PRESETS
from slam.errors import SlamError
from slam.gaussian.filter import UkfSlam
from slam.run import run_slam
from slam.smoother import filter as smoother
from slam.smoother.config import SMOOTHER_PRESETS, SmootherConfig
from slam.smoother.filter import SmootherSlam, joint_covariance
from slam.smoother.history import History
from slam.smoothing.kernels import linearise
from slam.smoothing.smoother import smooth

CONFIG = SMOOTHER_PRESETS["robust"]
EVERY_SCAN = dataclasses.replace(CONFIG, solve_every=1, solve_growth=0.0, max_iterations=100)
CONES = np.array([[1.0, 1.0], [2.0, -1.0], [-1.0, 0.5], [0.5, 2.5], [3.0, 1.0]])
DT_S = 0.1


def drive(scans: int, seed: int = 0) -> tuple[Odometry, Observations]:
    """A bent drive past five cones, all seen in every scan, with some noise."""
    random = np.random.default_rng(seed)
    truth, driven = np.zeros((scans + 1, 3)), np.zeros((scans + 1, 3))
    step = np.array([0.1, 0.0, 0.05])
    for k in range(scans):
        truth[k + 1] = compose(truth[k], step)
        noisy = step + random.normal(0.0, [0.01, 0.01, 0.01])
        driven[k + 1] = compose(driven[k], noisy)
    t_ns = np.arange(scans + 1) * round(DT_S * 1e9)
    offset = CONES[None] - truth[1:, None, :2]
    ranges = np.hypot(offset[..., 0], offset[..., 1])
    bearings = np.arctan2(offset[..., 1], offset[..., 0]) - truth[1:, None, 2]
    shape = ranges.shape
    return Odometry("wheel", t_ns, driven, np.zeros(scans + 1), np.zeros(scans + 1)), Observations(
        np.repeat(t_ns[1:], 5),
        np.tile(np.arange(5), scans),
        (ranges + random.normal(0.0, 0.03, shape)).ravel(),
        wrap(bearings + random.normal(0.0, 0.01, shape)).ravel(),
    )


def stepped(slam: SmootherSlam, scans: int) -> SmootherSlam:
    odometry, seen = drive(scans)
    run_slam(slam, odometry, seen, name="smoother")
    return slam


def test_solved_at_the_last_scan_it_is_what_the_final_pass_gives() -> None:
    odometry, seen = drive(30)
    slam = SmootherSlam(EVERY_SCAN, "known")
    estimate, _ = run_slam(slam, odometry, seen, name="smoother")
    wanted = smooth(estimate, odometry, seen, seen.landmark_id, EVERY_SCAN.smoothing())
    assert wanted.map is not None
    assert wanted.path_covariances is not None
    assert wanted.map.landmarks.covariances is not None
    found = slam.estimated_map().landmarks
    np.testing.assert_allclose(slam.pose, wanted.path.poses[-1], atol=2e-4)
    np.testing.assert_allclose(found.positions, wanted.map.landmarks.positions, atol=2e-4)
    assert found.covariances is not None
    np.testing.assert_allclose(found.covariances, wanted.map.landmarks.covariances, rtol=0.02)
    np.testing.assert_allclose(
        slam.pose_covariance, wanted.path_covariances[-1], rtol=0.02, atol=1e-7
    )


def test_the_joint_covariance_is_that_of_the_dense_normal_equations() -> None:
    slam = stepped(SmootherSlam(EVERY_SCAN, "known"), 12)
    factors, _ = slam._history.factors(np.arange(5), CONFIG.observation, "none", 1.0)
    normal = linearise(slam._history.poses, slam._x[3:13].reshape(-1, 2), factors)
    nodes = normal.diagonal.shape[0]
    whole = np.zeros((3 * nodes + 10, 3 * nodes + 10))
    for k in range(nodes):
        at = slice(3 * k, 3 * k + 3)
        whole[at, at] = normal.diagonal[k]
        if k > 0:
            whole[at, 3 * k - 3 : 3 * k] = normal.below[k]
            whole[3 * k - 3 : 3 * k, at] = normal.below[k].T
    for i in range(factors.node.size):
        rows = slice(3 * factors.node[i], 3 * factors.node[i] + 3)
        columns = slice(3 * nodes + 2 * factors.slot[i], 3 * nodes + 2 * factors.slot[i] + 2)
        whole[rows, columns] += normal.mixed[i]
        whole[columns, rows] += normal.mixed[i].T
    for j in range(5):
        at = slice(3 * nodes + 2 * j, 3 * nodes + 2 * j + 2)
        whole[at, at] = normal.landmark[j]
    wanted = np.linalg.inv(whole)[3 * nodes - 3 :, 3 * nodes - 3 :]
    np.testing.assert_allclose(joint_covariance(normal, factors), wanted, rtol=1e-6, atol=1e-12)
    with pytest.raises(SlamError, match=r"do not determine 5 landmarks.*noise"):
        joint_covariance(normal._replace(landmark=np.zeros((5, 2, 2))), factors)


def test_solutions_become_rarer_so_that_a_long_drive_costs_no_more_a_scan(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    solved: list[int] = []
    plain = SmootherSlam._solve

    def counted(slam: SmootherSlam) -> None:
        solved.append(slam._scans)
        plain(slam)

    monkeypatch.setattr(SmootherSlam, "_solve", counted)
    stepped(SmootherSlam(dataclasses.replace(CONFIG, solve_every=5, solve_growth=0.5), "known"), 80)
    assert solved == [5, 10, 15, 23, 35, 53, 80]


def test_between_solutions_the_pose_is_that_of_the_last_one_driven_on() -> None:
    slam = stepped(SmootherSlam(EVERY_SCAN, "known"), 10)
    last, step = slam.pose, np.array([0.3, -0.1, 0.2])
    poses, _ = slam.predict(step[None], np.array([DT_S]))
    np.testing.assert_allclose(poses[-1], compose(last, step))
    np.testing.assert_allclose(slam.pose, poses[-1])


def test_it_takes_back_what_a_filter_cannot() -> None:
    """One misread name among the first sightings bends a filter for good."""
    odometry, seen = drive(60)
    ids = seen.landmark_id.copy()
    ids[[3, 4]] = ids[[4, 3]]  # both then enter the map where the other is
    mistaken = dataclasses.replace(seen, landmark_id=ids)
    ahead = dataclasses.replace(PRESETS["robust"], innovation_gate=1e9, relocate_after=0)
    whole = dataclasses.replace(CONFIG, innovation_gate=1e9, relocate_after=0)
    off = []
    for slam in (UkfSlam(ahead, "known"), SmootherSlam(whole, "known")):
        run_slam(slam, odometry, mistaken, name="x")
        landmarks = slam.estimated_map().landmarks
        off.append(np.hypot(*(landmarks.positions - CONES[landmarks.ids]).T).max())
    assert off[0] > 0.3
    assert off[1] < 0.1


def test_sightings_of_a_landmark_given_up_are_forgotten() -> None:
    history = History(np.zeros(7))
    moved, dt = np.array([[0.1, 0.0, 0.0]]), np.array([0.1])
    for k in range(3):
        history.drive(moved, dt)
        names = np.array([7, -1, 3]) if k else np.array([9, 7])
        m = names.size
        assert history.see(np.array([0.1 * k, 0.0, 0.0]), names, np.ones(m), np.zeros(m))
    history.drive(moved, dt)
    assert not history.see(np.zeros(3), np.array([-1]), np.ones(1), np.zeros(1))
    history.drive(moved, dt)
    assert history.see(np.zeros(3), np.array([3]), np.ones(1), np.zeros(1))
    factors, order = history.factors(np.array([3, 7]), CONFIG.observation, "huber", 2.0)
    assert order.tolist() == [7, 3]
    assert factors.node.tolist() == [1, 2, 2, 3, 3, 4]
    assert factors.slot.tolist() == [0, 0, 1, 0, 1, 1]
    np.testing.assert_allclose(factors.motion[3], [0.2, 0.0, 0.0])  # two motions, one pose
    assert len(history.poses) == 5


def test_the_presets_are_those_of_the_filter_that_runs_ahead() -> None:
    assert isinstance(CONFIG, SmootherConfig)
    for field in dataclasses.fields(PRESETS["robust"]):
        assert getattr(CONFIG, field.name) == getattr(PRESETS["robust"], field.name)
    assert CONFIG.smoothing().motion == CONFIG.motion
    assert smoother.SMOOTHER.associations == ("known", "nearest")
    poses: Floats = History(np.zeros(7)).poses
    assert poses.shape == (1, 3)
