"""The rules of the house that no linter knows."""

from __future__ import annotations

import ast
import importlib.metadata
import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pytest brings it to the floor of our Python versions

REPOSITORY = Path(__file__).parent.parent
NO_ROOMS = {"tests", "benchmarks", "examples", "docs"}
ROOMS = sorted(
    folder.name
    for folder in REPOSITORY.iterdir()
    if folder.name not in NO_ROOMS and not folder.name.startswith(".") and any(folder.glob("*.py"))
)
SOURCES = sorted(path for room in ROOMS for path in (REPOSITORY / room).rglob("*.py"))
# The top room has a file for each command of its own; its cli.py puts all commands together.
COMMANDS_OF_THE_TOP = {"trackside/demo.py", "trackside/devices.py", "trackside/doctor.py"}
LIMIT_FILE_LINES = 450  # the house aims at 400
LIMIT_FUNCTION_LINES = 60  # the house aims at 40
HEAVY = {"scipy", "matplotlib", "numba", "rosbags", "mcap", "rich", "cv2", "serial", "linuxpy"}

Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef
Documented: TypeAlias = ast.Module | ast.ClassDef | Function


def place(path: Path, node: ast.AST | None = None) -> str:
    """`file` or `file:line`, from the top of the repository."""
    line = "" if node is None else f":{getattr(node, 'lineno', 1)}"
    return f"{path.relative_to(REPOSITORY).as_posix()}{line}"


def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def test_the_house_has_rooms() -> None:
    assert {"dialogue", "geometry", "trackside"} <= set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_an_import_name_is_ours_alone(room: str) -> None:
    owners = set(importlib.metadata.packages_distributions().get(room, []))
    assert owners <= {"trackside"}
    found = importlib.util.find_spec(room)
    assert found is not None
    assert found.origin == str(REPOSITORY / room / "__init__.py")


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_is_listed_wherever_rooms_are_listed(room: str) -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    tool = project["tool"]
    build = tool["hatch"]["build"]["targets"]
    layers = tool["importlinter"]["contracts"][0]["layers"]
    lists = {
        "wheel": build["wheel"]["packages"],
        "sdist": [name.lstrip("/") for name in build["sdist"]["include"]],
        "ruff": tool["ruff"]["lint"]["isort"]["known-first-party"],
        "mypy": tool["mypy"]["files"],
        "coverage": tool["coverage"]["run"]["source_pkgs"],
        "import-linter roots": tool["importlinter"]["root_packages"],
        "import-linter layers": [name for layer in layers for name in layer.split(" | ")],
    }
    assert [name for name, rooms in lists.items() if room not in rooms] == []


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_says_what_it_is_for_and_that_it_is_typed(room: str) -> None:
    assert ast.get_docstring(tree(REPOSITORY / room / "__init__.py"))
    assert (REPOSITORY / room / "py.typed").is_file()


def test_files_are_short() -> None:
    lengths = {place(path): len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    assert {name: n for name, n in lengths.items() if n > LIMIT_FILE_LINES} == {}


def test_functions_are_short() -> None:
    lengths = {
        f"{place(path, node)} {node.name}": (node.end_lineno or node.lineno) - node.lineno + 1
        for path in SOURCES
        for node in ast.walk(tree(path))
        if isinstance(node, Function)
    }
    assert {name: n for name, n in lengths.items() if n > LIMIT_FUNCTION_LINES} == {}


def speaks(node: ast.AST) -> bool:
    """Whether a node calls `print`, `echo` or `secho`."""
    if not isinstance(node, ast.Call):
        return False
    called = node.func
    name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
    return name in {"print", "echo", "secho"}


def test_only_the_commands_speak() -> None:
    speakers = [
        place(path, node)
        for path in SOURCES
        if path.name != "cli.py" and place(path) not in COMMANDS_OF_THE_TOP
        for node in ast.walk(tree(path))
        if speaks(node)
    ]
    assert speakers == []


def public(node: Documented, name: str) -> Iterator[tuple[str, Documented]]:
    """The node and what others may use of it, functions within functions left out."""
    yield name, node
    if isinstance(node, Function):
        return
    for child in node.body:
        if isinstance(child, ast.ClassDef | Function) and not child.name.startswith("_"):
            yield from public(child, f"{name} {child.name}")


def test_what_is_public_is_described() -> None:
    silent = [
        name
        for path in SOURCES
        for name, node in public(tree(path), place(path))
        if not ast.get_docstring(node)
    ]
    assert silent == []


def test_no_file_knows_the_machine_it_was_written_on() -> None:
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=REPOSITORY, capture_output=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout: which files are ours is not known")
    # Built from parts, or this file would be its own offender.
    machine_path = re.compile(r"(?<![\w.~])/(?:" + "|".join(["work", "root", "tmp"]) + r")(?:/|\b)")
    offenders = []
    for name in filter(None, listed.stdout.decode().split("\0")):
        path = REPOSITORY / name
        # Lock files hold addresses; a deleted file is still listed until it is committed.
        if path.suffix == ".lock" or not path.is_file():
            continue
        text = path.read_bytes().decode("utf-8", errors="replace")
        offenders += [
            f"{name}:{text.count(chr(10), 0, found.start()) + 1}"
            for found in machine_path.finditer(text)
        ]
    assert offenders == []


@pytest.mark.parametrize(
    "room",
    [
        "calibration",
        "capture",
        "dialogue",
        "drivers",
        "geometry",
        "scoring",
        "simulation",
        "tracking",
        "visual_odometry",
    ],
)
def test_a_room_opens_without_heavy_imports(room: str) -> None:
    """`trackside --help` must answer at once, and scoring must run where SLAM is not installed."""
    program = f"import {room}, sys; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert loaded & HEAVY == set()
