from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_pictures import CAMERA, CHARUCO, CHESSBOARD, RINGS, charuco_pictures, pictures, seen

from calibration import (
    Board,
    CalibrationError,
    CameraLimits,
    CharucoBoard,
    Chessboard,
    Picture,
    RingGrid,
    Sightings,
    Skipped,
    calibrate_camera,
    pictures_of,
)
from calibration.camera import where_to_show
from calibration.intrinsics import sigmas
from capture import read_camera_calibration, write_calibration
from dialogue import UsageError
from geometry import RingShape, intrinsics_of


@pytest.mark.parametrize("board", [CHARUCO, RINGS, CHESSBOARD], ids=["charuco", "rings", "chess"])
def test_every_board_gives_the_camera_within_its_own_uncertainty(board: Board) -> None:
    shown = charuco_pictures() if board is CHARUCO else tuple(pictures(board, 12))
    result = calibrate_camera(seen(board, shown), {})
    assert len(result.used) >= 10
    off = intrinsics_of(result.calibration.camera) - intrinsics_of(CAMERA)
    assert np.abs(off / sigmas(result.fit.covariance)).max() < 4.5
    assert np.abs(off[:2] / intrinsics_of(CAMERA)[:2]).max() < 0.004
    assert result.calibration.rms_px < 0.2


def test_the_middles_of_tilted_rings_are_not_taken_for_the_middles_of_ellipses() -> None:
    """Without the correction the residuals of a noiseless board would be tenths of a pixel."""
    result = calibrate_camera(seen(RINGS, pictures(RINGS, 12)), {})
    assert result.calibration.rms_px < 0.04


def test_a_bent_view_is_named_and_left_out() -> None:
    sightings = seen(CHARUCO, charuco_pictures())
    bent = sightings.found[5]
    wave = 3.0 * np.sin(bent.pixels[:, :1] / 40.0)
    sightings.found[5] = replace(bent, pixels=bent.pixels + np.hstack([wave, -wave]))
    result = calibrate_camera(sightings, {})
    (gone,) = [view for view in result.calibration.views if not view.used]
    assert gone.name == bent.name
    assert "times as far off as the median view" in gone.why
    assert bent.name not in [one.name for one in result.used]


def test_verdict_says_everything_that_is_wrong() -> None:
    few = seen(CHARUCO, charuco_pictures()[4:8])
    result = calibrate_camera(few, {})
    assert not result.calibration.accepted
    text = "\n".join(result.calibration.reasons)
    assert "4 views of the board; take at least 8" in text
    assert "show it also at the" in text
    strict = calibrate_camera(seen(CHARUCO, charuco_pictures()), {}, CameraLimits(max_rms_px=0.001))
    assert "is the board flat" in "\n".join(strict.calibration.reasons)


def test_a_calibration_is_read_back_whole_and_never_overwritten(tmp_path: Path) -> None:
    calibration = calibrate_camera(seen(CHARUCO, charuco_pictures()), {"source": "x"}).calibration
    file = write_calibration(tmp_path, calibration)
    again = read_camera_calibration(tmp_path)
    assert again.camera == calibration.camera
    np.testing.assert_array_equal(again.covariance_matrix, calibration.covariance_matrix)
    assert again.views == calibration.views
    before = file.read_bytes()
    with pytest.raises(Exception, match="never overwritten"):
        write_calibration(tmp_path, calibration)
    assert file.read_bytes() == before


def test_faults_of_a_calibration_file_are_told_with_their_place(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="no such file or folder; trackside calibrate camera"):
        read_camera_calibration(tmp_path / "nowhere")
    with pytest.raises(Exception, match=r"holds no camera_\*.yaml"):
        read_camera_calibration(tmp_path)
    (tmp_path / "camera_1.yaml").write_text("format: 1\ncamera: {fx: nonsense}\n")
    with pytest.raises(Exception, match=r"camera_1.yaml:2:.*fx"):
        read_camera_calibration(tmp_path)


