from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from laps import CONES, CONFIG, DT_S, lap, pose_nees, seen_from, with_heading_noise

from geometry import Floats, wrap
from slam.ekf import EkfSlam
from slam.gaussian.filter import FejSlam, GaussianSlam, UkfSlam

FIVE_DEGREES = np.radians(5.0)
R = np.diag([0.04**2, 0.02**2])


def driven(slam: EkfSlam, config_seed: int = 0, scans: int = 40) -> EkfSlam:
    for k, (_, measured, ids, ranges, bearings) in enumerate(
        lap(slam.config.motion, config_seed, scans)
    ):
        slam.predict(measured[None], np.array([DT_S]))
        slam.update(k, ids, ranges, bearings)
    return slam


def state(slam: EkfSlam) -> tuple[Floats, Floats]:
    dimension = 3 + 2 * slam._n
    lower = np.tril(slam._P[:dimension, :dimension])
    return slam._x[:dimension].copy(), lower + np.tril(lower, -1).T


def derivatives(at: Floats, columns: list[int]) -> Floats:
    """(2m, n) of range and bearing of the landmarks at these columns of the state."""
    H = np.zeros((2 * len(columns), at.size))
    for i, j in enumerate(columns):
        dx, dy = at[j : j + 2] - at[:2]
        q = dx * dx + dy * dy
        place = np.array([[dx / np.sqrt(q), dy / np.sqrt(q)], [-dy / q, dx / q]])
        H[2 * i : 2 * i + 2, j : j + 2], H[2 * i : 2 * i + 2, :2] = place, -place
        H[2 * i + 1, 2] = -1.0
    return H


def textbook_fej(seed: int, scans: int) -> tuple[Floats, Floats]:
    """EKF with first-estimate Jacobians in dense matrices; covariance before the next prediction.

    Huang, Mourikis, Roumeliotis 2010: the pose derivative of a prediction runs from the *predicted*
    pose before to the one after, that of an observation is taken at the predicted pose and at where
    the landmark entered the map.
    """
    config = with_heading_noise(FIVE_DEGREES)
    x, P, predicted = np.zeros(3), np.zeros((3, 3)), np.zeros(3)
    first, columns = np.zeros(3), dict[int, int]()
    sigma = np.array([0.02, 0.02, config.motion.heading_sigma_rad_per_sqrt_s])
    for _, u, ids, ranges, bearings in lap(config.motion, seed, scans):
        cos, sin = np.cos(x[2]), np.sin(x[2])
        x = x.copy()
        x[:3] += [cos * u[0] - sin * u[1], sin * u[0] + cos * u[1], u[2]]
        F = np.eye(x.size)
        F[0, 2], F[1, 2] = -(x[1] - predicted[1]), x[0] - predicted[0]
        P = F @ P @ F.T
        P[:3, :3] += np.diag(sigma**2) * DT_S
        predicted = x[:3].copy()
        old = [i for i in range(ids.size) if int(ids[i]) in columns]
        if old:
            at = [columns[int(ids[i])] for i in old]
            H = derivatives(np.concatenate([predicted, first[3:]]), at)
            expected = np.array([seen_from(x[:3], x[j : j + 2][None]) for j in at]).ravel()
            nu = np.stack([ranges[old], bearings[old]], axis=1).ravel() - expected
            nu[1::2] = wrap(nu[1::2])
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.kron(np.eye(len(old)), R))
            x, P = x + K @ nu, (np.eye(x.size) - K @ H) @ P
        for i in set(range(ids.size)) - set(old):
            columns[int(ids[i])] = x.size
            direction = x[2] + bearings[i]
            place = x[:2] + ranges[i] * np.array([np.cos(direction), np.sin(direction)])
            grow = np.zeros((2, x.size))
            grow[:, :2] = np.eye(2)
            grow[:, 2] = [-(place[1] - predicted[1]), place[0] - predicted[0]]
            turn = np.array([[np.cos(direction), -np.sin(direction)],
                             [np.sin(direction), np.cos(direction)]])  # fmt: skip
            own = turn @ np.diag([0.04**2, (ranges[i] * 0.02) ** 2]) @ turn.T
            P = np.block([[P, P @ grow.T], [grow @ P, grow @ P @ grow.T + own]])
            x, first = np.concatenate([x, place]), np.concatenate([first, place])
    shear = np.eye(x.size)
    shear[0, 2], shear[1, 2] = -(x[1] - predicted[1]), x[0] - predicted[0]
    return x, shear @ P @ shear.T


