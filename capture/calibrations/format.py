"""What every calibration file has: a format that is known, a covariance that fits."""

from __future__ import annotations

from typing import TypeAlias

FORMAT = 1
Rows: TypeAlias = tuple[tuple[float, ...], ...]


def check_format(number: int) -> None:
    """Raise `ValueError` for a format of another time."""
    if number != FORMAT:
        raise ValueError(f"format {number} is not known; this trackside reads {FORMAT}")


def check_covariance(covariance: Rows, size: int) -> None:
    """Raise `ValueError` unless it is (size, size)."""
    if len(covariance) != size or any(len(row) != size for row in covariance):
        raise ValueError(f"covariance must have {size} rows of {size} numbers")
