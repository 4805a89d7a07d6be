"""UTIAS MRCLAM data sets -> sessions.

Leung, Halpern, Barfoot, Liu, "The UTIAS multi-robot cooperative localization and mapping dataset",
IJRR 30 (2011): five robots among fifteen landmarks, odometry, range and bearing of barcodes, Vicon
truth. Landmark ids are the subject numbers 6 to 20; subjects 1 to 5 are the robots themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import numpy.typing as npt

from capture.errors import TextFileError
from capture.estimate import GroundTruth
from capture.log_columns import integrated
from capture.number_rows import NumberRows, read_number_rows
from capture.session import Session
from capture.session_info import SessionInfo
from capture.streams import Observations, Odometry
from dialogue import UsageError
from geometry import LandmarkMap, Trajectory, wrap

SOURCE = "wheel"
ROBOTS = (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class MrclamImport:
    """What an import took, and what it left out."""

    odometry: int
    observations: int
    truth_poses: int
    landmarks: int
    robot_sightings: int
    unknown_barcodes: int
    repeated_truth_stamps: int
    repeated_odometry_stamps: int


def import_mrclam(folder: Path, robot: int, target: Path) -> MrclamImport:
    """Make the session `target` of one robot of a data set; gives the counts.

    Raises `UsageError` for a robot that is not there, `TextFileError` for a malformed file,
    `SessionError` when the target exists.
    """
    if not (folder / f"Robot{robot}_Odometry.dat").exists():
        there = sorted(file.name[5:-13] for file in folder.glob("Robot*_Odometry.dat"))
        raise UsageError(
            f"{folder}: has no robot {robot}; robots there: {', '.join(there) or 'none'}; "
            "expected an unpacked MRCLAM_Dataset folder and --robot N"
        )
    odometry, repeated_odometry = _read_odometry(folder / f"Robot{robot}_Odometry.dat")
    observations, sightings, unknown = _read_observations(
        folder / f"Robot{robot}_Measurement.dat", _read_subjects(folder / "Barcodes.dat")
    )
    path, repeated_truth = _read_truth(folder / f"Robot{robot}_Groundtruth.dat")
    landmarks = _read_landmarks(folder / "Landmark_Groundtruth.dat")
    counts = MrclamImport(
        odometry=odometry.t_ns.size,
        observations=observations.t_ns.size,
        truth_poses=len(path),
        landmarks=len(landmarks),
        robot_sightings=sightings,
        unknown_barcodes=unknown,
        repeated_truth_stamps=repeated_truth,
        repeated_odometry_stamps=repeated_odometry,
    )
    start_s = int(min(odometry.t_ns[0], path.t_ns[0])) // 1_000_000_000
    origin = {"kind": "mrclam", "folder": folder.resolve().name, "robot": robot}
    info = SessionInfo(
        map=folder.resolve().name,
        start_utc=datetime.fromtimestamp(start_s, timezone.utc).isoformat(),
        origin={**origin, "counts": counts},
    )
    with Session.create(target, info) as session:
        session.add_odometry(odometry)
        session.add_observations(observations)
        session.add_ground_truth(GroundTruth(path, landmarks, {**origin, "by": "Vicon"}))
    return counts


def _read_odometry(file: Path) -> tuple[Odometry, int]:
    """Twists and the pose integrated from them, and how many repeated stamps were dropped."""
    rows = read_number_rows(file, ("t", "v", "w"))
    first = _first_of_each_stamp(rows)
    t_ns, speed, yaw_rate = rows.t_ns[first], rows.values[first, 0], rows.values[first, 1]
    pose = integrated(t_ns, speed, yaw_rate)
    return Odometry(SOURCE, t_ns, pose, speed, yaw_rate), rows.t_ns.size - first.size


def _read_observations(file: Path, subjects: dict[int, int]) -> tuple[Observations, int, int]:
    """Sightings of landmarks, and the number of those of robots and of unknown barcodes."""
    rows = read_number_rows(file, ("t", "barcode", "range", "bearing"))
    subject = np.array([subjects.get(int(code), 0) for code in rows.values[:, 0]], dtype=np.int64)
    unknown, robots = subject == 0, np.isin(subject, ROBOTS)
    kept = np.flatnonzero(~unknown & ~robots)
    kept = kept[np.argsort(rows.t_ns[kept], kind="stable")]
    observations = Observations(
        rows.t_ns[kept], subject[kept], rows.values[kept, 1], wrap(rows.values[kept, 2])
    )
    return observations, int(robots.sum()), int(unknown.sum())


def _read_truth(file: Path) -> tuple[Trajectory, int]:
    """The true path, and how many repeated stamps (rounded to milliseconds) were dropped."""
    rows = read_number_rows(file, ("t", "x", "y", "heading"))
    first = _first_of_each_stamp(rows)
    x, y, heading = rows.values[first].T
    return Trajectory(rows.t_ns[first], x, y, heading), rows.t_ns.size - first.size


def _first_of_each_stamp(rows: NumberRows) -> npt.NDArray[np.intp]:
    """Rows in order of time, of equal stamps the first in the file."""
    return np.unique(rows.t_ns, return_index=True)[1]


def _read_subjects(file: Path) -> dict[int, int]:
    """Subject numbers by barcode."""
    return {int(barcode): subject for subject, (barcode,) in _read_numbered(file, ("barcode",))}


def _read_landmarks(file: Path) -> LandmarkMap:
    """The true landmarks; x and y were measured independently."""
    rows = _read_numbered(file, ("x", "y", "sx", "sy"))
    values = np.array([row for _, row in rows])
    covariances = np.zeros((len(rows), 2, 2))
    covariances[:, 0, 0], covariances[:, 1, 1] = values[:, 2] ** 2, values[:, 3] ** 2
    return LandmarkMap(np.array([number for number, _ in rows]), values[:, :2], covariances)


def _read_numbered(file: Path, columns: Sequence[str]) -> list[tuple[int, list[float]]]:
    """Rows that begin with a subject number, of which each must come once."""
    rows = read_number_rows(file, ("subject", *columns))
    subjects = rows.t_ns // 1_000_000_000
    repeated = np.flatnonzero(np.diff(np.sort(subjects)) == 0)
    if repeated.size:
        number = int(np.sort(subjects)[repeated[0]])
        lines = rows.lines[subjects == number]
        raise TextFileError(
            f"{file}:{lines[1]}: subject {number} stands in line {lines[0]} already; "
            "expected each once; unpack the data set again"
        )
    return [(int(s), row) for s, row in zip(subjects, rows.values.tolist(), strict=True)]
