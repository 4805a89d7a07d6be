"""The calibrations as files: dated, never overwritten, read back whole.

`camera_DATE.yaml` is the inside of a camera, `world_DATE.yaml` its place above the floor, those of
the car are lists of parameters (`MeasuredCalibration`). All say how they were made, what was left
over, and whether they were accepted. `KINDS` is the table of all of them.
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
from geometry import Camera, Floats, RingShape, View

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


@dataclass(frozen=True)
class Parameter:
    """One number that was calibrated; its name tells the unit.

    sigma : standard deviation, None where nothing is claimed. source : "data", or in words what
    else it rests on (a tape measure, a prior, the rig).
    """

    name: str
    value: float
    sigma: float | None = None
    source: str = "data"


@dataclass(frozen=True, kw_only=True)
class MeasuredCalibration:
    """The content of `odometry_DATE.yaml`, `imu_DATE.yaml`, `lidar_DATE.yaml`, `markers_DATE.yaml`.

    covariance : of the first parameters, in their order, as many as it has rows; residuals : what
    was left over, names with units; how : sources, options, limits. Raises `ValueError` for another
    format or a covariance that does not fit.
    """

    format: int = FORMAT
    kind: Literal["odometry", "imu", "lidar", "markers"]
    made_utc: str
    accepted: bool
    reasons: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...]
    covariance: Rows = ()
    residuals: Mapping[str, float] = field(default_factory=dict)
    how: Mapping[str, object] = field(default_factory=dict)
    software: str = field(default_factory=software)

    def __post_init__(self) -> None:
        _check(self.format, self.covariance, min(len(self.covariance), len(self.parameters)))

    def value(self, name: str) -> float | None:
        """The value of a parameter, None where it was not calibrated."""
        return next((one.value for one in self.parameters if one.name == name), None)

    @cached_property
    def correlation(self) -> Floats:
        """(k, k) of the parameters that `covariance` is of."""
        covariance = np.array(self.covariance).reshape(len(self.covariance), len(self.covariance))
        sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        return np.asarray(covariance / np.outer(sigma, sigma))


Calibration: TypeAlias = CameraCalibration | WorldCalibration | MeasuredCalibration
_Kind = TypeVar("_Kind")

KINDS: dict[str, type[Calibration]] = {
    "camera": CameraCalibration,
    "world": WorldCalibration,
    "odometry": MeasuredCalibration,
    "imu": MeasuredCalibration,
    "lidar": MeasuredCalibration,
    "markers": MeasuredCalibration,
}
"""Kind, which is what the name of its files begins with -> what is in them."""


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


def read_measured_calibration(place: Path, kind: str) -> MeasuredCalibration:
    """A calibration of the car, of a file or of the newest one of that kind in a folder."""
    return _read(MeasuredCalibration, place, kind)


def read_calibration(place: Path, kind: str) -> Calibration:
    """A calibration of any of the `KINDS`, of a file or of the newest of a folder."""
    return _read(KINDS[kind], place, kind)


def kind_of(file: Path) -> str | None:
    """What kind of calibration a file is by its name, None for any other file."""
    kind = file.stem.rpartition("_")[0]
    return kind if file.suffix == ".yaml" and kind in KINDS else None


def accepted_file(folder: Path, kind: str) -> Path | None:
    """The newest accepted calibration of a kind in a folder, None where there is none.

    Raises `CalibrationFileError` for a newer file that cannot be read.
    """
    for file in sorted(folder.glob(f"{kind}_*.yaml"), reverse=True):
        if kind_of(file) == kind and read_calibration(file, kind).accepted:
            return file
    return None


def accepted_files(folder: Path) -> tuple[Path, ...]:
    """The newest accepted calibration of every kind that a folder has one of."""
    found = [accepted_file(folder, kind) for kind in KINDS]
    return tuple(file for file in found if file is not None)


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


def _check(number: int, covariance: Rows, size: int) -> None:
    if number != FORMAT:
        raise ValueError(f"format {number} is not known; this trackside reads {FORMAT}")
    if len(covariance) != size or any(len(row) != size for row in covariance):
        raise ValueError(f"covariance must have {size} rows of {size} numbers")
