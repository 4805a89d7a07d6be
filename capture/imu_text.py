"""Inertial measurements as text: what `trackside export csv` writes, read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from capture.csv_table import read_csv
from capture.errors import TextFileError
from capture.streams import Imu

_RATES = tuple(f"angular_velocity_{axis}_rad_s" for axis in "xyz")
_FORCES = tuple(f"linear_acceleration_{axis}_m_s2" for axis in "xyz")


def read_imu_csv(file: Path) -> Imu:
    """The samples of an `imu.csv`, in the order of their stamps, of equal stamps the first.

    Raises `TextFileError` where columns are missing, cells are wrong, or there are too few rows.
    """
    table = read_csv(file, ("t", *_RATES, *_FORCES))
    if len(table.rows) < 2:
        raise TextFileError(f"{file}: holds {len(table.rows)} rows; expected a recording")
    t_ns, first = np.unique(table.stamps("t"), return_index=True)
    columns = [
        np.stack([table.numbers(name, required=True) for name in names], axis=1)[first]
        for names in (_RATES, _FORCES)
    ]
    return Imu(t_ns, *columns)
