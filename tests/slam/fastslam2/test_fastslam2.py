from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from geometry import Floats, compose, wrap
from slam.config import MotionNoise, ObservationNoise
from slam.fastslam.config import FASTSLAM_PRESETS
from slam.fastslam.scan import new_scratch
from slam.fastslam2.filter import FASTSLAM2_PRESETS, FastSlam2
from slam.fastslam2.kernels import propose, root_in_place

SIGMA_M, SIGMA_RAD = 0.04, 0.02
CONFIG = dataclasses.replace(
    FASTSLAM2_PRESETS["robust"],
    particles=1,
    motion=MotionNoise(xy_sigma_m_per_sqrt_s=0.1, heading_sigma_rad_per_sqrt_s=0.1),
    observation=ObservationNoise(range_sigma_m=SIGMA_M, bearing_sigma_rad=SIGMA_RAD),
    tail_gate=1e9,
    innovation_gate=1e9,
)
SPREAD = np.array([[0.02, 0.003, 0.001], [0.003, 0.01, 0.002], [0.001, 0.002, 0.005]])
MOTION = np.array([0.5, 0.1, 0.2])


def turn(angle: float) -> Floats:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def seen(pose: Floats, landmarks: Floats) -> tuple[Floats, Floats]:
    dx, dy = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    return np.hypot(dx, dy), wrap(np.arctan2(dy, dx) - pose[2])


def mapped(landmarks: Floats, association: str = "known") -> FastSlam2:
    """A particle at the origin that has mapped these without having moved."""
    slam = FastSlam2(CONFIG, association)
    slam.update(0, np.arange(len(landmarks)), *seen(np.zeros(3), landmarks))
    return slam


def proposed(slam: FastSlam2, range_m: Floats, bearing_rad: Floats) -> tuple[Floats, Floats, float]:
    """Mean and covariance of the particle's proposal, and by how much its log weight grew."""
    m, known = range_m.size, slam.association == "known"
    scan = slam._scan(range_m, bearing_rad)
    roots = np.empty((1, 3, 3))
    before = float(slam._cloud.log_weight[0])
    propose(
        slam._cloud, MOTION, SPREAD, scan, slam._rules(scan), np.arange(m, dtype=np.int32), known,
        new_scratch(m, 32), roots,
    )  # fmt: skip
    cloud = slam._cloud
    mean = np.array([cloud.x[0], cloud.y[0], cloud.heading[0]])
    return mean, roots[0] @ roots[0].T, float(cloud.log_weight[0]) - before


@pytest.mark.parametrize("association", ["known", "likelihood"])
def test_the_proposal_is_the_posterior_of_the_pose_and_its_weight_the_evidence(
    association: str,
) -> None:
    """One sighting against the Kalman filter in dense matrices."""
    landmark = np.array([[1.5, 0.4]])
    slam = mapped(landmark, association)
    xx, xy, yy = slam._cloud.covariance[0, 0]
    predicted = compose(np.zeros(3), MOTION)
    range_m, bearing = seen(predicted + np.array([0.05, -0.03, 0.04]), landmark)
    east, north = (
        range_m[0] * turn(predicted[2]) @ np.array([np.cos(bearing[0]), np.sin(bearing[0])])
    )
    moves = np.array([[1.0, 0.0, -north], [0.0, 1.0, east]])
    line = turn(predicted[2] + bearing[0])
    R = line @ np.diag([SIGMA_M**2, (range_m[0] * SIGMA_RAD) ** 2]) @ line.T
    S = moves @ SPREAD @ moves.T + np.array([[xx, xy], [xy, yy]]) + R
    nu = landmark[0] - predicted[:2] - np.array([east, north])
    K = SPREAD @ moves.T @ np.linalg.inv(S)
    mean, covariance, gain = proposed(slam, range_m, bearing)
    np.testing.assert_allclose(mean, predicted + K @ nu, atol=1e-9)
    np.testing.assert_allclose(covariance, SPREAD - K @ moves @ SPREAD, atol=1e-9)
    density = np.exp(-0.5 * nu @ np.linalg.solve(S, nu)) / (2 * np.pi * np.sqrt(np.linalg.det(S)))
    assert gain == pytest.approx(np.log(density * range_m[0]), abs=1e-9)  # per metre and radian


