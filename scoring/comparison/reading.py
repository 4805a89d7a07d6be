"""Runs read from sessions, score files and tables such as the thesis prints."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

from dialogue import UsageError
from scoring.comparison.runs import COLUMNS, Run, Runs
from scoring.errors import ScoringError
from scoring.result import ERROR_NAMES, FORMAT

TABLE_COLUMNS = dict(
    zip(("ep1", "ep2", "emap", "efn", "efp", "edist", "total"), COLUMNS, strict=True)
)
"""The column names of a thesis-style table, which has a column `dataset` besides."""


def read_runs(inputs: Sequence[Path], labels: Sequence[str] = ()) -> Runs:
    """The runs in session folders, score files (.json) and thesis-style tables (.csv).

    `labels` name map and algorithm of each table in turn as `MAP:ALGORITHM`; without them the file
    name ends in `_MAP_ALGORITHM.csv`. Raises `ScoringError` for a file that is none of these, for
    one run that comes twice and when nothing is left; `UsageError` for labels that do not fit.
    """
    tables = [path for path in inputs if path.suffix.lower() == ".csv"]
    if labels and len(labels) != len(tables):
        raise UsageError(
            f"--label is given {len(labels)} times for {len(tables)} .csv inputs; give one each, "
            "in their order"
        )
    named = dict(zip(tables, labels, strict=True)) if labels else {}
    runs: list[Run] = []
    remarks: list[str] = []
    for path in inputs:
        found = tuple(_read(path, named.get(path)))
        if not found:
            remarks.append(f"{path} has no scores and is left out; run: trackside score {path}")
        runs += found
    if not runs:
        raise ScoringError("nothing to compare: " + "; ".join(remarks or ["no input was given"]))
    _check_unique(runs)
    return Runs(tuple(runs), tuple(remarks))


def _read(path: Path, label: str | None) -> Iterator[Run]:
    if path.is_dir():
        for file in sorted((path / "scores").glob("*.json")):
            yield from _read_scores(file)
    elif path.suffix.lower() == ".json":
        yield from _read_scores(path)
    elif path.suffix.lower() == ".csv":
        yield from read_table(path, label)
    else:
        raise ScoringError(
            f"{path}: expected a session folder, a score file (.json) or a table (.csv)"
        )


def _check_unique(runs: Sequence[Run]) -> None:
    seen: dict[tuple[str, str, str], Run] = {}
    for run in runs:
        first = seen.setdefault((run.map, run.dataset, run.algorithm), run)
        if first is not run:
            raise ScoringError(
                f"{run.algorithm} on {run.map} {run.dataset} comes twice: in {first.source} and in "
                f"{run.source}; leave one out, or correct the trial in its session.yaml"
            )


def read_table(path: Path, label: str | None = None) -> tuple[Run, ...]:
    """The rows of a thesis-style table; an empty row is a run that failed.

    Raises `ScoringError` naming file and line for a missing column or a cell that is no number.
    """
    name_of_map, algorithm = _table_names(path, label)
    runs = []
    for line, row in _rows(path):
        power, _, trial = row["dataset"].strip().rpartition("-")
        weighted = {
            column: _number(row[name], f"{path}:{line}: {name}")
            for name, column in TABLE_COLUMNS.items()
        }
        # A name without a number is all power.
        names = (power, trial) if power else (trial, "")
        runs.append(Run(name_of_map, *names, algorithm, weighted, path))
    return tuple(runs)


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Line number and cells by column."""
    with _opened(path) as stream:
        reader = csv.reader(stream)
        header = [name.strip() for name in next(reader, [])]
        absent = [name for name in ("dataset", *TABLE_COLUMNS) if name not in header]
        if absent:
            raise ScoringError(
                f"{path}:1: column {', '.join(absent)} is missing; expected the header "
                f"dataset,{','.join(TABLE_COLUMNS)}"
            )
        for cells in reader:
            if cells and len(cells) != len(header):
                raise ScoringError(
                    f"{path}:{reader.line_num}: {len(cells)} cells for {len(header)} columns; "
                    "write decimals with a point, and nothing between commas for no value"
                )
            if cells:
                yield reader.line_num, dict(zip(header, cells, strict=True))


def _table_names(path: Path, label: str | None) -> tuple[str, str]:
    """Map and algorithm of a table, from its label or its file name."""
    parts = label.split(":") if label else path.stem.split("_")[-2:]
    if len(parts) != 2 or not all(parts):
        raise UsageError(
            f"{label or path.name}: cannot tell map and algorithm; say --label MAP:ALGORITHM, or "
            "let the file name end in _MAP_ALGORITHM.csv"
        )
    return parts[0], parts[1]


def _number(text: str, place: str) -> float | None:
    if not text.strip():
        return None
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ScoringError(f"{place} is {text!r}; expected a number, or nothing for none")
    return number


def _read_scores(path: Path) -> Iterator[Run]:
    """The scores of one file; data set and map from the session that it lies in."""
    with _opened(path) as stream:
        try:
            content = json.load(stream)
            version, scores = content["format"], content["scores"]
        except (ValueError, KeyError, TypeError) as err:
            raise _no_scores(path, err) from err
    if version != FORMAT:
        raise ScoringError(
            f"{path} has score format {version}, this program reads {FORMAT}; "
            "score the session again: trackside score SESSION"
        )
    place = _place(path)
    for score in scores:
        try:
            weighted = {name: _value(score["weighted"].get(name)) for name in ERROR_NAMES}
            weighted["total"] = _value(score["total"])
            yield Run(*place, str(score["name"]), weighted, path, dict(score["choices"]))
        except (ValueError, KeyError, TypeError, AttributeError) as err:
            raise _no_scores(path, err) from err


def _value(found: object) -> float | None:
    if found is None or isinstance(found, int | float):
        return found
    raise TypeError(f"{found!r} is no number")


def _no_scores(path: Path, err: Exception) -> ScoringError:
    return ScoringError(f"{path} holds no scores ({err}); expected what `trackside score` writes")


def _place(path: Path) -> tuple[str, str, str]:
    """Map, power and trial of the session that holds a score file; its own name outside of one."""
    folder = path.parent.parent
    if path.parent.name != "scores":
        return "unnamed", path.stem, ""
    from capture import Session

    info = Session.open(folder).info
    name_of_map = info.map or "unnamed"
    if not info.power:
        return name_of_map, folder.resolve().name, ""
    return name_of_map, info.power.capitalize(), "" if info.trial is None else str(info.trial)


def _opened(path: Path) -> TextIO:
    try:
        # Spreadsheets put a byte order mark first; a foreign letter is named by the cell it spoils.
        return path.open(encoding="utf-8-sig", errors="replace", newline="")
    except OSError as err:
        raise ScoringError(f"{path} cannot be read: {err.strerror}") from err
