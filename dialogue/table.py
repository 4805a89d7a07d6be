"""One table, five formats: for a terminal, for programs, for a paper, for a README."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass

Cell = str | float | int | None

TABLE_FORMATS = ("table", "json", "csv", "latex", "md")

_LATEX_ESCAPES = str.maketrans(
    {"_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}"}
)


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are rounded only for the eye, never in json or csv.

    `columns` carry their unit ("pose [m]"); a None cell is an undefined value.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    title: str = ""
    note: str = ""
    digits: int = 3

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"row {row!r} does not fit the columns {self.columns!r}")

    def render(self, table_format: str) -> str:
        """The table as text in one of `TABLE_FORMATS`, without a newline at its end."""
        renderers: dict[str, Callable[[], str]] = {
            "table": self._plain,
            "json": self._json,
            "csv": self._csv,
            "latex": self._latex,
            "md": self._markdown,
        }
        return renderers[table_format]()

    def _texts(self) -> list[list[str]]:
        return [[_text(cell, self.digits) for cell in row] for row in self.rows]

    def _plain(self) -> str:
        texts = self._texts()
        widths = [max(map(len, column)) for column in zip(self.columns, *texts, strict=True)]
        right = [_is_numeric(column) for column in zip(*self.rows, strict=True)] or [False] * len(
            widths
        )
        lines = [_aligned(self.columns, widths, right), "  ".join("-" * w for w in widths)]
        lines += [_aligned(row, widths, right) for row in texts]
        return "\n".join([self.title] * bool(self.title) + lines + [self.note] * bool(self.note))

    def _markdown(self) -> str:
        lines = ["| " + " | ".join(self.columns) + " |", "|" + " --- |" * len(self.columns)]
        lines += [
            "| " + " | ".join(t.replace("|", r"\|") for t in row) + " |" for row in self._texts()
        ]
        head = [f"**{self.title}**", ""] if self.title else []
        return "\n".join(head + lines + (["", self.note] if self.note else []))

    def _latex(self) -> str:
        right = [_is_numeric(column) for column in zip(*self.rows, strict=True)]
        spec = "".join("r" if r else "l" for r in right) or "l" * len(self.columns)
        rows = [
            " & ".join(t.translate(_LATEX_ESCAPES) for t in row) + r" \\" for row in self._texts()
        ]
        head = " & ".join(c.translate(_LATEX_ESCAPES) for c in self.columns) + r" \\"
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


def _is_numeric(column: tuple[Cell, ...]) -> bool:
    return all(not isinstance(cell, str) for cell in column)


def _aligned(texts: list[str] | tuple[str, ...], widths: list[int], right: list[bool]) -> str:
    cells = [t.rjust(w) if r else t.ljust(w) for t, w, r in zip(texts, widths, right, strict=True)]
    return "  ".join(cells).rstrip()
