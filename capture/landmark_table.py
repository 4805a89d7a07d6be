"""Landmark maps as CSV: the true ones (`cones.csv`) and the estimated ones (`map.csv`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from capture.csv_table import (
    CsvTable,
    integer_texts,
    number_texts,
    read_csv,
    stamp_texts,
    write_csv,
)
from capture.errors import TextFileError
from capture.estimate import EstimatedMap
from geometry import Floats, LandmarkMap, LandmarkMapError, Stamps

_REQUIRED = ("id", "x", "y")
_COVARIANCE = ("sxx", "sxy", "syy")
_PATH_COVARIANCE = ("sxx", "sxy", "syy", "sxh", "syh", "shh")
_UPPER = ((0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2))


def read_landmarks(file: Path) -> LandmarkMap:
    """The landmarks in a CSV file with the columns id, x, y and, if all are given, sxx, sxy, syy.

    Raises `TextFileError` naming the line: no header, repeated ids, cells that are no numbers.
    """
    return _landmarks(read_csv(file, _REQUIRED))


def write_landmarks(file: Path, landmarks: LandmarkMap) -> None:
    """Write id, x, y and, where they are known, sxx, sxy, syy; metres and square metres."""
    write_csv(file, _landmark_columns(landmarks))


def read_estimated_map(file: Path) -> EstimatedMap:
    """The map in a CSV file: as `read_landmarks`, and how each landmark entered the map.

    Optional columns: t_added, t_first (seconds), x_added, y_added (where the car then stood),
    range_added (metres), n_seen. Raises `TextFileError` as `read_landmarks`.
    """
    table = read_csv(file, _REQUIRED)
    landmarks = _landmarks(table)
    added_from = None
    if "x_added" in table and "y_added" in table:
        added_from = np.stack([table.numbers("x_added"), table.numbers("y_added")], axis=1)
    return EstimatedMap(
        landmarks,
        t_added_ns=table.stamps("t_added") if "t_added" in table else None,
        added_from=added_from,
        range_added_m=table.numbers("range_added") if "range_added" in table else None,
        n_seen=table.integers("n_seen") if "n_seen" in table else None,
        t_first_ns=table.stamps("t_first") if "t_first" in table else None,
    )


def write_estimated_map(file: Path, estimated: EstimatedMap) -> None:
    """Write a map so that `read_estimated_map` gives the same back; only known columns."""
    columns = _landmark_columns(estimated.landmarks)
    if estimated.t_added_ns is not None:
        columns["t_added"] = stamp_texts(estimated.t_added_ns)
    if estimated.added_from is not None:
        columns["x_added"] = number_texts(estimated.added_from[:, 0])
        columns["y_added"] = number_texts(estimated.added_from[:, 1])
    if estimated.n_seen is not None:
        columns["n_seen"] = integer_texts(estimated.n_seen)
    if estimated.range_added_m is not None:
        columns["range_added"] = number_texts(estimated.range_added_m)
    if estimated.t_first_ns is not None:
        columns["t_first"] = stamp_texts(estimated.t_first_ns)
    write_csv(file, columns)


def read_path_covariance(file: Path) -> tuple[Stamps, Floats]:
    """Stamps (n,) and covariances (n, 3, 3) of x, y, heading (m, rad) of the poses of a path."""
    table = read_csv(file, ("t", *_PATH_COVARIANCE))
    t_ns = table.stamps("t", required=True)
    table.refuse_repeated("t", t_ns)
    covariances = np.zeros((t_ns.size, 3, 3))
    for name, row, column in zip(_PATH_COVARIANCE, *_UPPER, strict=True):
        covariances[:, row, column] = covariances[:, column, row] = table.numbers(
            name, required=True
        )
    return t_ns, covariances


def read_bridged(file: Path) -> npt.NDArray[np.bool_] | None:
    """The column `bridged` (n,) of a path's covariances; None where file or column is missing."""
    if not file.exists():
        return None
    table = read_csv(file, ("t",))
    return table.integers("bridged", required=True) != 0 if "bridged" in table else None


def write_path_covariance(
    file: Path,
    t_ns: Stamps,
    covariances: Floats,
    *,
    bridged: npt.NDArray[np.bool_] | None = None,
) -> None:
    """Write covariances (n, 3, 3) of the poses at `t_ns` (n,), and which were bridged (n,)."""
    columns = {"t": stamp_texts(t_ns)}
    for name, row, column in zip(_PATH_COVARIANCE, *_UPPER, strict=True):
        columns[name] = number_texts(covariances[:, row, column])
    if bridged is not None:
        columns["bridged"] = integer_texts(bridged.astype(np.int64))
    write_csv(file, columns)


def _landmark_columns(landmarks: LandmarkMap) -> dict[str, list[str]]:
    columns = {
        "id": integer_texts(landmarks.ids),
        "x": number_texts(landmarks.positions[:, 0]),
        "y": number_texts(landmarks.positions[:, 1]),
    }
    if landmarks.covariances is not None:
        for name, row, column in zip(_COVARIANCE, (0, 0, 1), (0, 1, 1), strict=True):
            columns[name] = number_texts(landmarks.covariances[:, row, column])
    return columns


def _landmarks(table: CsvTable) -> LandmarkMap:
    ids = table.integers("id", required=True)
    table.refuse_repeated("id", ids)
    positions = np.stack([table.numbers(axis, required=True) for axis in ("x", "y")], axis=1)
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if bad.size:
        raise TextFileError(
            f"{table.file}:{table.lines[bad[0]]}: the position of landmark {ids[bad[0]]} is not "
            "finite; expected metres; delete the line if the place is unknown"
        )
    try:
        return LandmarkMap(ids, positions, _covariances(table))
    except LandmarkMapError as err:
        raise TextFileError(f"{table.file}: {err}; correct or empty its sxx, sxy, syy") from err


def _covariances(table: CsvTable) -> Floats | None:
    """(n, 2, 2), or None where the table claims none."""
    if not all(name in table for name in _COVARIANCE):
        return None
    sxx, sxy, syy = (table.numbers(name) for name in _COVARIANCE)
    known = np.isfinite(np.stack([sxx, sxy, syy], axis=1)).all(axis=1)
    if not known.any():
        return None
    if not known.all():
        line = table.lines[np.flatnonzero(~known)[0]]
        raise TextFileError(
            f"{table.file}:{line}: no covariance, while other landmarks have one; expected "
            "sxx, sxy, syy in every line or in none"
        )
    return np.stack([np.stack([sxx, sxy], axis=1), np.stack([sxy, syy], axis=1)], axis=1)
