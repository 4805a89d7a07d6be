from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from score_scenes import lap, space_spiral, stamps, straight

from geometry import Trajectory
from scoring import ScoreOptions
from scoring.path_metrics import (
    CHI2_95,
    PosedPath,
    angles_between,
    consistency,
    heading_metrics,
    normalised_squares,
    planar_errors,
    relative_metrics,
    statistics,
)


def _moved(path: Trajectory, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> Trajectory:
    return Trajectory(path.t_ns, path.x + x, path.y + y, path.heading + heading)


def test_statistics_of_three_errors() -> None:
    values = statistics("ate", np.array([3.0, 1.0, 2.0, 6.0]))
    assert values == pytest.approx(
        {
            "ate_rmse": np.sqrt(12.5),
            "ate_mean": 3.0,
            "ate_median": 2.5,
            "ate_std": np.sqrt(3.5),
            "ate_min": 1.0,
            "ate_max": 6.0,
            "ate_sse": 50.0,
        }
    )
    assert set(statistics("ate", np.zeros(0)).values()) == {None}


@given(st.lists(st.floats(0, 100), min_size=1, max_size=20))
def test_the_median_is_numpys(values: list[float]) -> None:
    assert statistics("x", np.array(values))["x_median"] == pytest.approx(np.median(values))


def test_along_is_ahead_and_cross_is_left_of_the_true_heading() -> None:
    north = Trajectory(stamps(2), np.zeros(2), np.zeros(2), np.full(2, np.pi / 2))
    errors = planar_errors(north, _moved(north, x=-0.3, y=0.4, heading=0.1))
    np.testing.assert_allclose(errors.along_m, 0.4)
    np.testing.assert_allclose(errors.cross_m, 0.3)
    np.testing.assert_allclose(errors.position_m, 0.5)
    np.testing.assert_allclose(errors.heading_rad, 0.1)


def test_heading_errors_wrap_and_come_in_radians_and_degrees() -> None:
    truth = Trajectory(stamps(2), np.zeros(2), np.zeros(2), np.array([3.1, 3.1]))
    estimate = Trajectory(stamps(2), np.zeros(2), np.zeros(2), np.array([-3.1, 3.0]))
    metrics = heading_metrics(planar_errors(truth, estimate).heading_rad)
    near, far = 0.1, 2 * np.pi - 6.2
    assert metrics["heading_mean"] == pytest.approx((near + far) / 2)
    assert metrics["heading_rmse"] == pytest.approx(np.sqrt((near**2 + far**2) / 2))
    assert metrics["heading_max_deg"] == pytest.approx(np.degrees(near))
    assert set(heading_metrics(np.full(3, np.nan)).values()) == {None}


def _relative(
    truth: Trajectory, estimate: Trajectory, **choices: object
) -> dict[str, float | None]:
    options = ScoreOptions(**choices)  # type: ignore[arg-type]  # numbers and words of the tests below
    return relative_metrics(PosedPath.planar(truth), PosedPath.planar(estimate), options)


def test_a_rigid_motion_has_no_relative_error() -> None:
    metrics = _relative(lap(), lap().transformed(np.array([5.0, -3.0, 1.0])))
    assert metrics["rpe_max"] == pytest.approx(0.0, abs=1e-12)
    assert metrics["rpe_rotation_max"] == pytest.approx(0.0, abs=1e-9)


def test_a_path_too_long_by_a_tenth_errs_by_a_tenth_of_each_step() -> None:
    truth = straight(101)
    estimate = Trajectory(truth.t_ns, 1.1 * truth.x, truth.y, truth.heading)
    per_frame = _relative(truth, estimate)
    assert per_frame["rpe_mean"] == pytest.approx(0.1 * 0.05)
    assert per_frame["rpe_std"] == pytest.approx(0.0, abs=1e-12)
    assert _relative(truth, estimate, rpe_delta=10)["rpe_mean"] == pytest.approx(0.1 * 0.5)
    assert _relative(truth, estimate, rpe_unit="s")["rpe_mean"] == pytest.approx(0.1 * 1.0)
    per_metre = _relative(truth, estimate, rpe_unit="m", rpe_delta=1.1)
    assert per_metre["rpe_mean"] == pytest.approx(0.1 * 1.0)


def test_steps_that_sum_to_a_metre_by_rounding_are_a_metre() -> None:
    x = np.cumsum(np.full(21, 0.1)) - 0.1
    path = Trajectory(stamps(21), x, np.zeros(21), np.zeros(21))
    longer = Trajectory(stamps(21), 2 * x, np.zeros(21), np.zeros(21))
    metrics = _relative(longer, path, rpe_unit="m")
    assert metrics["rpe_sse"] == pytest.approx(2 * 1.0**2)


def test_a_constant_turn_error_is_the_rotation_part() -> None:
    truth = straight(50)
    drift = 0.01 * np.arange(50.0)
    estimate = Trajectory(truth.t_ns, truth.x, truth.y, drift)
    metrics = _relative(truth, estimate)
    assert metrics["rpe_rotation_mean"] == pytest.approx(0.01)
    assert metrics["rpe_rotation_rmse"] == pytest.approx(0.01)


def test_a_path_shorter_than_one_step_has_no_relative_error() -> None:
    for choices in ({"rpe_delta": 200}, {"rpe_unit": "s", "rpe_delta": 60.0}):
        assert set(_relative(straight(20), straight(20), **choices).values()) == {None}
    assert set(_relative(straight(1), straight(1)).values()) == {None}


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.0, np.pi])
def test_angles_are_exact_in_the_plane_and_in_space(angle: float) -> None:
    cos, sin = np.cos(angle), np.sin(angle)
    plane = np.array([[[cos, -sin], [sin, cos]]])
    space = np.eye(3)[None].copy()
    space[:, 1:, 1:] = plane
    for rotations in (plane, space):
        turned = rotations @ rotations
        assert angles_between(rotations, turned)[0] == pytest.approx(angle, rel=1e-6, abs=1e-15)


