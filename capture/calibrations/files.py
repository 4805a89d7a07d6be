"""Every kind of calibration, and its file: dated, never overwritten, the newest accepted counts."""

from __future__ import annotations

import dataclasses
from datetime import datetime, timezone
from pathlib import Path
from typing import TypeAlias, TypeVar

from capture.calibrations.measured import MeasuredCalibration
from capture.calibrations.overhead import (
    CameraCalibration,
    CameraDelayCalibration,
    WorldCalibration,
)
from capture.calibrations.stereo import StereoCalibration
from capture.configuration import read_configuration
from capture.errors import CalibrationFileError, ConfigurationError
from capture.yaml_file import plain, write_yaml

Calibration: TypeAlias = (
    CameraCalibration
    | WorldCalibration
    | CameraDelayCalibration
    | StereoCalibration
    | MeasuredCalibration
)
_Kind = TypeVar("_Kind")

KINDS: dict[str, type[Calibration]] = {
    "camera": CameraCalibration,
    "world": WorldCalibration,
    "camera-delay": CameraDelayCalibration,
    "stereo": StereoCalibration,
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


def read_camera_delay(place: Path) -> CameraDelayCalibration:
    """The camera's delay of a file, or of the newest `camera-delay_*.yaml` of a folder."""
    return _read(CameraDelayCalibration, place, "camera-delay")


def read_stereo_calibration(place: Path) -> StereoCalibration:
    """The eyes of a file, or of the newest `stereo_*.yaml` of a folder."""
    return _read(StereoCalibration, place, "stereo")


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
