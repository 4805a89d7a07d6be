"""The folder of a recording: its name, its trial number, and that it is one program's alone."""

from __future__ import annotations

import datetime
import fcntl
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from capture.errors import SessionError
from capture.transaction import writing_error
from dialogue import UsageError

_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9.-]*")


def new_recording_folder(
    base: Path,
    day: datetime.date,
    map_name: str,
    power: str = "",
    trial: int | None = None,
    suffix: str = "",
) -> tuple[Path, int]:
    """An empty folder `base/DAY_MAP_POWER_TRIAL[_SUFFIX]`, and the number of the trial.

    trial : None counts on from the trials that are there, of any suffix and day.
    Raises `UsageError` for words that no file name should hold, `SessionError` if it exists.
    """
    words = [word for word in (map_name, power) if word]
    for word in words:
        if not _WORD.fullmatch(word):
            raise UsageError(f"{word!r}: a map or power is named by letters, digits, dots, dashes")
    number = _next_trial(base, words) if trial is None else trial
    name = "_".join([day.isoformat(), *words, str(number), *([suffix] if suffix else [])])
    folder = base / name
    if folder.exists():
        raise SessionError(
            f"{folder} exists already and nothing in it is ever overwritten; "
            "leave out --trial to count on, or give another number"
        )
    try:
        folder.mkdir(parents=True)
    except OSError as err:
        raise writing_error(folder, err) from err
    return folder, number


def _next_trial(base: Path, words: list[str]) -> int:
    middle = "_".join(re.escape(word) for word in words)
    pattern = re.compile(rf"\d{{4}}-\d\d-\d\d_{middle}_(\d+)(?:_[a-z]+)?")
    names = [child.name for child in base.iterdir()] if base.is_dir() else []
    taken = [int(found[1]) for name in names if (found := pattern.fullmatch(name))]
    return max(taken, default=0) + 1


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """The session is ours alone as long as the block lasts; a killed program lets go of it.

    Raises `SessionError` when another program records into it or finishes it.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            raise SessionError(
                f"{folder}: is being recorded right now; stop the recording first"
            ) from err
        yield
    finally:
        os.close(handle)
