"""Runs made by hand."""

from __future__ import annotations

from pathlib import Path

from scoring.comparison import COLUMNS, Run

HEADER = "dataset,ep1,ep2,emap,efn,efp,edist,total\n"

EKF = """Low-1,0.1,0.2,0.1,0.3,0.0,0.1,0.8
Low-2,,,,,,,
High-1,0.3,0.4,0.1,0.0,0.6,0.1,1.5
High-2,0.2,0.6,0.1,0.0,0.6,,1.5
"""

FASTSLAM = """Low-1,0.2,0.2,0.1,0.6,0.0,0.1,1.2
Low-2,,,,,,,
High-1,0.1,0.4,0.1,0.9,0.6,0.1,2.2
High-2,0.6,0.6,0.1,0.9,0.6,0.2,3.0
"""


def write_tables(folder: Path) -> tuple[Path, Path]:
    """Two tables as the thesis prints them, with a failed run, an undefined value, easy numbers."""
    files = (folder / "table_turn_ekf.csv", folder / "table_turn_fastslam.csv")
    for file, rows in zip(files, (EKF, FASTSLAM), strict=True):
        file.write_text(HEADER + rows)
    return files


def make_run(algorithm: str, place: str, pose: float, **others: float | None) -> Run:
    """A run at `MAP POWER TRIAL` whose six errors are `pose` each, unless said otherwise."""
    name_of_map, power, trial = place.split()
    weighted: dict[str, float | None] = {**dict.fromkeys(COLUMNS, pose), "total": 6 * pose}
    return Run(name_of_map, power, trial, algorithm, {**weighted, **others}, Path("by hand"))
