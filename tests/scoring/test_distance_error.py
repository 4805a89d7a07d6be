from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from score_scenes import landmark_map, straight

from capture import NO_STAMP, EstimatedMap
from geometry import Floats, Trajectory
from scoring import ScoreOptions
from scoring.distance_error import DistanceError, Scene, distance_error, first_motion_ns
from scoring.pairing import pair_landmarks

CONES = np.array([[2.0, 0.0], [0.0, 1.0], [2.0, 0.5]])
TRUTH = straight(50)
"""1 m/s along x: at pose k the car is at x = 0.05 k."""


def _scene(positions: Floats | None = None, path: Trajectory = TRUTH) -> Scene:
    """Added at x = 1.5, at the start (standing), at x = 1.0; the car then believed to be there."""
    t_ns = TRUTH.t_ns[[30, 0, 20]]
    return Scene(
        TRUTH,
        landmark_map(CONES),
        path,
        EstimatedMap(
            landmark_map(CONES if positions is None else positions),
            t_added_ns=t_ns,
            added_from=np.array([[1.5, 0.0], [0.0, 0.0], [1.0, 0.0]]),
            range_added_m=np.array([0.7, 1.0, 1.2]),
            t_first_ns=TRUTH.t_ns[[22, 0, 10]],
        ),
    )


def _error(scene: Scene, **choices: object) -> DistanceError:
    pairs = pair_landmarks(
        scene.true_map.positions, scene.map.landmarks.positions, "saturated", 0.3
    )
    return distance_error(scene, pairs, ScoreOptions(**choices))  # type: ignore[arg-type]  # words of the tests below


def test_figure_3_4_the_shortfall_of_one_landmark() -> None:
    scene = _scene()
    assert _error(scene, detection_range_m=3.0).value == pytest.approx(
        np.mean([3.0 - 0.5, 3.0 - np.hypot(1.0, 0.5)])
    )


def test_beyond_the_detection_range_the_error_is_zero_not_negative() -> None:
    result = _error(_scene(), detection_range_m=0.8)
    assert result.value == pytest.approx((0.3 + 0.0) / 2)
    assert result.counted == 2


def test_the_landmark_is_where_the_final_map_has_it() -> None:
    moved = CONES + np.array([0.1, 0.0])
    lengths = np.array([0.6, np.hypot(1.1, 0.5)])
    assert _error(_scene(moved)).value == pytest.approx(np.mean(1.5 - lengths))


def test_without_the_place_of_adding_the_estimated_path_tells_it() -> None:
    shifted = Trajectory(TRUTH.t_ns, TRUTH.x + 0.2, TRUTH.y, TRUTH.heading)
    scene = _scene(path=shifted)
    scene = replace(scene, map=replace(scene.map, added_from=None))
    lengths = np.array([0.3, np.hypot(0.8, 0.5)])
    assert _error(scene).value == pytest.approx(np.mean(1.5 - lengths))


def test_the_range_may_be_the_one_estimated_at_adding() -> None:
    assert _error(_scene(), distance_at="add").value == pytest.approx((0.8 + 0.3) / 2)
    scene = _scene()
    missing = replace(scene, map=replace(scene.map, range_added_m=None))
    assert _error(missing, distance_at="add") == DistanceError(
        None, 0, ("distance undefined: the map has no column range_added",)
    )


def test_the_range_may_be_the_true_one() -> None:
    moved = CONES + np.array([0.1, 0.0])
    far = Trajectory(TRUTH.t_ns, TRUTH.x + 9.0, TRUTH.y, TRUTH.heading)
    lengths = np.array([0.5, np.hypot(1.0, 0.5)])
    result = _error(_scene(moved, path=far), distance_at="truth")
    assert result.value == pytest.approx(np.mean(1.5 - lengths))


def test_first_takes_the_time_before_deletions_and_the_path_for_the_place() -> None:
    lengths = np.array([0.9, np.hypot(1.5, 0.5)])
    result = _error(_scene(), distance_time="first")
    assert result.value == pytest.approx(np.mean(np.maximum(1.5 - lengths, 0.0)))


@pytest.mark.parametrize(("column", "time"), [("t_added_ns", "added"), ("t_first_ns", "first")])
def test_a_missing_column_is_named(column: str, time: str) -> None:
    scene = _scene()
    missing = replace(scene, map=replace(scene.map, **{column: None}))  # type: ignore[arg-type]  # either stamp column may be None
    result = _error(missing, distance_time=time)
    assert result.value is None
    assert result.remarks == (f"distance undefined: the map has no column {column[:-3]}",)


def test_landmarks_added_before_the_car_moved_do_not_count() -> None:
    assert first_motion_ns(TRUTH, 0.05) == TRUTH.t_ns[2]
    assert first_motion_ns(TRUTH, 0.12) == TRUTH.t_ns[3]
    result = _error(_scene(), move_threshold_m=1.0)
    assert result.counted == 1
    assert result.value == pytest.approx(1.5 - 0.5)
    late = _error(_scene(), move_threshold_m=1.6)
    assert late.value is None
    assert "no paired landmark was added after the car moved" in late.remarks[0]


def test_a_car_that_never_moves_has_no_distance_error() -> None:
    scene = replace(_scene(), true_path=straight(50, speed_m_s=0.0))
    result = _error(scene)
    assert (result.value, result.counted) == (None, 0)
    assert "never moves more than 0.05 m" in result.remarks[0]


def test_unknown_times_are_left_out_and_counted() -> None:
    scene = _scene()
    t_ns = np.array([NO_STAMP, TRUTH.t_ns[0], TRUTH.t_ns[20]])
    result = _error(replace(scene, map=replace(scene.map, t_added_ns=t_ns)))
    assert result.counted == 1
    assert result.value == pytest.approx(1.5 - np.hypot(1.0, 0.5))
    assert result.remarks == ("distance: 1 paired landmarks of unknown adding left out",)


def test_landmarks_added_in_one_scan_share_its_pose() -> None:
    scene = _scene()
    t_ns = TRUTH.t_ns[[20, 20, 20]] + 1_000_000
    together = replace(scene, map=replace(scene.map, t_added_ns=t_ns, added_from=None))
    car = np.array([1.001, 0.0])
    lengths = np.linalg.norm(CONES - car, axis=1)
    assert _error(together).value == pytest.approx(np.mean(1.5 - lengths))
