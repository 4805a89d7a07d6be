"""The calibrations of the cameras as files: dated, never overwritten, read back whole.

`camera_DATE.yaml` is the inside of a camera, `world_DATE.yaml` its place above the floor,
`stereo_DATE.yaml` the two eyes on the car. All say how they were made, how far off each measurement
was, and whether they were accepted.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

import numpy as np

from capture.configuration import read_configuration
from capture.errors import CalibrationFileError, ConfigurationError
from capture.session_info import software
from capture.yaml_file import plain, write_yaml
from geometry import Camera, Floats, Mounting, RingShape, StereoPair, View

FORMAT = 1
Rows: TypeAlias = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class ViewResidual:
    """One picture of a board: how many points it gave, how far off they were, whether it counts."""

    name: str
    points: int
    rms_px: float
    used: bool = True
    why: str = ""


@dataclass(frozen=True, kw_only=True)
class CameraCalibration:
    """The content of `camera_DATE.yaml`.

    covariance : (9, 9) of fx, fy, cx, cy, k1, k2, p1, p2, k3. coverage : share of the picture in
    which there were points. how : board, source, options.
    """

    format: int = FORMAT
    kind: Literal["camera"] = "camera"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    camera: Camera
    covariance: Rows
    rms_px: float
    coverage: float
    views: tuple[ViewResidual, ...]
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        _check(self.format, self.covariance, 9)

    @cached_property
    def covariance_matrix(self) -> Floats:
        """(9, 9)."""
        return np.array(self.covariance)


@dataclass(frozen=True, kw_only=True)
class PlacedMarker:
    """A ring of known place. corner : 1 to 4, or None.

    covariance_m2 : sxx, sxy, syy. residual_px : how far from there the camera saw it.
    """

    name: str
    xyz_m: tuple[float, float, float]
    covariance_m2: tuple[float, float, float]
    residual_px: float
    corner: int | None = None


@dataclass(frozen=True, kw_only=True)
class LengthResidual:
    """A length between two markers as it was measured, and how much longer the fit has it."""

    markers: tuple[str, ...]
    length_m: float
    sigma_m: float
    residual_m: float


@dataclass(frozen=True, kw_only=True)
class WorldCalibration:
    """The content of `world_DATE.yaml`: a camera in its place above the floor.

    camera : as adjusted together with the floor. rotation, translation_m : world into camera.
    covariance : (15, 15) of the camera's nine parameters, turn and translation
    (`geometry.uncertainty`). accuracy_m : predicted standard deviations, by height.
    """

    format: int = FORMAT
    kind: Literal["world"] = "world"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    camera: Camera
    rotation: Rows
    translation_m: tuple[float, float, float]
    covariance: Rows
    ring: RingShape
    markers: tuple[PlacedMarker, ...]
    lengths: tuple[LengthResidual, ...]
    accuracy_m: Mapping[str, float]
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        _check(self.format, self.covariance, 15)

    @cached_property
    def view(self) -> View:
        """The camera in its place."""
        return View(self.camera, np.array(self.rotation), np.array(self.translation_m))

    @cached_property
    def covariance_matrix(self) -> Floats:
        """(15, 15)."""
        return np.array(self.covariance)


@dataclass(frozen=True, kw_only=True)
class StereoCalibration:
    """The content of `stereo_DATE.yaml`: two eyes, and where the left one sits on the car.

    rotation, translation_m : x_right = R x_left + t in a camera's axes (right, down, ahead).
    rotation_sigma_rad, translation_sigma_m : standard deviations (3,); rms_px : of the board's
    points; epipolar_rms_px : how far the two images of a point are from one row, rectified. These
    are None where a factory did not tell them.
    """

    format: int = FORMAT
    kind: Literal["stereo"] = "stereo"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    left: Camera
    right: Camera
    rotation: Rows
    translation_m: tuple[float, ...]
    mounting: Mounting = field(default_factory=Mounting)
    rotation_sigma_rad: tuple[float, ...] | None = None
    translation_sigma_m: tuple[float, ...] | None = None
    rms_px: float | None = None
    epipolar_rms_px: float | None = None
    views: tuple[ViewResidual, ...] = ()
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        _check_format(self.format)
        _ = self.pair  # its own checks: a rotation, the right eye to the right

    @classmethod
    def of_pair(
        cls,
        pair: StereoPair,
        mounting: Mounting,
        *,
        made_utc: str,
        how: Mapping[str, object],
    ) -> StereoCalibration:
        """That of a pair which is known, and so accepted."""
        return cls(
            made_utc=made_utc,
            accepted=True,
            left=pair.left,
            right=pair.right,
            rotation=tuple(tuple(row) for row in pair.rotation.tolist()),
            translation_m=tuple(pair.translation.tolist()),
            mounting=mounting,
            how=how,
        )

    @cached_property
    def pair(self) -> StereoPair:
        """The two eyes."""
        return StereoPair(
            self.left, self.right, np.array(self.rotation), np.array(self.translation_m)
        )


@dataclass(frozen=True, kw_only=True)
class DelayOfSession:
    """What one joined session tells of the camera's delay."""

    name: str
    delay_s: float
    sigma_s: float
    residual_s: float


