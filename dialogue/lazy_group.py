"""A group of commands that are imported when they are called, not before."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, cast

import click

from dialogue.errors import nearest_names


class LazyGroup(click.Group):
    """Commands out of a table: name -> where it is defined (`module:attribute`), its line of help.

    `--help` imports none of them. A name of two words is a command that needs more rooms than the
    one that it stands under. noun : what a name that is none is said to be none of.
    """

    def __init__(
        self, *args: Any, table: Mapping[str, tuple[str, str]], noun: str, **attributes: Any
    ) -> None:
        super().__init__(*args, **attributes)
        self.table, self.noun = table, noun

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  click's signature
        """The names, in the order of the table."""
        return list(self.table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """The command of a name, imported now; None where there is none."""
        if cmd_name not in self.table:
            return None
        module, _, attribute = self.table[cmd_name][0].partition(":")
        return cast(click.Command, getattr(importlib.import_module(module), attribute))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """The table as it stands in the help."""
        with formatter.section("Commands, in the order of a day"):
            formatter.write_dl([(name, text) for name, (_, text) in self.table.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that words begin with; a wrong name is told with the nearest right one."""
        name, two = args[0], " ".join(args[:2])
        if two in self.table:
            return two, self.get_command(ctx, two), args[2:]
        if name not in self.table and not name.startswith("-"):
            ctx.fail(f"no {self.noun} {name!r}; {nearest_names(name, self.table)}")
        return super().resolve_command(ctx, args)
