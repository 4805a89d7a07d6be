"""One table, five formats: for a terminal, for programs, for a paper, for a README."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass

from dialogue.errors import UsageError, nearest_names

Cell = str | float | int | None

TABLE_FORMATS = ("table", "json", "csv", "latex", "md")

_LATEX_ESCAPES = str.maketrans(
    {mark: rf"\{mark}" for mark in "_%&#${}"}
    | {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}"}
)


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are rounded only for the eye, never in json or csv.

    `columns` carry their unit ("pose [m]") and differ; a None cell is an undefined value.
    `title` and `note` stand around the rows, except in csv and latex, which hold rows only.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    title: str = ""
    note: str = ""
    digits: int = 3

    def __post_init__(self) -> None:
        if len(set(self.columns)) != len(self.columns):
            raise ValueError(f"two columns of one name in {self.columns!r}")
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"row {row!r} does not fit the columns {self.columns!r}")

    def render(self, table_format: str) -> str:
        """The table as text, without a newline at its end.

        Raises `UsageError` when `table_format` is not one of `TABLE_FORMATS`.
        """
        renderers: dict[str, Callable[[], str]] = {
            "table": self._plain,
            "json": self._json,
            "csv": self._csv,
            "latex": self._latex,
            "md": self._markdown,
        }
        if table_format not in renderers:
            hint = nearest_names(table_format, TABLE_FORMATS)
            raise UsageError(f"there is no table format {table_format!r}; {hint}")
        return renderers[table_format]()

    def _texts(self) -> list[list[str]]:
        return [[_text(cell, self.digits) for cell in row] for row in self.rows]

    def _numeric(self) -> list[bool]:
        """For each column whether it holds numbers only, and is thus set flush right."""
        if not self.rows:
            return [False] * len(self.columns)
        columns = zip(*self.rows, strict=True)
        return [all(not isinstance(cell, str) for cell in column) for column in columns]

    def _plain(self) -> str:
        texts = self._texts()
        widths = [max(map(len, column)) for column in zip(self.columns, *texts, strict=True)]
        right = self._numeric()
        lines = [_aligned(self.columns, widths, right), "  ".join("-" * w for w in widths)]
        lines += [_aligned(row, widths, right) for row in texts]
        return "\n".join([self.title] * bool(self.title) + lines + [self.note] * bool(self.note))

    def _markdown(self) -> str:
        rules = ["---:" if right else "---" for right in self._numeric()]
        rows = [self.columns, rules, *self._texts()]
        lines = ["| " + " | ".join(t.replace("|", r"\|") for t in row) + " |" for row in rows]
        head = [f"**{self.title}**", ""] if self.title else []
        return "\n".join(head + lines + (["", self.note] if self.note else []))

    def _latex(self) -> str:
        spec = "".join("r" if right else "l" for right in self._numeric())
        head, *rows = [
            " & ".join(t.translate(_LATEX_ESCAPES) for t in row) + r" \\"
            for row in (self.columns, *self._texts())
        ]
        body = [rf"\begin{{tabular}}{{{spec}}}", r"\hline", head, r"\hline", *rows, r"\hline"]
        return "\n".join([*body, r"\end{tabular}"])

    def _csv(self) -> str:
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([["" if c is None else c for c in row] for row in self.rows])
        return out.getvalue().rstrip("\n")

    def _json(self) -> str:
        records = [
            {name: _finite(cell) for name, cell in zip(self.columns, row, strict=True)}
            for row in self.rows
        ]
        return json.dumps({"title": self.title, "note": self.note, "rows": records}, indent=2)


def _text(cell: Cell, digits: int) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "-"
    if isinstance(cell, float):
        return f"{cell:.{digits}f}"
    return str(cell)


def _finite(cell: Cell) -> Cell:
    """JSON has no NaN and no infinity: both become null."""
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell


def _aligned(texts: list[str] | tuple[str, ...], widths: list[int], right: list[bool]) -> str:
    cells = [t.rjust(w) if r else t.ljust(w) for t, w, r in zip(texts, widths, right, strict=True)]
    return "  ".join(cells).rstrip()