@dataclass(frozen=True, kw_only=True)
class CameraDelayCalibration:
    """The content of `camera-delay_DATE.yaml`: by how much the overhead camera stamps wrong.

    delay_s : offset of the clocks by the data minus that by the network, car minus film; below 0
    where the camera's stamps are late (or the gyro's early). scatter_s : between the sessions.
    """

    format: int = FORMAT
    kind: Literal["camera-delay"] = "camera-delay"
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    delay_s: float
    sigma_s: float
    scatter_s: float
    sessions: tuple[DelayOfSession, ...]
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        _check_format(self.format)


Calibration: TypeAlias = (
    CameraCalibration | WorldCalibration | StereoCalibration | CameraDelayCalibration
)
_Kind = TypeVar("_Kind")


def now_utc() -> str:
    """The present second as ISO 8601, UTC."""
    return datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def write_calibration(folder: Path, calibration: Calibration) -> Path:
    """Write `KIND_DATE.yaml` into a folder, which is made; its path.

    Raises `CalibrationFileError` when a file of that name exists: nothing is ever overwritten.
    """
    stamp = calibration.made_utc.replace("-", "").replace(":", "")
    file = folder / f"{calibration.kind}_{stamp}.yaml"
    if file.exists():
        raise CalibrationFileError(
            f"{file}: exists already and is never overwritten; wait a second, or choose another "
            "folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    names = [field.name for field in dataclasses.fields(calibration)]
    write_yaml(file, {name: plain(getattr(calibration, name)) for name in names})
    return file


def read_camera_calibration(place: Path) -> CameraCalibration:
    """The camera of a file, or of the newest `camera_*.yaml` of a folder."""
    return _read(CameraCalibration, place, "camera")


def read_world_calibration(place: Path) -> WorldCalibration:
    """The world of a file, or of the newest `world_*.yaml` of a folder."""
    return _read(WorldCalibration, place, "world")


def read_stereo_calibration(place: Path) -> StereoCalibration:
    """The eyes of a file, or of the newest `stereo_*.yaml` of a folder."""
    return _read(StereoCalibration, place, "stereo")


def read_camera_delay(place: Path) -> CameraDelayCalibration:
    """The camera's delay of a file, or of the newest `camera-delay_*.yaml` of a folder."""
    return _read(CameraDelayCalibration, place, "camera-delay")


def calibration_file(place: Path, kind: str) -> Path:
    """The file itself, or the newest of that kind in a folder; raises `CalibrationFileError`."""
    if place.is_file():
        return place
    if not place.is_dir():
        raise CalibrationFileError(
            f"{place}: there is no such file or folder; trackside calibrate {kind} makes one"
        )
    # The date is the name, so the last name is the newest file.
    found = sorted(place.glob(f"{kind}_*.yaml"))
    if not found:
        raise CalibrationFileError(
            f"{place}: holds no {kind}_*.yaml; trackside calibrate {kind} -o {place} makes one"
        )
    return found[-1]


def _read(kind: type[_Kind], place: Path, name: str) -> _Kind:
    file = calibration_file(place, name)
    try:
        return read_configuration(kind, file)
    except ConfigurationError as err:
        raise CalibrationFileError(
            f"{file}: is no {name} calibration that we can read: {err}"
        ) from err


def _check_format(number: int) -> None:
    if number != FORMAT:
        raise ValueError(f"format {number} is not known; this trackside reads {FORMAT}")


def _check(number: int, covariance: Rows, size: int) -> None:
    _check_format(number)
    if len(covariance) != size or any(len(row) != size for row in covariance):
        raise ValueError(f"covariance must have {size} rows of {size} numbers")
