from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from floors import CORNERS, UNEVEN, VIEW, camera, errors_m, floor_of, in_frame, pictures, seen

from calibration import (
    CalibrationError,
    FloorMarker,
    MeasuredLength,
    calibrate_world,
    read_floor,
    verify_length,
)
from calibration.survey import Floor
from capture import ConfigurationError, read_world_calibration, write_calibration
from geometry import RingShape, at_height
from simulation import oblique_view, straight_down_view
from tracking import TrackingError, average_rings

FLAT = at_height(UNEVEN, 0.0)


def test_an_uneven_quadrangle_gives_the_frame_of_its_true_corners() -> None:
    result = calibrate_world(floor_of(UNEVEN), seen(FLAT), camera(), {})
    assert result.calibration.accepted, result.calibration.reasons
    for height_m in (0.0, 0.2):
        off = errors_m(VIEW, result.calibration.view, UNEVEN, height_m)
        assert off.max() < 0.0015
    np.testing.assert_allclose(
        [marker.xyz_m[:2] for marker in result.calibration.markers],
        in_frame(UNEVEN, UNEVEN),
        atol=1e-3,
    )
    assert result.calibration.markers[0].xyz_m[:2] == (0.0, 0.0)
    assert result.calibration.markers[1].xyz_m[1] == 0.0


def test_the_predicted_accuracy_is_that_of_many_floors() -> None:
    """Tapes of 1 mm, cameras off by their own uncertainty."""
    rng = np.random.default_rng(5)
    view = straight_down_view(720)
    off, predicted = [], []
    for trial in range(6):
        known = camera(view)
        floor = floor_of(CORNERS)
        taped = tuple(
            MeasuredLength(between=one.between, length_m=one.length_m + rng.normal(0.0, 0.001))
            for one in floor.lengths
        )
        floor = Floor(markers=floor.markers, lengths=taped)
        rings = seen(at_height(CORNERS, 0.0), view, count=2, seed=trial)
        result = calibrate_world(floor, rings, known, {})
        off.append(errors_m(view, result.calibration.view, CORNERS, 0.0))
        predicted.append(result.calibration.accuracy_m["floor_rms"])
    rms = np.sqrt(np.mean(np.square(off)))
    assert 0.3 * np.mean(predicted) < rms < 1.5 * np.mean(predicted)


def test_heights_and_further_rings_count() -> None:
    raised = np.column_stack([UNEVEN, [0.0, 0.1, 0.0, 0.05]])
    cone = np.array([[0.3, 0.4, 0.12]])
    x, y = in_frame(UNEVEN, cone[:, :2])[0].tolist()
    others = [FloorMarker(name="k1", height_m=0.12, near_m=(x + 0.1, y - 0.05))]
    rings = seen(np.concatenate([raised, cone]))
    result = calibrate_world(floor_of(raised, others), rings, camera(), {})
    assert result.calibration.accepted, result.calibration.reasons
    found = result.calibration.markers[4]
    assert found.name == "k1"
    np.testing.assert_allclose(found.xyz_m, (x, y, 0.12), atol=1e-3)
    assert found.covariance_m2[0] > 0.0


def test_a_mistyped_length_is_named_and_refused() -> None:
    result = calibrate_world(floor_of(UNEVEN, error_m=0.02), seen(FLAT), camera(), {})
    assert not result.calibration.accepted
    assert "the length c1 to c2 was measured as" in "\n".join(result.calibration.reasons)


def test_a_wrong_height_or_ring_is_refused() -> None:
    floor = floor_of(UNEVEN)
    marks = list(floor.markers)
    marks[2] = FloorMarker(name="c3", corner=3, height_m=0.3)
    rings = seen(FLAT)
    result = calibrate_world(
        Floor(markers=tuple(marks), lengths=floor.lengths), rings, camera(), {}
    )
    assert not result.calibration.accepted


def test_what_was_not_seen_and_a_rejected_camera_are_told() -> None:
    others = [FloorMarker(name="k9", near_m=(1.0, 1.0))]
    result = calibrate_world(floor_of(UNEVEN, others), seen(FLAT), camera(accepted=False), {})
    text = "\n".join(result.calibration.reasons)
    assert "k9 was not seen" in text
    assert "own calibration was rejected: 2 views" in text


def test_three_corners_in_the_picture_are_refused() -> None:
    with pytest.raises(CalibrationError, match="3 rings are seen, the frame needs its four"):
        calibrate_world(floor_of(UNEVEN), seen(FLAT[:3]), camera(), {})


def test_three_corners_in_the_file_are_refused() -> None:
    marks = tuple(FloorMarker(name=f"c{k}", corner=k) for k in (1, 2, 3))
    with pytest.raises(ValueError, match="three points fix no perspective"):
        Floor(markers=marks, lengths=())


