"""The factory calibration of a ZED: `SN<serial>.conf` (reference: protocols.md D.2).

Pure: text in, numbers out. The file is in /usr/local/zed/settings where the SDK is installed.
"""

from __future__ import annotations

import configparser
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from drivers.camera.errors import CameraFileError
from drivers.camera.zed.modes import ZED_MODES

Floats: TypeAlias = npt.NDArray[np.float64]
MILLIMETRE = 1e-3


@dataclass(frozen=True, eq=False)
class EyeCalibration:
    """matrix : (3, 3) in pixels of one eye; distortion : (5,) as OpenCV: k1, k2, p1, p2, k3."""

    matrix: Floats
    distortion: Floats


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """Both eyes of one mode, and what takes a point from the left eye to the right one.

    x_right = rotation @ x_left + translation_m, in OpenCV's axes (x right, y down, z ahead), as
    `cv2.stereoRectify` takes them: the right eye is at positive x, so translation_m[0] is negative.
    """

    mode: str
    left: EyeCalibration
    right: EyeCalibration
    rotation: Floats
    translation_m: Floats

    @property
    def eye_size_px(self) -> tuple[int, int]:
        """Width and height of one eye."""
        return ZED_MODES[self.mode].eye_width_px, ZED_MODES[self.mode].eye_height_px

    @property
    def baseline_m(self) -> float:
        """How far the eyes are apart, along the left eye's x."""
        return -float(self.translation_m[0])


def read_zed_settings(file: Path, mode: str) -> StereoCalibration:
    """The calibration for a mode out of a settings file; raises `CameraFileError`."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as err:
        raise CameraFileError(
            f"{file}: cannot be read ({err.strerror}); the settings of a ZED are in "
            "/usr/local/zed/settings or at http://calib.stereolabs.com/?SN=SERIAL (the serial "
            "number is on the camera)"
        ) from err
    return parse_zed_settings(text, mode, name=str(file))


def parse_zed_settings(text: str, mode: str, *, name: str = "ZED settings") -> StereoCalibration:
    """The calibration for a mode of `ZED_MODES` out of the text of a settings file.

    TY and TZ may be there once, for each mode, or not at all (then 0).
    Raises `CameraFileError` that names the section and key, `ValueError` for an unknown mode.
    """
    import cv2

    if mode not in ZED_MODES:
        raise ValueError(f"mode {mode!r} is none of {', '.join(ZED_MODES)}")
    suffix = ZED_MODES[mode].settings_name
    numbers = _Numbers(text, name)
    stereo = "STEREO"
    turn = [numbers.get(stereo, f"{axis}_{suffix}") for axis in ("RX", "CV", "RZ")]
    translation_mm = [
        -numbers.get(stereo, "Baseline"),
        numbers.get_either(stereo, f"TY_{suffix}", "TY"),
        numbers.get_either(stereo, f"TZ_{suffix}", "TZ"),
    ]
    if translation_mm[0] >= 0:
        raise numbers.fault(
            f"[STEREO] Baseline is {-translation_mm[0]:g}; a distance in mm, above 0, was expected"
        )
    rotation, _ = cv2.Rodrigues(np.array(turn, dtype=np.float64))
    return StereoCalibration(
        mode,
        _eye(numbers, f"LEFT_CAM_{suffix}"),
        _eye(numbers, f"RIGHT_CAM_{suffix}"),
        _frozen(rotation),
        _frozen(np.array(translation_mm) * MILLIMETRE),
    )


class _Numbers:
    """The file's numbers by section and key, whatever their case."""

    def __init__(self, text: str, name: str) -> None:
        self._name = name
        self._parser = configparser.ConfigParser(strict=False, interpolation=None)
        try:
            self._parser.read_string(text.lstrip("\ufeff"), source=name)
        except configparser.Error as err:
            reason = " ".join(str(err).split())
            raise self.fault(f"is no settings file ({reason}); an INI file was expected") from err

    def fault(self, what: str) -> CameraFileError:
        """The error for this file."""
        return CameraFileError(f"{self._name}: {what}; fetch the file again")

    def get(self, section: str, key: str) -> float:
        """A number that must be there."""
        if not self._parser.has_section(section):
            there = ", ".join(self._parser.sections()) or "none"
            raise self.fault(f"the section [{section}] is missing; there are: {there}")
        text = self._parser.get(section, key, fallback=None)
        if text is None:
            raise self.fault(f"[{section}] has no {key}")
        try:
            value = float(text)
        except ValueError as err:
            raise self.fault(f"[{section}] {key} is {text!r}; a number was expected") from err
        if not np.isfinite(value):
            raise self.fault(f"[{section}] {key} is {text!r}; a finite number was expected")
        return value

    def get_either(self, section: str, key: str, other: str) -> float:
        """The first of two numbers that is there, else 0."""
        for one in (key, other):
            if self._parser.has_option(section, one):
                return self.get(section, one)
        return 0.0

    def get_or_zero(self, section: str, key: str) -> float:
        """A number that may be missing, then 0."""
        return self.get_either(section, key, key)


def _eye(numbers: _Numbers, section: str) -> EyeCalibration:
    fx, fy, cx, cy = (numbers.get(section, key) for key in ("fx", "fy", "cx", "cy"))
    if fx <= 0 or fy <= 0:
        raise numbers.fault(f"[{section}] fx, fy are {fx:g}, {fy:g}; pixels above 0 were expected")
    k1, k2 = numbers.get(section, "k1"), numbers.get(section, "k2")
    # Files of early cameras have neither k3 nor the tangential terms.
    p1, p2, k3 = (numbers.get_or_zero(section, key) for key in ("p1", "p2", "k3"))
    return EyeCalibration(
        _frozen(np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])),
        _frozen(np.array([k1, k2, p1, p2, k3])),
    )


def _frozen(values: npt.ArrayLike) -> Floats:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
