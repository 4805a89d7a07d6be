from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from board_pictures import CHARUCO, pictures
from click.testing import CliRunner, Result
from floors import UNEVEN, VIEW, floor_of, in_frame
from floors import pictures as floor_pictures

from calibration import Skipped, pictures_from, read_floor
from capture import read_camera_calibration, read_world_calibration
from capture.yaml_file import yaml_text
from drivers.camera import ImageFolder, ImageFolderConfig
from geometry import at_height
from tracking import Image
from tracking.scene import Scene, read_scene
from trackside.cli import trackside


def call(*words: object) -> Result:
    return CliRunner().invoke(trackside, [str(word) for word in words])


def save(folder: Path, shown: list[Image]) -> Path:
    folder.mkdir()
    for k, image in enumerate(shown):
        cv2.imwrite(str(folder / f"{k:02d}.png"), image)
    return folder


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both calibrations, made by the commands alone."""
    folder = tmp_path_factory.mktemp("site")
    board = [one.image for one in pictures(CHARUCO, 16, camera=VIEW.camera)]
    done = call("calibrate", "camera", save(folder / "board", board), "-o", folder / "calibration")
    assert done.exit_code == 0, done.output
    assert "accepted" in done.output
    (folder / "floor.yaml").write_text(yaml_text({"floor": floor_of(UNEVEN)}["floor"].__dict__))
    shown = [one.image for one in floor_pictures(at_height(UNEVEN, 0.0))]
    words = ["--floor", folder / "floor.yaml", "-o", folder / "calibration"]
    done = call("calibrate", "world", save(folder / "floor", shown), *words)
    assert done.exit_code == 0, done.output
    assert "camera: " in done.output
    return folder


def test_both_calibrations_are_files_with_pictures(calibrated: Path) -> None:
    folder = calibrated / "calibration"
    assert read_camera_calibration(folder).accepted
    world = read_world_calibration(folder)
    corners = [marker.xyz_m[:2] for marker in world.markers]
    np.testing.assert_allclose(corners, in_frame(UNEVEN, UNEVEN), atol=2e-3)
    assert len(list(folder.glob("*.png"))) == 2
    for file in folder.glob("*.png"):
        assert cv2.imread(str(file)) is not None


def test_show_prints_what_is_in_force(calibrated: Path) -> None:
    shown = call("calibrate", "show", calibrated / "calibration")
    assert shown.exit_code == 0
    assert "camera 1280x720" in shown.output
    assert "c1 to c3" in shown.output
    assert call("calibrate", "show", calibrated / "nothing").exit_code != 0


def test_verify_says_pass_or_fail(calibrated: Path) -> None:
    side = float(np.linalg.norm(UNEVEN[0] - UNEVEN[1]))
    words = ["calibrate", "verify", calibrated / "floor", "--between", "c1,c2"]
    words += ["--calibration", calibrated / "calibration", "--distance"]
    good = call(*words, f"{side:.4f}")
    assert good.exit_code == 0, good.output
    assert good.output.endswith("pass\n")
    bad = call(*words, f"{side + 0.02:.4f}")
    assert bad.exit_code == 1
    assert "fail: more than 5 mm off" in bad.output


def test_words_that_do_not_fit_are_told(calibrated: Path) -> None:
    assert "either a SOURCE" in str(call("calibrate", "camera").exception)
    bad = call("calibrate", "verify", calibrated / "floor", "--distance", "a yard")
    assert bad.exit_code == 2
    assert "is no length" in bad.output
    assert call("calibrate", "camera", calibrated / "board", "--size", "9").exit_code == 2


def test_a_camera_that_is_rejected_ends_with_1(calibrated: Path, tmp_path: Path) -> None:
    few = tmp_path / "few"
    few.mkdir()
    for k in range(4):
        name = f"{k:02d}.png"
        (few / name).write_bytes((calibrated / "board" / name).read_bytes())
    done = call("calibrate", "camera", few, "-o", tmp_path / "calibration")
    assert done.exit_code == 1
    assert "rejected\n" in done.output
    assert "take at least 8" in done.output


def test_the_files_of_the_documentation_are_read(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
    for name in ("floor", "scene"):
        part = text.split(f"### `{name}.yaml`")[1].split("\n#")[0]
        lines = [line[4:] for line in part.splitlines() if line.startswith("    ")]
        (tmp_path / f"{name}.yaml").write_text("\n".join(lines))
    floor = read_floor(tmp_path / "floor.yaml")
    assert [marker.name for marker in floor.ordered] == ["c1", "c2", "c3", "c4", "k1"]
    assert len(floor.lengths) == 6
    scene = read_scene(tmp_path / "scene.yaml")
    assert scene.cones.places == {"1": (0.5, 0.4), "2": (1.1, 0.9)}
    assert scene.car == Scene().car


def test_any_camera_is_a_source(tmp_path: Path) -> None:
    """A live camera is a device like a folder of pictures that is played."""
    shown = [one.image for one in pictures(CHARUCO, 3)]
    device = ImageFolder(
        ImageFolderConfig(save(tmp_path / "live", shown), rate_hz=10.0, real_time=False)
    )
    skipped = Skipped()
    taken = list(pictures_from(device, skipped, lambda: device.finished, patience_s=1.0))
    assert [one.name for one in taken] == ["frame 0", "frame 1", "frame 2"]
    np.testing.assert_array_equal(taken[1].image, shown[1])