def test_collinear_corners_are_refused() -> None:
    line = np.array([[-1.2, 0.0, 0.0], [-0.4, 0.0, 0.0], [0.4, 0.01, 0.0], [1.2, 0.0, 0.0]])
    with pytest.raises(CalibrationError, match="line"):
        calibrate_world(floor_of(UNEVEN), seen(line), camera(), {})


def test_pictures_of_another_resolution_are_refused() -> None:
    rings = seen(FLAT, oblique_view(480), count=1)
    with pytest.raises(CalibrationError, match="640x480 pixels, the camera was calibrated at 1280"):
        calibrate_world(floor_of(UNEVEN), rings, camera(), {})


def test_swapped_diameters_are_refused_with_their_place(tmp_path: Path) -> None:
    file = tmp_path / "floor.yaml"
    file.write_text("ring: {diameter_m: 0.05, inner_diameter_m: 0.122}\nmarkers: []\nlengths: []\n")
    with pytest.raises(ConfigurationError, match=r"floor.yaml:1:7: ring: .*swapped"):
        read_floor(file)


def test_corners_that_go_clockwise_are_refused() -> None:
    floor = floor_of(UNEVEN)
    pixels = VIEW.project(FLAT)[[0, 3, 2, 1]]
    marks = tuple(
        FloorMarker(name=one.name, corner=one.corner, near_px=tuple(place))
        for one, place in zip(floor.markers, pixels.tolist(), strict=True)
    )
    with pytest.raises(CalibrationError, match="clockwise"):
        calibrate_world(Floor(markers=marks, lengths=floor.lengths), seen(FLAT), camera(), {})


def test_a_chosen_first_corner_turns_the_frame() -> None:
    turned = np.roll(UNEVEN, -1, axis=0)
    floor = floor_of(turned)
    floor = Floor(first_corner="bottom-right", markers=floor.markers, lengths=floor.lengths)
    result = calibrate_world(floor, seen(FLAT), camera(), {})
    assert errors_m(VIEW, result.calibration.view, turned, 0.0).max() < 0.0015


def test_a_camera_that_moved_while_filming_is_refused() -> None:
    shown = pictures(FLAT, count=6)
    images = [np.roll(one.image, k // 4, axis=1) for k, one in enumerate(shown)]
    with pytest.raises(TrackingError, match=r"the camera moved by 1\.0 px"):
        average_rings(images, RingShape())


def test_black_pictures_are_refused() -> None:
    with pytest.raises(TrackingError, match="is black"):
        average_rings([np.zeros((720, 1280), np.uint8)], RingShape())


def test_a_world_is_read_back_whole(tmp_path: Path) -> None:
    calibration = calibrate_world(floor_of(UNEVEN), seen(FLAT), camera(), {}).calibration
    write_calibration(tmp_path, calibration)
    again = read_world_calibration(tmp_path)
    np.testing.assert_array_equal(again.view.rotation, calibration.view.rotation)
    np.testing.assert_array_equal(again.covariance_matrix, calibration.covariance_matrix)
    assert again.markers == calibration.markers
    assert again.lengths == calibration.lengths


def test_a_known_length_passes_or_fails() -> None:
    world = calibrate_world(floor_of(UNEVEN), seen(FLAT), camera(), {}).calibration
    stick = np.array([[-0.5, 0.2, 0.2], [0.5, 0.2, 0.2]])
    rings = seen(np.concatenate([FLAT, stick]))
    found = verify_length(world, rings, 1.0, height_m=0.2)
    assert found.passed
    assert abs(found.error_m) < 0.0015
    assert 0.0 < found.sigma_m < 0.002
    # As if it lay on the floor, the stick is too long: the error users complain about.
    assert not verify_length(world, rings, 1.0, height_m=0.0).passed
    corners = verify_length(
        world, rings, float(np.linalg.norm(UNEVEN[0] - UNEVEN[2])), between=("c1", "c3")
    )
    assert corners.passed
    with pytest.raises(CalibrationError, match="exactly two rings must be seen, 0 are: none"):
        verify_length(world, seen(FLAT), 1.0)
    with pytest.raises(CalibrationError, match="no marker 'c9'"):
        verify_length(world, rings, 1.0, between=("c1", "c9"))


def test_lengths_and_markers_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="between two markers"):
        MeasuredLength(between=("a", "a"), length_m=1.0)
    with pytest.raises(ValueError, match="nobody knows which ring"):
        FloorMarker(name="k")
    floor = floor_of(UNEVEN)
    with pytest.raises(ValueError, match="at least four lengths"):
        Floor(markers=floor.markers, lengths=floor.lengths[:3])
    with pytest.raises(ValueError, match="names zz"):
        Floor(
            markers=floor.markers,
            lengths=(MeasuredLength(between=("c1", "zz"), length_m=1.0), *floor.lengths),
        )
