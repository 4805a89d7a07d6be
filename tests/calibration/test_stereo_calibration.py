from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_pictures import CHARUCO, CHESSBOARD, sheet
from click.testing import CliRunner, Result

from calibration import Board, CalibrationError, Picture
from calibration.stereo.calibrate import calibrate_stereo
from calibration.stereo.sightings import PairSightings
from capture import (
    CalibrationFileError,
    Session,
    SessionInfo,
    StereoCalibration,
    read_stereo_calibration,
    write_calibration,
)
from capture.log_writer import LogWriter
from capture.sensor_messages import image_message
from capture.topics import IMAGE_TYPE, ZED_LOG_NAME, ZED_TOPIC
from geometry import Floats, Mounting, View, between
from simulation.boards import held_boards, render_sheet
from simulation.stereo import (
    ZED_MOUNTING,
    StereoScene,
    write_factory_file,
    zed_calibration,
    zed_pair,
)
from trackside.cli import trackside
from visual_odometry import VisualOdometer

PAIR = zed_pair()
MOUNTED = ("--x", "20cm", "--y", "60mm", "--z", "0.22", "--pitch", "12")


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


@lru_cache(maxsize=2)
def pictures(board: Board, count: int) -> tuple[Picture, ...]:
    """A board before both eyes, side by side. All of one eye first: its rays are kept."""
    rng = np.random.default_rng(2)
    texels, metres, size_m = sheet(board)
    left = held_boards(PAIR.left, size_m, count, rng)
    turned = [PAIR.rotation @ view.rotation for view in left]
    moved = [PAIR.rotation @ view.translation + PAIR.translation for view in left]
    right = [View(PAIR.right, r, t) for r, t in zip(turned, moved, strict=True)]
    eyes = [
        [render_sheet(view, texels, metres, rng, psf_sigma_px=0.6) for view in views]
        for views in (left, right)
    ]
    return tuple(
        Picture(f"view {k}", np.hstack(both)) for k, both in enumerate(zip(*eyes, strict=True))
    )


def found(board: Board, shown: tuple[Picture, ...]) -> PairSightings:
    seen = PairSightings(board)
    seen.add_all(shown, 10**6)
    return seen


def turn_off(calibration: StereoCalibration) -> Floats:
    """(3,) rad: the fitted turn against the true one."""
    off = calibration.pair.rotation @ PAIR.rotation.T
    return np.asarray(cv2.Rodrigues(off)[0], np.float64).ravel()


@pytest.fixture(scope="module")
def shown() -> tuple[Picture, ...]:
    return pictures(CHESSBOARD, 20)


def test_baseline_and_turn_of_a_rendered_pair_are_found(shown: tuple[Picture, ...]) -> None:
    result = calibrate_stereo(found(CHESSBOARD, shown), ZED_MOUNTING, {"source": "test"})
    assert result.accepted, result.reasons
    assert result.pair.baseline_m == pytest.approx(PAIR.baseline_m, abs=0.1e-3)
    assert np.abs(turn_off(result)).max() < np.radians(0.05)
    assert result.rms_px is not None
    assert result.rms_px < 0.12
    assert result.epipolar_rms_px is not None
    assert result.epipolar_rms_px < 0.12
    assert result.left.fx == pytest.approx(PAIR.left.fx, rel=0.002)
    assert result.mounting == ZED_MOUNTING
    # What is claimed of the errors is about as large as they are.
    assert result.translation_sigma_m is not None
    off = (result.pair.translation - PAIR.translation) / result.translation_sigma_m
    assert np.abs(off).max() < 5.0
    assert 1e-6 < result.translation_sigma_m[0] < 1e-4


def test_visual_odometry_with_what_was_found_drifts_little(shown: tuple[Picture, ...]) -> None:
    """A turn of 1.6 m in a rendered room: scale and turning hang on the calibration alone."""
    result = calibrate_stereo(found(CHESSBOARD, shown), ZED_MOUNTING, {})
    room = StereoScene(np.array([[3.0, 0.5]]), seed=1)
    odometer = VisualOdometer(result.pair, result.mounting)
    turn = np.linspace(0.0, 1.07, 41)
    poses = np.stack([1.5 * np.sin(turn), 1.5 * (1.0 - np.cos(turn)), turn], axis=1)
    frames = [odometer.add(k * 66_666_667, room.frame(pose)) for k, pose in enumerate(poses)]
    off = between(poses[-1], frames[-1].pose)
    assert np.hypot(*off[:2]) < 0.005 * 1.6
    assert abs(off[2]) < np.radians(0.3)


def test_a_view_of_another_moment_is_left_out(shown: tuple[Picture, ...]) -> None:
    """The board moved between the eyes' halves: as one frame torn apart would have it."""
    good = found(CHESSBOARD, shown)
    spoiled = good.found[3]
    good.found[3] = replace(spoiled, right=spoiled.right + np.array([0.0, 3.0]))
    result = calibrate_stereo(good, Mounting(), {})
    assert [view.name for view in result.views if not view.used] == [spoiled.name]
    assert result.pair.baseline_m == pytest.approx(PAIR.baseline_m, abs=0.2e-3)