def test_the_planar_path_and_its_lift_into_space_have_the_same_metrics() -> None:
    spiral = space_spiral()
    flat = spiral.planar()
    lifted = PosedPath(spiral.t_ns, spiral.positions * [1.0, 1.0, 0.0], spiral.rotations)
    bent = PosedPath(spiral.t_ns, lifted.positions * 1.1, spiral.rotations)
    options = ScoreOptions()
    in_space = relative_metrics(lifted, bent, options)
    grown = Trajectory(flat.t_ns, 1.1 * flat.x, 1.1 * flat.y, flat.heading)
    in_plane = relative_metrics(PosedPath.planar(flat), PosedPath.planar(grown), options)
    assert in_space == pytest.approx(in_plane, abs=1e-12)


def test_nees_of_known_errors() -> None:
    errors = np.array([[0.1, 0.0, 0.0], [0.1, 0.2, 0.0]])
    covariances = np.stack([np.diag([0.01, 1.0, 1.0]), np.diag([0.01, 0.01, 1e-4])])
    np.testing.assert_allclose(normalised_squares(errors, covariances), [1.0, 5.0])


def test_nees_leaves_singular_covariances_out() -> None:
    covariances = np.stack([np.zeros((2, 2)), np.ones((2, 2)), np.eye(2), np.diag([1e-12, 1.0])])
    nees = normalised_squares(np.ones((4, 2)), covariances)
    np.testing.assert_allclose(nees, [2.0, 1e12 + 1.0])


def test_nees_is_the_same_in_other_units_and_frames() -> None:
    rng = np.random.default_rng(0)
    roots = rng.normal(size=(20, 3, 3))
    covariances, errors = roots @ roots.transpose(0, 2, 1), rng.normal(size=(20, 3))
    change = np.diag([1000.0, 1000.0, 57.3]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    np.testing.assert_allclose(
        normalised_squares(errors @ change.T, change @ covariances @ change.T),
        normalised_squares(errors, covariances),
        rtol=1e-6,
    )


@pytest.mark.parametrize("degrees", [2, 3])
def test_consistent_errors_lie_within_the_quantile_95_times_in_100(degrees: int) -> None:
    from scipy.special import chdtri

    assert CHI2_95[degrees] == pytest.approx(float(chdtri(degrees, 0.05)), rel=1e-12)
    rng = np.random.default_rng(2)
    nees = np.sum(rng.normal(size=(20_000, degrees)) ** 2, axis=1)
    values = consistency("path", nees, degrees)
    assert values["path_nees"] == pytest.approx(degrees, rel=0.03)
    assert values["path_nees_within"] == pytest.approx(0.95, abs=0.005)
    assert set(consistency("path", np.zeros(0), degrees).values()) == {None}