def test_first_estimate_jacobians_are_those_of_the_dense_textbook_form() -> None:
    slam = driven(FejSlam(with_heading_noise(FIVE_DEGREES), "known"), 3, 60)
    wanted_x, wanted = textbook_fej(3, 60)
    x, P = state(slam)
    wanted_x[2] = wrap(wanted_x[2])
    np.testing.assert_allclose(x, wanted_x, atol=1e-7)
    np.testing.assert_allclose(P, wanted, atol=1e-7)


def turned(slam: EkfSlam, sigma_rad: float) -> EkfSlam:
    """A lap of a car that does not know how it stood when it started."""
    slam._P[2, 2] = sigma_rad**2
    return driven(slam)


def test_no_observation_tells_how_the_map_is_turned() -> None:
    """Turning car and map about the start is unobservable: that doubt must stay what it was.

    In a linear system with an unobservable direction N, doubt s along N adds s^2 N N^T to the
    covariance for ever and changes no estimate.
    """
    config = with_heading_noise(FIVE_DEGREES)
    sure, unsure = FejSlam(config, "known"), turned(FejSlam(config, "known"), 0.5)
    driven(sure)
    (x, P), (x_unsure, doubtful) = state(sure), state(unsure)
    np.testing.assert_allclose(x, x_unsure, atol=1e-8)
    direction = np.zeros(x.size)
    first = np.concatenate([x[:3], sure._first[3 : x.size]])
    direction[0], direction[1], direction[2] = -x[1], x[0], 1.0
    direction[3::2], direction[4::2] = -first[4::2], first[3::2]
    np.testing.assert_allclose(doubtful - P, 0.25 * np.outer(direction, direction), atol=1e-7)


def test_the_plain_ekf_believes_to_learn_how_the_map_is_turned() -> None:
    config = with_heading_noise(FIVE_DEGREES)
    sigma = {
        kind: np.sqrt(turned(kind(config, "known"), 0.5).pose_covariance[2, 2])
        for kind in (EkfSlam, FejSlam, UkfSlam)
    }
    assert sigma[EkfSlam] < 0.4
    assert min(sigma[FejSlam], sigma[UkfSlam]) > 0.5


def test_nor_do_sigma_points_let_the_map_be_turned_by_what_is_seen() -> None:
    """The heading's own doubt is never below what it was, whatever else is learnt."""
    config = with_heading_noise(FIVE_DEGREES)
    sure, unsure = UkfSlam(config, "known"), turned(UkfSlam(config, "known"), 0.5)
    driven(sure)
    (x, P), (x_unsure, doubtful) = state(sure), state(unsure)
    np.testing.assert_allclose(x, x_unsure, atol=1e-8)
    direction = np.zeros(x.size)
    direction[0], direction[1], direction[2] = -x[1], x[0], 1.0
    direction[3::2], direction[4::2] = -x[4::2], x[3::2]
    np.testing.assert_allclose(doubtful - P, 0.25 * np.outer(direction, direction), atol=1e-7)


@pytest.mark.parametrize("kind", [FejSlam, UkfSlam])
def test_where_nothing_bends_each_is_the_ekf(kind: type[GaussianSlam]) -> None:
    small = dataclasses.replace(
        CONFIG,
        motion=dataclasses.replace(
            CONFIG.motion, xy_sigma_m_per_sqrt_s=1e-4, heading_sigma_rad_per_sqrt_s=1e-4
        ),
        observation=dataclasses.replace(
            CONFIG.observation, range_sigma_m=1e-4, bearing_sigma_rad=1e-4
        ),
    )
    filters = EkfSlam(small, "known"), kind(small, "known")
    truth = np.zeros(3)
    random = np.random.default_rng(8)
    for k, (truth, measured, ids, _, _) in enumerate(lap(small.motion, 1, 100)):
        ranges, bearings = seen_from(truth, CONES[ids])
        ranges = ranges + random.normal(0.0, 1e-4, ids.size)
        bearings = bearings + random.normal(0.0, 1e-4, ids.size)
        for slam in filters:
            slam.predict(measured[None], np.array([DT_S]))
            slam.update(k, ids, ranges, bearings)
    (x, P), (bent_x, bent) = state(filters[0]), state(filters[1])
    sigma = np.sqrt(np.diag(P))
    np.testing.assert_allclose(bent_x / sigma, x / sigma, atol=0.01)
    np.testing.assert_allclose((bent - P) / np.outer(sigma, sigma), 0.0, atol=0.02)


