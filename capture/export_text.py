"""Sessions -> text: TUM trajectories, or every stream as CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from capture.csv_table import integer_texts, number_texts, stamp_texts, write_csv
from capture.errors import MissingStreamError
from capture.landmark_table import write_estimated_map, write_landmarks
from capture.session import Session
from capture.topics import IMU_TOPIC, RANGE_BEARING_TOPIC, SCAN_TOPIC, VESC_STATE_TOPIC
from capture.transaction import new_folder
from capture.tum import write_tum
from geometry import Floats, Stamps, Trajectory

_Columns = dict[str, Stamps | Floats]


def export_tum(session: Session, target: Path) -> tuple[str, ...]:
    """Write the folder `target`: ground truth, estimates and odometry as `.tum`; gives the names.

    Raises `MissingStreamError` when the session holds no path at all.
    """
    paths = _paths(session)
    if not paths:
        raise MissingStreamError(
            f"{session.folder}: holds neither truth nor estimate nor odometry to export; "
            "run trackside slam, or export csv"
        )
    with new_folder(target) as partial:
        for name, path in paths.items():
            write_tum(partial / f"{name}.tum", path)
    return tuple(f"{name}.tum" for name in paths)


def export_csv(session: Session, target: Path) -> tuple[str, ...]:
    """Write the folder `target`: every stream, path and map as CSV; gives the names of the files.

    Columns are named as in `docs/formats.md`; t is seconds with nine decimals.
    """
    with new_folder(target) as partial:
        for name, path in _paths(session).items():
            columns: _Columns = {"t": path.t_ns, "x_m": path.x, "y_m": path.y}
            columns["heading_rad"] = path.heading
            if name.startswith("odometry_"):
                odometry = session.odometry(name.removeprefix("odometry_"))
                columns["speed_m_s"] = odometry.speed_m_s
                columns["yaw_rate_rad_s"] = odometry.yaw_rate_rad_s
            _write(partial / f"{name}.csv", columns)
        _write_streams(session, partial)
        _write_maps(session, partial)
        names = sorted(file.name for file in partial.iterdir())
        if not names:
            raise MissingStreamError(f"{session.folder}: holds nothing to export")
    return tuple(names)


def _paths(session: Session) -> dict[str, Trajectory]:
    """Every path of a session by the name of its file."""
    paths = {}
    if session.has_ground_truth:
        paths["ground_truth"] = session.ground_truth().path
    for name in session.estimates:
        paths[f"estimate_{name}"] = session.estimate(name).path
    for source in session.odometry_sources:
        odometry = session.odometry(source)
        paths[f"odometry_{source}"] = Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    return paths


def _write_streams(session: Session, folder: Path) -> None:
    there = {topic.name for topic in session.topics if topic.count}
    columns: _Columns
    if SCAN_TOPIC in there:
        scans = session.scans()
        columns = {
            "t": np.repeat(scans.t_ns, np.diff(scans.starts)),
            "beam_t": scans.beam_t_ns,
            "range_m": scans.range_m,
            "bearing_rad": scans.bearing_rad,
            "intensity": scans.intensity,
        }
        _write(folder / "scans.csv", columns)
    if IMU_TOPIC in there:
        imu = session.imu()
        columns = {"t": imu.t_ns}
        for axis, name in enumerate("xyz"):
            columns[f"angular_velocity_{name}_rad_s"] = imu.angular_velocity_rad_s[:, axis]
            columns[f"linear_acceleration_{name}_m_s2"] = imu.linear_acceleration_m_s2[:, axis]
        _write(folder / "imu.csv", columns)
    if VESC_STATE_TOPIC in there:
        state = session.vesc_state()
        names = ("speed_erpm", "tachometer", "voltage_v", "motor_current_a", "duty")
        columns = {"t": state.t_ns, **{name: getattr(state, name) for name in names}}
        _write(folder / "vesc_state.csv", columns)
    if RANGE_BEARING_TOPIC in there:
        seen = session.observations()
        columns = {"t": seen.t_ns, "landmark_id": seen.landmark_id}
        columns |= {"range_m": seen.range_m, "bearing_rad": seen.bearing_rad}
        _write(folder / "observations.csv", columns)


def _write_maps(session: Session, folder: Path) -> None:
    landmarks = session.ground_truth().landmarks if session.has_ground_truth else None
    if landmarks is not None:
        write_landmarks(folder / "cones.csv", landmarks)
    for name in session.estimates:
        estimated = session.estimate(name).map
        if estimated is not None:
            write_estimated_map(folder / f"map_{name}.csv", estimated)


def _write(file: Path, columns: _Columns) -> None:
    write_csv(file, {name: _texts(name, values) for name, values in columns.items()})


def _texts(name: str, values: Stamps | Floats) -> list[str]:
    if name in ("t", "beam_t"):
        return stamp_texts(values.astype(np.int64))
    if values.dtype == np.int64:
        return integer_texts(values.astype(np.int64))
    return number_texts(values.astype(np.float64))
