from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.camera import CameraFileError, parse_zed_settings, read_zed_settings
from drivers.camera.zed import ZED_MODES

EYE = "fx={fx}\nfy={fx}\ncx={cx}\ncy={cy}\nk1=-0.1743\nk2=0.0278\n"
# One eye's focal length and centre by mode: numbers of the order of a real ZED's.
EYES = {
    "2K": (1400, 1104, 621),
    "FHD": (1400, 960, 540),
    "HD": (700, 640, 360),
    "VGA": (350, 336, 188),
}
TURN = {"RX": -0.0047, "CV": 0.0085, "RZ": -0.0015}


def settings(extra: str = "", baseline: str = "119.9") -> str:
    """A file with all modes; the right eye's numbers are a little larger."""
    parts = []
    for name, (fx, cx, cy) in EYES.items():
        parts.append(f"[LEFT_CAM_{name}]\n" + EYE.format(fx=fx, cx=cx, cy=cy))
        parts.append(f"[RIGHT_CAM_{name}]\n" + EYE.format(fx=fx + 1.5, cx=cx + 2, cy=cy + 3))
    stereo = "".join(f"{key}_{name}={v}\n" for name in EYES for key, v in TURN.items())
    return "\n".join(parts) + f"\n[STEREO]\nBaseline={baseline}\n{stereo}{extra}"


@pytest.mark.parametrize("mode", list(ZED_MODES))
def test_every_mode_has_its_own_eyes(mode: str) -> None:
    found = parse_zed_settings(settings(), mode)
    fx, cx, cy = EYES[ZED_MODES[mode].settings_name]
    np.testing.assert_array_equal(found.left.matrix, [[fx, 0, cx], [0, fx, cy], [0, 0, 1]])
    np.testing.assert_array_equal(
        found.right.matrix, [[fx + 1.5, 0, cx + 2], [0, fx + 1.5, cy + 3], [0, 0, 1]]
    )
    assert found.eye_size_px == (ZED_MODES[mode].eye_width_px, ZED_MODES[mode].eye_height_px)


def test_distortion_is_in_opencvs_order() -> None:
    text = settings().replace("k2=0.0278\n", "k2=0.0278\nk3=5\np1=3\np2=4\n")
    found = parse_zed_settings(text, "HD720")
    np.testing.assert_array_equal(found.left.distortion, [-0.1743, 0.0278, 3, 4, 5])
    plain = parse_zed_settings(settings(), "HD720")
    np.testing.assert_array_equal(plain.left.distortion, [-0.1743, 0.0278, 0, 0, 0])


@pytest.mark.parametrize("mode", list(ZED_MODES))
def test_rectified_with_opencv_the_right_eye_is_on_the_right(mode: str) -> None:
    found = parse_zed_settings(settings("TY=0.2\nTZ=-0.4\n"), mode)
    _, _, p1, p2, _, _, _ = cv2.stereoRectify(
        found.left.matrix,
        found.left.distortion,
        found.right.matrix,
        found.right.distortion,
        found.eye_size_px,
        found.rotation,
        found.translation_m,
        flags=cv2.CALIB_ZERO_DISPARITY,
        alpha=0,
    )
    assert p2[0, 3] < 0
    distance_m = np.linalg.norm(found.translation_m)
    assert -p2[0, 3] / p2[0, 0] == pytest.approx(distance_m, rel=1e-9)
    assert p2[1, 3] == pytest.approx(0.0, abs=1e-9)
    # A point a metre ahead is seen further left by the right eye.
    point = np.array([0.0, 0.0, 1.0, 1.0])
    left, right = p1 @ point, p2 @ point
    assert left[0] / left[2] > right[0] / right[2]


def test_rotation_and_translation_are_si() -> None:
    found = parse_zed_settings(settings("TY=0.2\nTZ=-0.4\n"), "HD720")
    np.testing.assert_allclose(found.translation_m, [-0.1199, 0.0002, -0.0004], atol=1e-15)
    assert found.baseline_m == pytest.approx(0.1199)
    back, _ = cv2.Rodrigues(found.rotation)
    np.testing.assert_allclose(back.ravel(), [-0.0047, 0.0085, -0.0015], atol=1e-12)
    assert not found.rotation.flags.writeable
    assert not found.left.matrix.flags.writeable


@pytest.mark.parametrize(
    ("extra", "expected_mm"),
    [
        ("", (0.0, 0.0)),
        ("TY=1\nTZ=2\n", (1.0, 2.0)),
        ("TY=1\nTZ=2\nTY_HD=3\nTZ_HD=4\n", (3.0, 4.0)),
        ("TY_VGA=3\nTZ_VGA=4\n", (0.0, 0.0)),
        ("TY_HD=3\n", (3.0, 0.0)),
    ],
)
def test_offsets_once_or_by_mode_or_not_at_all(
    extra: str, expected_mm: tuple[float, float]
) -> None:
    found = parse_zed_settings(settings(extra), "HD720")
    np.testing.assert_allclose(found.translation_m[1:] * 1e3, expected_mm)


def test_case_spaces_and_a_byte_order_mark_do_not_matter() -> None:
    text = "\ufeff" + settings().replace("Baseline=", "BaseLine = ").replace("\n", "\r\n")
    assert parse_zed_settings(text, "VGA").baseline_m == pytest.approx(0.1199)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            settings().replace("[RIGHT_CAM_HD]", "[OTHER]"),
            r"\[RIGHT_CAM_HD\] is missing; there are",
        ),
        (settings().replace("RX_HD=", "RX_H="), r"\[STEREO\] has no RX_HD"),
        (settings(baseline="twelve"), r"Baseline is 'twelve'; a number was expected"),
        (settings(baseline="-120"), "Baseline is -120; a distance in mm, above 0"),
        (settings(baseline="nan"), "a finite number was expected"),
        (settings().replace("fx=700\n", "fx=0\n"), "pixels above 0 were expected"),
        ("<html>not found</html>", "is no settings file .* an INI file was expected"),
        ("", r"the section \[STEREO\] is missing; there are: none"),
    ],
)
def test_a_file_with_a_fault_names_it(text: str, message: str) -> None:
    with pytest.raises(CameraFileError, match=f"^SN1.conf: .*{message}"):
        parse_zed_settings(text, "HD720", name="SN1.conf")


def test_an_unknown_mode() -> None:
    with pytest.raises(ValueError, match="'4K' is none of HD2K, HD1080, HD720, VGA"):
        parse_zed_settings(settings(), "4K")


def test_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "SN12345.conf"
    with pytest.raises(CameraFileError, match=r"SN12345.conf: cannot be read .*calib.stereolabs"):
        read_zed_settings(file, "HD720")
    file.write_text(settings(), encoding="utf-8")
    assert read_zed_settings(file, "HD720").mode == "HD720"
