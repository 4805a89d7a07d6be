"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from capture.errors import LogError, SessionError


def write_text(file: Path, text: str) -> None:
    """Put `text` (UTF-8) into `file`; a reader sees the old content or the new, nothing between.

    Raises `LogError` when the disk does not take it.
    """
    partial = file.with_name(f".{file.name}.partial-{os.getpid()}")
    try:
        with partial.open("w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(file)
    except BaseException as err:
        partial.unlink(missing_ok=True)
        if isinstance(err, OSError):
            raise writing_error(file, err) from err
        raise


@contextmanager
def new_folder(target: Path, *, replace: bool = False) -> Iterator[Path]:
    """A hidden folder beside `target` that takes its name when the block ends well.

    After an error nothing of it is left. With `replace` an existing target is moved aside, the new
    one takes its place, and only then the old one is deleted. Raises `SessionError` when the target
    exists and may not be replaced, `LogError` when the disk does not take it.
    """
    _refuse_existing(target, replace)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{target.name}.partial-", dir=target.parent))
    except OSError as err:
        raise writing_error(target, err) from err
    try:
        yield partial
        partial.chmod(0o755)
        _refuse_existing(target, replace)
        _take_name(partial, target)
    except BaseException as err:
        shutil.rmtree(partial, ignore_errors=True)
        if isinstance(err, OSError):
            raise writing_error(target, err) from err
        raise


def writing_error(path: Path, err: OSError) -> LogError:
    """The error that says which file the disk refused, why, and how much room is left."""
    why = err.strerror or str(err)
    return LogError(
        f"cannot write {path}: {why} ({free_space(path)}); "
        "make room there or choose another place, then run the command again"
    )


def free_space(path: Path) -> str:
    """How much room the disk has on which `path` lies or would lie, for an error text."""
    try:
        nearest = next(place for place in (path, *path.absolute().parents) if place.exists())
        return f"{shutil.disk_usage(nearest).free / 1e6:.0f} MB free on that disk"
    except (OSError, StopIteration):
        return "free space unknown"


def _refuse_existing(target: Path, replace: bool) -> None:
    if target.exists() and not replace:
        raise SessionError(
            f"{target} exists already and nothing in it is ever overwritten; "
            "give another name, or move it away first"
        )


def _take_name(partial: Path, target: Path) -> None:
    if not target.exists():
        partial.rename(target)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{target.name}.old-", dir=target.parent))
    target.replace(old)
    try:
        partial.rename(target)
    except OSError:
        old.replace(target)
        raise
    shutil.rmtree(old, ignore_errors=True)
