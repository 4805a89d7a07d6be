"""Lengths and sizes as people write them on the command line: 122mm, 12.2cm, 0.122; 9x6."""

from __future__ import annotations

import re

import click

_LENGTH = re.compile(r"\s*([0-9]*\.?[0-9]+)\s*(mm|cm|m|)\s*")
_PER_METRE = {"mm": 1000.0, "cm": 100.0, "m": 1.0, "": 1.0}


def length(_: click.Context, param: click.Parameter, text: str | None) -> float | None:
    """A positive length in metres, which it is in where it has no unit; a click callback."""
    if text is None:
        return None
    match = _LENGTH.fullmatch(text)
    if match is None or not float(match[1]) > 0.0:
        raise click.BadParameter(
            f"{text!r} is no length; expected for example 122mm or 0.122m", param=param
        )
    # Divided, not multiplied: 122 / 1000 is the nearest number to 0.122.
    return float(match[1]) / _PER_METRE[match[2]]


def grid_size(_: click.Context, param: click.Parameter, text: str | None) -> tuple[int, int] | None:
    """Columns and rows; a click callback."""
    if text is None:
        return None
    columns, cross, rows = text.partition("x")
    if not (cross and columns.isdigit() and rows.isdigit()):
        raise click.BadParameter(
            f"{text!r} is no size of a board; expected for example 9x6", param=param
        )
    return int(columns), int(rows)
