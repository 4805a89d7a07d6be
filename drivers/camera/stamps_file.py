"""`stamps.csv` beside the images of a folder: when each was exposed.

    name,t_ns
    left01.jpg,1700000000000000000

`t_ns` is a whole number of nanoseconds on any clock; only the differences count.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path

from drivers.camera.errors import CameraFileError

STAMPS_FILE = "stamps.csv"
COLUMNS = ["name", "t_ns"]


def read_stamps(file: Path) -> dict[str, int]:
    """Stamp in nanoseconds by the image's name; raises `CameraFileError` with the line."""
    found: dict[str, int] = {}
    try:
        with file.open(newline="", encoding="utf-8-sig") as lines:
            rows = list(csv.reader(lines))
    except (OSError, UnicodeDecodeError, csv.Error) as err:
        raise CameraFileError(f"{file}: cannot be read as a table of stamps: {err}") from err
    if not rows or [cell.strip() for cell in rows[0]] != COLUMNS:
        raise CameraFileError(f"{file}:1: the first line must be `{','.join(COLUMNS)}`")
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            name, text = (cell.strip() for cell in row)
            t_ns = int(text)
        except ValueError as err:
            raise CameraFileError(
                f"{file}:{number}: {','.join(row)!r} is not an image's name and a whole number of "
                "nanoseconds"
            ) from err
        if name in found:
            raise CameraFileError(f"{file}:{number}: {name} is listed twice; remove one line")
        found[name] = t_ns
    return found


def stamps_of(names: list[str], stamps: Mapping[str, int], file: Path) -> list[int]:
    """The stamps of images in their order; raises `CameraFileError` where they do not fit."""
    missing = [name for name in names if name not in stamps]
    if missing:
        raise CameraFileError(
            f"{file}: {len(missing)} images are not listed ({missing[0]} is the first); list them, "
            "or move the file away and give rate_hz"
        )
    times = [stamps[name] for name in names]
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
            raise CameraFileError(
                f"{file}: {names[k]} is stamped {times[k]}, not after {names[k - 1]} "
                f"({times[k - 1]}); images play in the order of their names: rename them, or mend "
                "the stamps"
            )
    return times
