"""The commands that stand on a page: found, held to the options that exist, and run in their order.

A page is Markdown. Its commands are the lines of fenced `sh` blocks and of blocks indented by four
spaces that call `trackside`. `|`, `&&`, `;` and `>` end one, `#` begins a comment, a backslash
joins lines; `cd FOLDER` is followed, `*` and `?` find files, `> FILE` keeps what was printed. All
other programs are nobody's business here. Every command is run, in order, in one folder per page,
unless a comment above its block says otherwise:

    <!-- run: STAGE -->                    the stage of that name is set before the block
    <!-- not run: REASON -->               none of the block
    <!-- not run record, film: REASON -->  only these commands of the block
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import click
from click.testing import CliRunner

from trackside.cli import COMMANDS, trackside

Stage = Callable[[Path], None]

SHELLS = {"sh", "bash", "console"}
_DIRECTIVE = re.compile(r"^<!-- (run|not run)\b ?([^:>]*): *(.*?) *-->$")
_MARK = re.compile(r"^<!-- (?:run|not run)\b")
_PLACEHOLDER = re.compile(r"[A-Z][A-Z_-]+")


class PageError(Exception):
    """What is wrong with a page, `page:line: what`."""


@dataclass(frozen=True)
class Command:
    """One command of a page.

    words : after `trackside`, or of `cd`; output : the file after `>`; stages : to set before;
    excuse : why it is not run, empty if it is.
    """

    page: str
    line: int
    words: tuple[str, ...]
    output: str = ""
    stages: tuple[str, ...] = ()
    excuse: str = ""
    changes_folder: bool = False

    @property
    def place(self) -> str:
        """Where it stands and what it says."""
        program = "cd" if self.changes_folder else "trackside"
        return f"{self.page}:{self.line}: {program} {' '.join(self.words)}"


@dataclass
class _Block:
    stages: tuple[str, ...] = ()
    excuses: tuple[tuple[tuple[str, ...], str], ...] = ()
    line: int = 0

    def excuse(self, words: tuple[str, ...]) -> str:
        for names, reason in self.excuses:
            if not names or any(words[: len(n.split())] == tuple(n.split()) for n in names):
                return reason
        return ""


def commands_of(page: str, text: str) -> list[Command]:
    """The commands in their order; raises `PageError` for a comment that says nothing."""
    found: list[Command] = []
    ahead, used = _Block(), True
    for block in _blocks(page, text):
        if isinstance(block, _Block):
            ahead, used = _joined(ahead if not used else _Block(), block), False
            continue
        lines = _whole_lines(block)
        of_block = [command for number, line in lines for command in _of_line(page, number, line)]
        for k, command in enumerate(of_block):
            excuse = "" if command.changes_folder else ahead.excuse(command.words)
            stages = ahead.stages if k == 0 else ()
            found.append(replace(command, excuse=excuse, stages=stages))
        if of_block:
            _refuse_idle_excuses(page, ahead, of_block)
            ahead, used = _Block(), True
    if not used:
        raise PageError(f"{page}:{ahead.line}: no command follows this comment")
    return found


def _joined(first: _Block, second: _Block) -> _Block:
    return _Block(first.stages + second.stages, first.excuses + second.excuses, second.line)


def _refuse_idle_excuses(page: str, block: _Block, commands: list[Command]) -> None:
    words = [command.words for command in commands if not command.changes_folder]
    for names, reason in block.excuses:
        alone = _Block(excuses=((names, reason),))
        if not any(alone.excuse(one) for one in words):
            raise PageError(f"{page}:{block.line}: the block has no {' or '.join(names)}")


def _blocks(page: str, text: str) -> Iterator[_Block | list[tuple[int, str]]]:
    """Comments, and blocks as numbered lines, in order."""
    block: list[tuple[int, str]] = []
    fence: bool | None = None  # inside: whether it is a shell's
    for number, line in enumerate([*text.splitlines(), ""], 1):
        opening = re.match(r"^```(\w*)", line)
        if opening and fence is None:
            fence = opening[1] in SHELLS
        elif opening:
            fence = None
            yield block
            block = []
        elif fence is not None:
            block += [(number, line)] if fence else []
        elif line.startswith("    ") and line.strip():
            block.append((number, line[4:]))
        elif _MARK.match(line):
            yield _directive(page, number, line)
        elif block and line.strip():
            yield block
            block = []
    yield block


def _whole_lines(block: list[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """The lines of a block, those that end in a backslash joined with what follows."""
    begun, first = "", 0
    for number, line in block:
        first = number if not begun else first
        if line.endswith("\\"):
            begun += line[:-1] + " "
        else:
            yield first, begun + line
            begun = ""
    if begun:
        yield first, begun


def _directive(page: str, number: int, line: str) -> _Block:
    found = _DIRECTIVE.match(line)
    if not found or not found[3]:
        raise PageError(f"{page}:{number}: expected `run: STAGE` or `not run [COMMANDS]: REASON`")
    names = tuple(name.strip() for name in found[2].split(",") if name.strip())
    if found[1] == "run":
        return _Block(stages=tuple(found[3].split()), line=number)
    return _Block(excuses=((names, found[3]),), line=number)


def _of_line(page: str, number: int, line: str) -> Iterator[Command]:
    if not re.search(r"\btrackside |^cd ", line):
        return  # whatever else stands there need not be a shell's
    lexer = shlex.shlex(line, posix=True, punctuation_chars="|&;<>")
    lexer.whitespace_split = True
    parts: list[list[str]] = [[]]
    operators: list[str] = []
    for token in lexer:
        if set(token) <= set("|&;<>"):
            operators.append(token)
            parts.append([])
        else:
            parts[-1].append(token)
    for k, part in enumerate(parts):
        words = part[1:] if part[:1] == ["$"] else part
        if words[:2] and words[0].endswith("uv") and words[1:3] == ["run", "trackside"]:
            words = words[2:]
        if words[:1] == ["trackside"]:
            kept = operators[k : k + 1] == [">"] and parts[k + 1]
            yield Command(page, number, tuple(words[1:]), output=kept[0] if kept else "")
        elif words[:1] == ["cd"] and len(words) == 2:
            yield Command(page, number, tuple(words[1:]), changes_folder=True)


def calls_in_prose(page: str, text: str) -> list[Command]:
    """What stands as `trackside COMMAND ...` between backticks; pages speak of a part of a call."""
    found = []
    for call in re.finditer(r"(?<!`)`trackside ([^`]+)`", text):
        words = tuple(shlex.split(call[1].replace("\n", " ")))
        found.append(Command(page, text.count("\n", 0, call.start()) + 1, words))
    return found


def fault_of(command: Command, *, whole: bool = True) -> str:
    """What is wrong with the words of a command, or nothing: command, options, their values.

    whole : whether nothing may be missing. Words in capitals stand for something else and are not
    looked at; nor are files.
    """
    words = list(command.words)
    names = [word for word in words if not word.startswith("-")]
    if not names or _PLACEHOLDER.fullmatch(names[0].partition("|")[0]):
        return ""
    current, context = _resolved(words)
    if current is None:
        return f"{command.place}: there is no command {' '.join(names[:1])}"
    while isinstance(current, click.Group) and words:
        if words[0] in ("-h", "--help"):
            return ""
        if "|" in words[0]:
            return ""  # several of its commands at once
        try:
            inner = current.get_command(context, words[0])
        except click.UsageError:
            inner = None
        if inner is None:
            return f"{command.place}: there is no {words[0]}"
        context = click.Context(inner, info_name=words.pop(0), parent=context)
        current = inner
    return _fault_of_words(command, current, context, words, whole=whole)


def _resolved(words: list[str]) -> tuple[click.Command | None, click.Context]:
    """The command of the first one or two words, which are taken off."""
    top = click.Context(trackside, info_name="trackside")
    while words and words[0] in ("-h", "--help", "--version"):
        words.pop(0)
    if not words:
        return trackside, top
    size = 2 if " ".join(words[:2]) in COMMANDS else 1
    name = " ".join(words[:size])
    current = trackside.get_command(top, name)
    if current is None:
        return None, top
    del words[:size]
    return current, click.Context(current, info_name=name, parent=top)


def _fault_of_words(
    command: Command, current: click.Command, context: click.Context, words: list[str],
    *, whole: bool,
) -> str:  # fmt: skip
    if "--help" in words or "-h" in words:
        return ""
    try:
        values, left, _ = current.make_parser(context).parse_args(words)
    except click.UsageError as error:
        partly = not whole and isinstance(error, click.BadArgumentUsage | click.MissingParameter)
        return "" if partly else f"{command.place}: {error.format_message()}"
    if left:
        return f"{command.place}: nothing takes {' '.join(left)}"
    for option in current.params:
        given = values.get(option.name or "")
        texts = [one for one in (given if isinstance(given, list | tuple) else [given])
                 if isinstance(one, str)]  # fmt: skip
        if whole and option.required and not texts:
            return f"{command.place}: it needs {option.opts[-1]}"
        faults = [_fault_of_value(option, one, context) for one in texts]
        if any(faults):
            return f"{command.place}: {next(filter(None, faults))}"
    return ""


def _fault_of_value(option: click.Parameter, value: str, context: click.Context) -> str:
    """Of choices and numbers: a path need not be here."""
    if _PLACEHOLDER.fullmatch(value) or isinstance(option.type, click.Path | click.File):
        return ""
    try:
        option.type.convert(value, option, context)
    except click.UsageError as error:
        return error.format_message()
    return ""


def run_page(
    page: str, text: str, folder: Path, stages: Mapping[str, Stage], change: Callable[[Path], None]
) -> list[str]:
    """Run the commands in the folder; gives the excuses of those that were not, a line each.

    change : goes to a folder (`monkeypatch.chdir`). Raises `PageError` at the first that fails.
    """
    here, excused = folder, []
    change(here)
    for command in commands_of(page, text):
        for name in command.stages:
            if name not in stages:
                known = ", ".join(sorted(stages)) or "none"
                raise PageError(f"{command.place}: no stage {name!r}; there are: {known}")
            stages[name](here)
        if command.changes_folder:
            here = here / command.words[0]
            change(here)
        elif command.excuse:
            excused.append(f"{command.place}: not run: {command.excuse}")
        else:
            _run(command, here)
    return excused


def _run(command: Command, here: Path) -> None:
    words = [found for word in command.words for found in _files(here, word)]
    done = CliRunner().invoke(trackside, words)
    if done.exit_code:
        said = f"{done.output}\n{done.exception!r}" if done.exception else done.output
        raise PageError(f"{command.place}: exit code {done.exit_code}\n{said}")
    if command.output:
        (here / command.output).write_text(done.stdout, encoding="utf-8")


def _files(here: Path, word: str) -> list[str]:
    if not set(word) & set("*?"):
        return [word]
    return sorted(str(path.relative_to(here)) for path in here.glob(word)) or [word]