@pytest.mark.parametrize("kind", [FejSlam, UkfSlam])
def test_a_landmark_given_up_leaves_the_others_as_they_are(kind: type[GaussianSlam]) -> None:
    slam = kind(with_heading_noise(FIVE_DEGREES), "known", capacity=2)
    driven(slam)
    ids = slam._records["landmark_id"][: slam._n].tolist()
    before = slam._sights()
    P = state(slam)[1]
    slam._remove(1)
    rows = [0, len(ids) - 1, *range(2, len(ids) - 1)]  # the last moved into the gap
    np.testing.assert_allclose(slam._sights(), before[rows], atol=1e-12)
    columns = np.concatenate([[0, 1, 2], *([3 + 2 * r, 4 + 2 * r] for r in rows)])
    np.testing.assert_allclose(state(slam)[1], P[np.ix_(columns, columns)], atol=1e-15)


@pytest.mark.parametrize("kind", [FejSlam, UkfSlam])
def test_a_contradicted_landmark_is_placed_anew(kind: type[GaussianSlam]) -> None:
    config = dataclasses.replace(CONFIG, innovation_gate=50.0, relocate_after=3)
    slam = kind(config, "known")
    driven(slam)
    name = int(slam._records["landmark_id"][0])
    moved_to = slam.pose[:2] + np.array([[-3.0, -3.0]])
    reports = [
        slam.update(100 + t, np.array([name]), *seen_from(slam.pose, moved_to)) for t in range(3)
    ]
    assert [report.rejected for report in reports] == [1, 1, 1]
    made = slam.estimated_map()
    row = made.landmarks.ids.tolist().index(name)
    np.testing.assert_allclose(made.landmarks.positions[row], moved_to[0], atol=0.02)
    assert made.t_added_ns is not None
    assert made.t_added_ns[row] == 102
    assert slam._sights()[0, 2] == pytest.approx(
        (slam._x[3] - slam._x[0]) / slam._sights()[0, 0], abs=1e-2
    )  # a new first estimate, too
    assert np.all(np.linalg.eigvalsh(state(slam)[1]) > -1e-12)


@pytest.mark.parametrize("kind", [FejSlam, UkfSlam])
def test_the_names_tell_where_each_observation_went(kind: type[GaussianSlam]) -> None:
    slam = kind(CONFIG, "nearest")
    ranges, bearings = seen_from(np.zeros(3), CONES[:4])
    ids = np.full(4, -1)
    slam.update(0, ids, np.append(ranges[:3], np.nan), bearings)
    assert slam.names.tolist() == [1, 2, 3, -1]
    slam.update(1, ids, ranges[::-1].copy(), bearings[::-1].copy())
    assert slam.names.tolist() == [4, 3, 2, 1]


@pytest.mark.slow
def test_with_five_degrees_of_heading_noise_both_are_more_consistent_than_the_ekf() -> None:
    """ANEES of 50 runs of 10 s against the 95 % bounds of Bailey et al. 2006."""
    config = with_heading_noise(FIVE_DEGREES)
    inside, mean = {}, {}
    for kind in (EkfSlam, FejSlam, UkfSlam):
        anees = np.mean(
            [pose_nees(kind(config, "known"), config.motion, seed) for seed in range(50)], axis=0
        )
        inside[kind] = np.mean((anees > 2.36) & (anees < 3.72))
        mean[kind] = anees.mean()
    assert inside[EkfSlam] < 0.2
    assert inside[FejSlam] > 0.4
    assert inside[UkfSlam] > 0.6
    assert max(mean[FejSlam], mean[UkfSlam]) < 4.0 < mean[EkfSlam]