def test_pictures_without_the_board_say_what_was_looked_for() -> None:
    sightings = seen(Chessboard(9, 6, 0.025), (Picture("black", np.zeros((480, 640), np.uint8)),))
    with pytest.raises(CalibrationError, match=r"none of 1 pictures.*columns 9"):
        calibrate_camera(sightings, {})


def test_pictures_of_two_sizes_are_refused() -> None:
    sightings = seen(CHARUCO, (Picture("a", np.zeros((480, 640), np.uint8)),))
    with pytest.raises(CalibrationError, match=r"b: has 320x240 pixels.*640x480"):
        sightings.add(Picture("b", np.zeros((240, 320), np.uint8)))


def test_a_board_that_hardly_moved_is_no_new_view() -> None:
    first = charuco_pictures()[0]
    sightings = Sightings(CHARUCO, fresh_px=20.0)
    assert sightings.add(first) is not None
    shifted = np.roll(first.image, 5, axis=1)
    assert sightings.add(Picture("again", shifted)) is None
    assert sightings.add(charuco_pictures()[1]) is not None


def test_damaged_pictures_of_a_folder_are_told(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), charuco_pictures()[0].image)
    (tmp_path / "b.jpg").write_bytes(b"no picture")
    (tmp_path / "c.png").write_bytes(b"")
    skipped = Skipped()
    assert [one.name for one in pictures_of(tmp_path, skipped)] == ["a.png"]
    assert len(skipped.lines) == 2


def test_nothing_to_read_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="holds no pictures"):
        list(pictures_of(tmp_path, Skipped()))
    with pytest.raises(CalibrationError, match="no such folder"):
        list(pictures_of(tmp_path / "nowhere", Skipped()))


def test_a_video_gives_its_frames(tmp_path: Path) -> None:
    file = tmp_path / "board.avi"
    video = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (800, 600), False)
    for picture in charuco_pictures()[:3]:
        video.write(picture.image)
    video.release()
    sightings = seen(CHARUCO, pictures_of(file, Skipped()))
    assert [one.name for one in sightings.found] == ["frame 0", "frame 1", "frame 2"]


def test_boards_that_are_none_are_refused() -> None:
    with pytest.raises(CalibrationError, match="swapped"):
        CharucoBoard(square_m=0.02, marker_m=0.027)
    with pytest.raises(CalibrationError, match="as many columns as rows"):
        RingGrid(5, 5)
    with pytest.raises(CalibrationError, match=r"1\.3 diameters"):
        RingGrid(spacing_m=0.031)
    with pytest.raises(CalibrationError, match="positive spacing"):
        Chessboard(9, 6, 0.0)
    with pytest.raises(ValueError, match="swapped"):
        RingShape(0.05, 0.122)


def test_a_board_is_told_by_words() -> None:
    from calibration.boards import board_of

    assert board_of("chessboard", (9, 6), 0.025) == Chessboard(9, 6, 0.025)
    assert board_of("charuco") == CharucoBoard()
    assert board_of("rings").describe() == pytest.approx(RingGrid().describe(), abs=1e-4)
    with pytest.raises(UsageError, match="needs --size"):
        board_of("chessboard")
    with pytest.raises(UsageError, match="--marker belongs"):
        board_of("rings", marker_m=0.02)
    with pytest.raises(UsageError, match="--diameter and --inner belong"):
        board_of("charuco", diameter_m=0.03)


def test_where_the_board_was_least() -> None:
    cells = np.ones((6, 8))
    assert where_to_show(cells) == ""
    cells[:2, :2] = 0.0
    assert where_to_show(cells) == "top left"


@pytest.mark.realdata
def test_the_left_camera_of_opencv(data_dir: Path) -> None:
    sightings = Sightings(Chessboard(9, 6, 0.025))
    sightings.add_all(pictures_of(data_dir / "calibration_left", Skipped()))
    calibration = calibrate_camera(sightings, {}).calibration
    assert len(sightings.found) == sum(view.used for view in calibration.views) == 14
    assert calibration.rms_px <= 0.20
    assert calibration.camera.fx == pytest.approx(532.8, abs=1.0)
    assert calibration.camera.fy == pytest.approx(533.0, abs=1.0)
    assert calibration.accepted
