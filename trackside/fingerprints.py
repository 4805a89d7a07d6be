"""Digests of what decides a result: values, files, the code of rooms, the libraries under it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from capture import TextFileError

_LIBRARIES = ("numpy", "numba", "scipy")
_DIGITS = 24


def values_digest(values: Mapping[str, object]) -> str:
    """A name that is the same exactly where the values are."""
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


def files_digest(files: Iterable[Path]) -> str:
    """Of names and content of files; raises `TextFileError` when one cannot be read."""
    digest = hashlib.sha256()
    for file in files:
        try:
            digest.update(f"{file.name} {file.stat().st_size}\n".encode())
            with file.open("rb") as stream:
                while part := stream.read(1 << 20):
                    digest.update(part)
        except OSError as err:
            raise TextFileError(f"{file}: cannot be read: {err.strerror or err}") from err
    return digest.hexdigest()[:_DIGITS]


@cache
def rooms_digest(rooms: tuple[str, ...]) -> str:
    """Of the text of these rooms, none of which is imported for it."""
    digest = hashlib.sha256()
    for room in rooms:
        spec = find_spec(room)
        for folder in (spec.submodule_search_locations if spec else None) or ():
            for file in sorted(Path(folder).rglob("*.py")):
                digest.update(file.read_bytes())
    return digest.hexdigest()


def told_libraries() -> str:
    """The libraries that decide numbers, with their versions."""
    return ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