def test_a_board_of_another_size_has_another_baseline(shown: tuple[Picture, ...]) -> None:
    wrong = replace(CHESSBOARD, square_m=1.05 * CHESSBOARD.square_m)
    result = calibrate_stereo(found(wrong, shown), Mounting(), {})
    assert result.pair.baseline_m == pytest.approx(1.05 * PAIR.baseline_m, rel=0.003)


def test_few_views_are_rejected_with_what_to_do(shown: tuple[Picture, ...]) -> None:
    result = calibrate_stereo(found(CHESSBOARD, shown[:6]), Mounting(), {})
    assert not result.accepted
    assert any("take at least 8" in reason for reason in result.reasons)
    nothing = (Picture("grey", np.full((376, 1344), 90, np.uint8)),)
    with pytest.raises(CalibrationError, match="in none of 1 pictures; expected board chessboard"):
        calibrate_stereo(found(CHESSBOARD, nothing), Mounting(), {})
    with pytest.raises(CalibrationError, match="not two eyes"):
        found(CHESSBOARD, (Picture("odd", np.zeros((10, 11), np.uint8)),))


def test_the_command_makes_a_dated_file_of_a_folder(
    shown: tuple[Picture, ...], tmp_path: Path
) -> None:
    folder = tmp_path / "board"
    folder.mkdir()
    for k, picture in enumerate(shown):
        cv2.imwrite(str(folder / f"{k:02d}.png"), picture.image)
    words = ["--board", "chessboard", "--size", "9x6", "--square", "27mm", *MOUNTED]
    done = call("calibrate", "stereo", folder, *words, "-o", tmp_path / "made")
    assert done.exit_code == 0, done.output
    assert "pictures gave a new view of the board" in done.output
    assert "baseline 119.8" in done.output
    assert "looking down 12.00 deg" in done.output
    kept = read_stereo_calibration(tmp_path / "made")
    assert kept.mounting == ZED_MOUNTING
    assert kept.how["board"] == "chessboard"
    assert kept.pair.baseline_m == pytest.approx(PAIR.baseline_m, abs=0.1e-3)


def test_a_session_whose_zed_saw_a_board_will_do(tmp_path: Path) -> None:
    shown = pictures(CHARUCO, 10)
    folder = tmp_path / "run"
    with Session.create(folder, SessionInfo(map="board")):
        pass
    with LogWriter(folder / ZED_LOG_NAME, sync_period_s=None) as log:
        for k, picture in enumerate([one for one in shown for _ in range(2)]):
            _, png = cv2.imencode(".png", picture.image)
            data = image_message(k + 1, "zed_left", "png", png.tobytes())
            log.write(ZED_TOPIC, IMAGE_TYPE, data, log_t_ns=k + 1, stamp_ns=k + 1)
    done = call("calibrate", "stereo", folder, "-o", tmp_path / "made")
    assert "of 20 pictures gave a new view" in done.output
    assert "note: the eye is told to be on the floor" in done.output
    kept = read_stereo_calibration(tmp_path / "made")
    assert len(kept.views) <= 10  # each board was logged twice and counts once
    assert kept.pair.baseline_m == pytest.approx(PAIR.baseline_m, abs=1e-3)


def test_the_factory_file_is_taken_to_the_digit(tmp_path: Path) -> None:
    file = write_factory_file(tmp_path, PAIR, 4711)
    made = tmp_path / "made"
    done = call("calibrate", "stereo", "--factory", file, "--mode", "VGA", *MOUNTED, "-o", made)
    assert done.exit_code == 0, done.output
    kept = read_stereo_calibration(made)
    assert (kept.left, kept.right) == (PAIR.left, PAIR.right)
    np.testing.assert_allclose(kept.pair.rotation, PAIR.rotation, atol=1e-15)
    np.testing.assert_allclose(kept.pair.translation, PAIR.translation, rtol=1e-15)
    assert kept.how == {"source": "factory", "file": "SN4711.conf", "mode": "VGA"}
    assert kept.rms_px is None
    other = call("calibrate", "stereo", "--factory", file, "--mode", "HD720", "-o", made)
    assert "[STEREO] has no RX_HD" in str(other.exception)


def test_words_that_do_not_fit_are_told(tmp_path: Path) -> None:
    assert "either a SOURCE" in str(call("calibrate", "stereo").exception)
    file = write_factory_file(tmp_path, PAIR)
    wrong = call("calibrate", "stereo", "--factory", file, "--mode", "4K")
    assert "is none of HD2K" in str(wrong.exception)
    assert call("calibrate", "stereo", "--factory", file, "--x", "far").exit_code == 2


def test_the_file_keeps_everything_and_refuses_nonsense(tmp_path: Path) -> None:
    true = zed_calibration()
    file = write_calibration(tmp_path, true)
    assert file.name == "stereo_20190514T080000Z.yaml"
    assert read_stereo_calibration(tmp_path) == true
    text = file.read_text().replace("- -0.11987", "- 0.11987")
    file.write_text(text)
    with pytest.raises(CalibrationFileError, match="are the eyes swapped"):
        read_stereo_calibration(file)
