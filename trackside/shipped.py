"""The examples that come with trackside."""

from __future__ import annotations

from pathlib import Path

from dialogue import TracksideError

_FOLDERS = (Path(__file__).parent / "examples", Path(__file__).parent.parent / "examples")
"""Inside the installed package, or in the checkout."""


def example(name: str) -> Path:
    """A shipped file or folder; raises `TracksideError` where this installation lacks it."""
    for folder in _FOLDERS:
        if (folder / name).exists():
            return folder / name
    raise TracksideError(f"the example {name!r} is missing from this installation; reinstall it")


def example_campaigns() -> dict[str, Path]:
    """Name -> file of the campaigns among them."""
    return {file.stem: file for folder in _FOLDERS for file in sorted(folder.glob("*.yaml"))}
