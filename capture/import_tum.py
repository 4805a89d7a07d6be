"""Text files of others -> a session without a log: truth and, optionally, an estimate to score."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

from capture.estimate import Estimate, GroundTruth
from capture.landmark_table import read_estimated_map, read_landmarks
from capture.session import Session
from capture.session_info import SessionInfo
from capture.stamps import NS_PER_S
from capture.tum import read_planar_tum
from dialogue import UsageError


@dataclass(frozen=True, kw_only=True)
class TumFiles:
    """What to import: truth as TUM, cones as CSV; an estimate as TUM with a map as CSV."""

    truth: Path
    cones: Path | None = None
    path: Path | None = None
    map: Path | None = None
    name: str = "imported"


@dataclass(frozen=True)
class TumImport:
    """What an import took; dropped poses were not finite. None where nothing was given."""

    truth_poses: int
    dropped_truth_poses: int
    landmarks: int | None
    estimate_poses: int | None
    dropped_estimate_poses: int | None
    estimated_landmarks: int | None


def import_tum(files: TumFiles, target: Path) -> TumImport:
    """Make the session `target` of text files; gives the counts.

    Raises `UsageError` for a map without a path, `TextFileError` for a malformed file,
    `SessionError` when the target exists.
    """
    if files.map is not None and files.path is None:
        raise UsageError(f"--map {files.map}: a map needs its path; give it with --path")
    truth, dropped_truth = read_planar_tum(files.truth)
    landmarks = read_landmarks(files.cones) if files.cones else None
    estimate, dropped_estimate = _read_estimate(files)
    provenance = {"kind": "tum", "file": files.truth.name, "dropped_poses": dropped_truth}
    start_s = int(truth.t_ns[0]) // NS_PER_S
    info = SessionInfo(
        start_utc=datetime.fromtimestamp(start_s, timezone.utc).isoformat(), origin=provenance
    )
    with Session.create(target, info) as session:
        session.add_ground_truth(GroundTruth(truth, landmarks, provenance))
        if estimate is not None:
            session.add_estimate(estimate)
    estimated = estimate.map if estimate else None
    return TumImport(
        truth_poses=len(truth),
        dropped_truth_poses=dropped_truth,
        landmarks=None if landmarks is None else len(landmarks),
        estimate_poses=None if estimate is None else len(estimate.path),
        dropped_estimate_poses=dropped_estimate,
        estimated_landmarks=None if estimated is None else len(estimated),
    )


def _read_estimate(files: TumFiles) -> tuple[Estimate | None, int | None]:
    """The estimate in the files, and how many of its poses were not finite."""
    if files.path is None:
        return None, None
    path, dropped = read_planar_tum(files.path)
    estimated = read_estimated_map(files.map) if files.map else None
    provenance = {
        "kind": "tum",
        "file": files.path.name,
        "map": files.map.name if files.map else None,
        "dropped_poses": dropped,
    }
    return Estimate(files.name, path, estimated, None, provenance), dropped