def test_what_is_seen_together_weighs_the_same_in_any_order() -> None:
    landmarks = np.array([[1.5, 0.4], [1.0, -0.8], [-0.5, 1.2]])
    range_m, bearing = seen(compose(np.zeros(3), MOTION) + 0.01, landmarks)
    one = proposed(mapped(landmarks), range_m, bearing)
    other = proposed(mapped(landmarks[::-1]), range_m[::-1], bearing[::-1])
    np.testing.assert_allclose(one[0], other[0], atol=2e-3)  # each is linearised anew
    np.testing.assert_allclose(one[1], other[1], atol=2e-4)
    assert one[2] == pytest.approx(other[2], abs=0.1)


def test_a_root_may_be_singular() -> None:
    random = np.random.default_rng(1).normal(size=(3, 3))
    for P in (random @ random.T, np.zeros((3, 3)), np.diag([0.0, 2.0, 0.0]), np.ones((3, 3))):
        root = P.copy()
        root_in_place(root)
        np.testing.assert_allclose(root @ root.T, P, atol=1e-12)
        assert not np.triu(root, 1).any()


def test_the_covariance_of_a_proposal_goes_with_its_particle() -> None:
    slam = FastSlam2(dataclasses.replace(CONFIG, particles=200), "known")
    random = np.random.default_rng(2)
    slam._cloud.x[:] = np.arange(200.0)
    slam._cloud.log_weight[:] = random.normal(0.0, 3.0, 200)
    roots = np.arange(200.0)[:, None, None] * np.eye(3)
    after = slam._resampled(roots)
    assert np.unique(slam._cloud.x).size < 100
    np.testing.assert_array_equal(after[:, 0, 0], slam._cloud.x)


def test_copies_of_a_particle_draw_poses_of_their_own() -> None:
    slam = FastSlam2(dataclasses.replace(CONFIG, particles=50), "known")
    slam.update(0, np.array([1]), np.array([1.5]), np.array([0.2]))
    slam._cloud.log_weight[:] = -1e3
    slam._cloud.log_weight[7] = 0.0  # all will be copies of this one
    slam.predict(MOTION[None], np.array([0.1]))
    slam.update(1, np.array([1]), np.array([1.0]), np.array([0.1]))
    assert np.unique(slam._cloud.x).size == 50
    np.testing.assert_array_equal(slam._cloud.log_weight, np.zeros(50))


def test_between_scans_nothing_is_drawn() -> None:
    one, other = (FastSlam2(FASTSLAM2_PRESETS["robust"], "known", seed=4) for _ in range(2))
    steps = np.tile([0.01, 0.0, 0.002], (20, 1))
    poses, covariances = one.predict(steps, np.full(20, 0.01))
    for k in range(20):
        other.predict(steps[k : k + 1], np.full(1, 0.01))
    np.testing.assert_allclose(one.pose, poses[-1])
    np.testing.assert_allclose(one.pose_covariance, covariances[-1])
    for slam in (one, other):
        slam.update(1, np.array([3]), np.array([1.0]), np.array([0.5]))
    np.testing.assert_allclose(one._cloud.x, other._cloud.x, atol=1e-12)
    spread = np.cov(np.stack([one._cloud.x, one._cloud.y, one._cloud.heading]))
    assert np.sqrt(np.diag(spread)) == pytest.approx(np.sqrt(np.diag(covariances[-1])), rel=0.3)


def test_the_preset_has_a_fifth_of_the_particles_of_fastslam_1() -> None:
    assert FASTSLAM2_PRESETS["robust"].particles * 5 == FASTSLAM_PRESETS["robust"].particles
