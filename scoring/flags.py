"""The flags of `trackside score` that follow from `ScoreOptions`, and their help in groups."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import Field, fields, replace
from typing import Any, TypeVar

import click

from dialogue import UsageError
from scoring.options import CHOICES, PRESETS, ScoreOptions, flag_of, unit_of

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

_GROUPS = {entry.name: str(entry.metadata["group"]) for entry in fields(ScoreOptions)}


class GroupedCommand(click.Command):
    """A command whose help lists its options under headings."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, those of `ScoreOptions` under their group."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and isinstance(parameter, click.Option):
                group = _GROUPS.get(parameter.name or "", "Input and output")
                groups.setdefault(group, []).append(record)
        for group, records in groups.items():
            with formatter.section(group):
                formatter.write_dl(records)


def score_flags(command: Decorated) -> Decorated:
    """Give a command one flag per field of `ScoreOptions`, None where it is not given."""
    for entry in reversed(fields(ScoreOptions)):
        command = _flag(entry)(command)
    return command


def options_from_flags(preset: str, flags: Mapping[str, object]) -> ScoreOptions:
    """The preset with the flags that were given. Raises `UsageError`."""
    given: dict[str, Any] = {name: value for name, value in flags.items() if value is not None}
    return replace(PRESETS[preset], **given)


def _flag(entry: Field[Any]) -> Callable[[Decorated], Decorated]:
    flag, text = flag_of(entry.name), str(entry.metadata["help"])
    if isinstance(entry.default, bool):
        return click.option(flag, entry.name, is_flag=True, default=None, help=text)
    if entry.default is not None:
        text += f" [default: {_default_text(entry)}]"
    if entry.name in CHOICES:
        words = click.Choice(CHOICES[entry.name])
        return click.option(flag, entry.name, type=words, default=None, help=text)
    metavar = unit_of(entry.name).upper() or "NUMBER"
    kind: Callable[[str], object] = int if isinstance(entry.default, int) else float
    if isinstance(entry.default, tuple):
        kind, metavar = _weights, "W1,..,W6"
    return click.option(flag, entry.name, type=kind, default=None, metavar=metavar, help=text)


def _default_text(entry: Field[Any]) -> str:
    if isinstance(entry.default, tuple):
        return ",".join(f"{value:g}" for value in entry.default)
    if isinstance(entry.default, float):
        return f"{entry.default:g} {unit_of(entry.name)}".strip()
    return str(entry.default)


def _weights(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError as err:
        raise UsageError(
            f"--weights {text}: expected six numbers with commas between, as 1,1,1,0.3,0.3,1"
        ) from err
