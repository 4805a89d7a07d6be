"""Jinja templates filled, and tables as they want them."""

from __future__ import annotations

import math
from pathlib import Path

from dialogue.table import Cell, Table

SHARED = Path(__file__).parent / "templates"
"""`page.html` (the head and style, to extend), `parts.html` (tables, remarks, legends)."""

UNDEFINED = "\N{EN DASH}"
"""What stands for a value that does not exist."""

LONG_TABLE = 20
"""A table with more rows than this is folded."""


def render(template: Path, **values: object) -> str:
    """The page of a template, which may use its neighbours and those of `SHARED`.

    Everything is escaped except what passes the filter `svg`.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader([template.parent, SHARED]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    # Figures are made by `figure_svg` alone, which escapes the only text from outside.
    environment.filters["svg"] = Markup
    return environment.get_template(template.name).render(**values)


def view(table: Table) -> dict[str, object]:
    """A table for the template `table`: headings, cells as text, which columns are numbers."""
    columns = list(zip(*table.rows, strict=True))
    return {
        "title": table.title,
        "note": table.note,
        "columns": table.columns,
        "rows": [[number(cell, table.digits) for cell in row] for row in table.rows],
        "numeric": [not any(isinstance(cell, str) for cell in column) for column in columns],
        "folded": len(table.rows) > LONG_TABLE,
    }


def number(cell: Cell, digits: int = 3) -> str:
    """A cell for the eye: floats to `digits` decimals, a dash for what is undefined."""
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return UNDEFINED
    return f"{cell:.{digits}f}" if isinstance(cell, float) else str(cell)
