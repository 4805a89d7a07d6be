"""Trajectories as TUM text: `t x y z qx qy qz qw` a line, seconds and metres.

The format of the TUM RGB-D benchmark (Sturm et al., IROS 2012), which evo and most others read.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.errors import TextFileError
from capture.number_rows import NumberRows, read_number_rows
from capture.stamps import ns_to_stamp
from capture.transaction import write_text
from capture.yaw import heading_of, yaw_quaternions
from geometry import SpacePath, Trajectory

COLUMNS = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")

MAX_HEIGHT_M = 0.05
MAX_TILT_DEG = 5.0


@dataclass(frozen=True, eq=False)
class TumPath:
    """A path in space from a file; `dropped` poses of it were not finite and are left out."""

    path: SpacePath
    dropped: int
    file: Path


def read_tum(file: Path) -> TumPath:
    """The path in a TUM file, in order of time whatever the order of the lines.

    Raises `TextFileError` naming the line of a malformed row, both lines of a repeated stamp.
    """
    rows, dropped = _read_poses(file)
    return TumPath(_space_path(rows), dropped, file)


def read_planar_tum(file: Path) -> tuple[Trajectory, int]:
    """The trajectory in a TUM file whose path stays in the plane, and how many poses were dropped.

    Raises `TextFileError` as `read_tum`, and when the path leaves the plane by more than
    0.05 m or 5 degrees.
    """
    rows, dropped = _read_poses(file)
    space = _space_path(rows)
    fault = leaves_plane(space)
    if fault:
        raise TextFileError(f"{file}: {fault}; score it in space with --space 3d")
    heading = heading_of(rows.values[:, 3:])
    return Trajectory(rows.t_ns, rows.values[:, 0], rows.values[:, 1], heading), dropped


def leaves_plane(space: SpacePath) -> str:
    """How a path leaves the plane by more than 0.05 m or 5 degrees; nothing if it does not."""
    height_m, tilt_rad = space.out_of_plane()
    if height_m <= MAX_HEIGHT_M and np.degrees(tilt_rad) <= MAX_TILT_DEG:
        return ""
    return (
        f"the path leaves the plane: z ranges over {height_m:.3f} m and the tilt reaches "
        f"{np.degrees(tilt_rad):.1f} deg; expected at most {MAX_HEIGHT_M} m and "
        f"{MAX_TILT_DEG:.0f} deg"
    )


def write_tum(file: Path, trajectory: Trajectory) -> None:
    """Write a trajectory with z = 0, so that `read_planar_tum` gives back the very same numbers.

    Headings outside (-pi, pi] are wrapped. Raises `LogError` when the disk does not take it.
    """
    turns = yaw_quaternions(trajectory.heading)
    columns = (trajectory.t_ns, trajectory.x, trajectory.y, turns[:, 2], turns[:, 3])
    lines = [
        f"{ns_to_stamp(t_ns)} {x!r} {y!r} 0.0 0.0 0.0 {z!r} {w!r}\n"
        for t_ns, x, y, z, w in zip(*(column.tolist() for column in columns), strict=True)
    ]
    write_text(file, f"# {' '.join(COLUMNS)}\n" + "".join(lines))


def _read_poses(file: Path) -> tuple[NumberRows, int]:
    """Finite rows in order of time, and the number of the others."""
    rows = read_number_rows(file, COLUMNS)
    finite = np.isfinite(rows.values).all(axis=1)
    if not finite.any():
        raise TextFileError(
            f"{file}:{rows.lines[0]}: none of the {finite.size} poses is finite; "
            "expected at least one; the program that wrote the file had lost its pose"
        )
    kept = np.flatnonzero(finite)
    kept = kept[np.argsort(rows.t_ns[kept], kind="stable")]
    lines = rows.lines[kept]
    poses = NumberRows(file, rows.t_ns[kept], rows.values[kept], lines)
    repeated = np.flatnonzero(np.diff(poses.t_ns) == 0)
    if repeated.size:
        first, second = lines[repeated[0]], lines[repeated[0] + 1]
        raise TextFileError(
            f"{file}:{second}: the stamp {ns_to_stamp(int(poses.t_ns[repeated[0]]))} stands in "
            f"line {first} already ({repeated.size} such pairs); expected each stamp once; "
            "delete one line of each pair"
        )
    return poses, int(finite.size - kept.size)


def _space_path(rows: NumberRows) -> SpacePath:
    norms = np.linalg.norm(rows.values[:, 3:], axis=1)
    off = np.flatnonzero(np.abs(norms - 1.0) > 0.01)
    if off.size:
        raise TextFileError(
            f"{rows.file}:{rows.lines[off[0]]}: the quaternion has length {norms[off[0]]:.3f}, "
            "expected 1; are the columns in the order t x y z qx qy qz qw?"
        )
    return SpacePath(rows.t_ns, rows.values[:, :3], rows.values[:, 3:])
