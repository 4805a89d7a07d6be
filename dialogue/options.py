"""Options that many commands have, each worded once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from dialogue.table import TABLE_FORMATS

Command = TypeVar("Command", bound=Callable[..., Any])


def format_option(text: str = "How to print the table.") -> Callable[[Command], Command]:
    """`--format`, one of `TABLE_FORMATS`, as the argument `table_format`; text : its help."""
    return click.option(
        "--format",
        "table_format",
        type=click.Choice(TABLE_FORMATS),
        default="table",
        show_default=True,
        help=text,
    )
