"""CSV files with a header: columns by name, and exact about what is wrong."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from capture.errors import TextFileError
from capture.estimate import NO_STAMP
from capture.number_rows import read_text
from capture.stamps import ns_to_stamp, stamp_to_ns
from capture.transaction import write_text
from geometry import Floats, Stamps

_T = TypeVar("_T")


@dataclass(frozen=True)
class CsvTable:
    """The cells of a CSV file; `lines` are the line numbers of the rows, from 1."""

    file: Path
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def __contains__(self, column: str) -> bool:
        return column in self.header

    def numbers(self, column: str, *, required: bool = False) -> Floats:
        """(n,) numbers; an empty cell is NaN, or an error if the column is `required`."""
        return np.array(self._parsed(column, _number, math.nan, required), dtype=np.float64)

    def integers(self, column: str, *, required: bool = False) -> npt.NDArray[np.int64]:
        """(n,) integers; an empty cell is `NO_STAMP`, or an error if `required`."""
        return np.array(self._parsed(column, _integer, NO_STAMP, required), dtype=np.int64)

    def stamps(self, column: str, *, required: bool = False) -> Stamps:
        """(n,) nanoseconds from seconds; an empty cell is `NO_STAMP`, or an error if `required`."""
        return np.array(self._parsed(column, stamp_to_ns, NO_STAMP, required), dtype=np.int64)

    def refuse_repeated(self, column: str, values: npt.NDArray[np.int64]) -> None:
        """Raise `TextFileError` naming both lines if one of `values` of `column` comes twice."""
        seen: dict[int, int] = {}
        for value, line in zip(values.tolist(), self.lines, strict=True):
            if value in seen:
                raise TextFileError(
                    f"{self.file}:{line}: {column} {value} stands in line {seen[value]} already; "
                    "expected each once; delete one or give it another"
                )
            seen[value] = line

    def _parsed(
        self, column: str, parse: Callable[[str], _T], unknown: _T, required: bool
    ) -> list[_T]:
        at = self.header.index(column)
        parsed = []
        for line, row in zip(self.lines, self.rows, strict=True):
            cell = row[at]
            if not cell and not required:
                parsed.append(unknown)
                continue
            try:
                parsed.append(parse(cell))
            except ValueError:
                raise TextFileError(
                    f"{self.file}:{line}: {column}: expected {_EXPECTED[parse.__name__]}, "
                    f"found {cell!r}; correct the cell"
                ) from None
        return parsed


def read_csv(file: Path, required: Sequence[str]) -> CsvTable:
    """The table in `file`, columns in any order; raises `TextFileError` unless `required` exist."""
    content = [
        (line, cells)
        for line, cells in _cells(read_text(file))
        if cells and any(cells) and not cells[0].startswith("#")
    ]
    expected = f"expected a header with the columns {','.join(required)}"
    if not content:
        raise TextFileError(f"{file}: is empty; {expected}; was it written to its end?")
    first, header = content[0]
    missing = [name for name in required if name not in header]
    if missing:
        raise TextFileError(
            f"{file}:{first}: no column {', '.join(missing)} in {','.join(header)!r}; {expected}"
        )
    for line, cells in content[1:]:
        if len(cells) != len(header):
            raise TextFileError(
                f"{file}:{line}: {len(cells)} cells; expected {len(header)} "
                f"({','.join(header)}); correct the line"
            )
    rows = tuple(cells for _, cells in content[1:])
    return CsvTable(file, header, rows, tuple(line for line, _ in content[1:]))


def write_csv(file: Path, columns: Mapping[str, Iterable[str]]) -> None:
    """Write columns of texts of equal length under their names."""
    lines = [",".join(columns)]
    lines += [",".join(row) for row in zip(*columns.values(), strict=True)]
    write_text(file, "\n".join(lines) + "\n")


def number_texts(values: Floats) -> list[str]:
    """Shortest texts that read back as the same numbers; NaN is empty."""
    return ["" if math.isnan(value) else repr(value) for value in values.tolist()]


def integer_texts(values: npt.NDArray[np.int64]) -> list[str]:
    """Texts of integers; `NO_STAMP` is empty."""
    return ["" if value == NO_STAMP else str(value) for value in values.tolist()]


def stamp_texts(t_ns: Stamps) -> list[str]:
    """Seconds with nine decimals; `NO_STAMP` is empty."""
    return ["" if value == NO_STAMP else ns_to_stamp(value) for value in t_ns.tolist()]


def _cells(text: str) -> Iterable[tuple[int, tuple[str, ...]]]:
    reader = csv.reader(io.StringIO(text))
    for row in reader:
        yield reader.line_num, tuple(cell.strip() for cell in row)


def _number(cell: str) -> float:
    if "_" in cell:
        raise ValueError(cell)
    return float(cell)


def _integer(cell: str) -> int:
    if "_" in cell:
        raise ValueError(cell)
    return int(cell)


_EXPECTED = {
    "_number": "a number",
    "_integer": "an integer",
    "stamp_to_ns": "a time in seconds",
}
