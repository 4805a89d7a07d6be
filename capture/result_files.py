"""Truth and estimates as folders of text files inside a session."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from capture.errors import MissingStreamError, TextFileError
from capture.estimate import Estimate, GroundTruth
from capture.landmark_table import (
    read_bridged,
    read_estimated_map,
    read_landmarks,
    read_path_covariance,
    write_estimated_map,
    write_landmarks,
    write_path_covariance,
)
from capture.transaction import new_folder
from capture.tum import read_planar_tum, write_tum
from capture.yaml_file import read_yaml, write_yaml
from dialogue import UsageError
from geometry import Floats, Trajectory

_FORMAT = 1
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")


def checked_name(name: str) -> str:
    """The name of an estimate, fit to be a folder's; raises `UsageError` otherwise."""
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"{name!r} cannot name an estimate; use letters, digits and . _ + - "
            "and begin with a letter or digit"
        )
    return name


def write_ground_truth(folder: Path, truth: GroundTruth, *, replace: bool = False) -> None:
    """Write `car.tum`, `ground_truth.yaml`, and where known `cones.csv`, `car_covariance.csv`."""
    with new_folder(folder, replace=replace) as partial:
        write_tum(partial / "car.tum", truth.path)
        if truth.landmarks is not None:
            write_landmarks(partial / "cones.csv", truth.landmarks)
        if truth.path_covariances is not None:
            covariances, stamps = truth.path_covariances, truth.path.t_ns
            write_path_covariance(
                partial / "car_covariance.csv", stamps, covariances, bridged=truth.bridged
            )
        _write_provenance(partial / "ground_truth.yaml", truth.provenance)


def read_ground_truth(folder: Path) -> GroundTruth:
    """The truth in a folder; raises `TextFileError` when a file of it is wrong."""
    path, _ = read_planar_tum(folder / "car.tum")
    cones = folder / "cones.csv"
    landmarks = read_landmarks(cones) if cones.exists() else None
    provenance = _read_provenance(folder / "ground_truth.yaml")
    file = folder / "car_covariance.csv"
    return GroundTruth(
        path, landmarks, provenance, _read_path_covariances(file, path), read_bridged(file)
    )


def write_estimate(folder: Path, estimate: Estimate, *, replace: bool = False) -> None:
    """Write `path.tum`, `map.csv`, `path_covariance.csv` where known, and `estimate.yaml`."""
    checked_name(estimate.name)
    with new_folder(folder, replace=replace) as partial:
        write_tum(partial / "path.tum", estimate.path)
        if estimate.map is not None:
            write_estimated_map(partial / "map.csv", estimate.map)
        if estimate.path_covariances is not None:
            covariances = estimate.path_covariances
            write_path_covariance(partial / "path_covariance.csv", estimate.path.t_ns, covariances)
        _write_provenance(partial / "estimate.yaml", estimate.provenance)


def read_estimate(folder: Path) -> Estimate:
    """The estimate in a folder, named as the folder.

    Raises `MissingStreamError` when there is none, `TextFileError` when a file of it is wrong.
    """
    if not (folder / "path.tum").exists():
        raise MissingStreamError(f"{folder}: holds no path.tum; expected an estimate")
    path, _ = read_planar_tum(folder / "path.tum")
    landmarks = folder / "map.csv"
    return Estimate(
        folder.name,
        path,
        read_estimated_map(landmarks) if landmarks.exists() else None,
        _read_path_covariances(folder / "path_covariance.csv", path),
        _read_provenance(folder / "estimate.yaml"),
    )


def _read_path_covariances(file: Path, path: Trajectory) -> Floats | None:
    if not file.exists():
        return None
    t_ns, covariances = read_path_covariance(file)
    if not np.array_equal(t_ns, path.t_ns):
        raise TextFileError(
            f"{file}: its {t_ns.size} stamps are not those of the {len(path)} poses of the path; "
            "expected a line for each pose; write the estimate again"
        )
    return covariances


def _write_provenance(file: Path, provenance: Mapping[str, object]) -> None:
    write_yaml(file, {"format": _FORMAT, "provenance": provenance})


def _read_provenance(file: Path) -> Mapping[str, object]:
    if not file.exists():
        return {}
    provenance = read_yaml(file).get("provenance", {})
    return provenance if isinstance(provenance, dict) else {}
