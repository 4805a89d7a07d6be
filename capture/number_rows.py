"""Text files of numbers in columns: fast when they are right, and exact about what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from capture.errors import TextFileError
from capture.stamps import stamp_to_ns
from geometry import Floats, Stamps


@dataclass(frozen=True, eq=False)
class NumberRows:
    """A stamp and k numbers per line, in the order of the file.

    t_ns : (n,); values : (n, k), NaN and infinity allowed; lines : (n,) line numbers from 1.
    """

    file: Path
    t_ns: Stamps
    values: Floats
    lines: npt.NDArray[np.int64]


def read_text(file: Path) -> str:
    """The content of a text file, UTF-8; raises `TextFileError` when it cannot be read."""
    try:
        return file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise TextFileError(f"{file}: there is no such file; check the path") from None
    except UnicodeDecodeError as err:
        raise TextFileError(f"{file}: no text file (byte {err.start} is not UTF-8)") from err
    except OSError as err:
        why = err.strerror or str(err)
        raise TextFileError(f"{file}: cannot be read: {why}; check owner and mode") from err


def read_number_rows(file: Path, columns: Sequence[str]) -> NumberRows:
    """Lines of numbers under `columns`, the first of which is a time in seconds.

    Cells are separated by blanks, tabs or commas; what follows a `#` is a comment.
    Raises `TextFileError` naming the line when a cell is missing, is one too many or no number.
    """
    text = read_text(file)
    if "," in text:
        text = text.replace(",", " ")
    numbered = [
        (line, content)
        for line, content in enumerate(text.splitlines(), 1)
        if (content and content[0] != "#") and (content[0] > " " or _has_cells(content))
    ]
    if not numbered:
        raise TextFileError(
            f"{file}: holds no line of numbers; expected {_wanted(columns)}; "
            "was it written to its end?"
        )
    lines, rows = zip(*numbered, strict=True)
    try:
        values = np.loadtxt(rows, dtype=np.float64, ndmin=2)
        t_ns = np.array([stamp_to_ns(row.split(None, 1)[0]) for row in rows], dtype=np.int64)
        right = values.shape == (len(rows), len(columns))
    except ValueError:
        right = False
    if not right:
        _raise_first_fault(file, numbered, columns)
    return NumberRows(file, t_ns, values[:, 1:], np.array(lines))


def _has_cells(content: str) -> bool:
    """Whether an indented line holds anything but blanks and a comment."""
    return content.lstrip()[:1] not in ("", "#")


def _raise_first_fault(
    file: Path, numbered: Sequence[tuple[int, str]], columns: Sequence[str]
) -> NoReturn:
    """The slow second look at a file that is known to be wrong."""
    for line, content in numbered:
        cells = content.partition("#")[0].split()
        fault = ""
        if len(cells) != len(columns):
            fault = f"{len(cells)} columns; expected {_wanted(columns)}"
        for name, cell in zip(columns, cells, strict=False):
            fault = fault or _fault(name, cell, is_stamp=name == columns[0])
        if fault:
            raise TextFileError(
                f"{file}:{line}: {fault}; correct the line, or begin it with # if it is a comment"
            )
    raise AssertionError(f"{file} was refused without a fault")


def _fault(name: str, cell: str, *, is_stamp: bool) -> str:
    """What is wrong with a cell, or nothing."""
    try:
        if is_stamp:
            stamp_to_ns(cell)
        elif "_" in cell:
            raise ValueError(cell)
        else:
            float(cell)
    except ValueError as err:
        return f"{name}: {err}" if is_stamp else f"{name}: expected a number, found {cell!r}"
    return ""


def _wanted(columns: Sequence[str]) -> str:
    return f"{len(columns)} columns ({' '.join(columns)})"
