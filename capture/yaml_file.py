"""YAML files that we write ourselves: plain values, the same bytes for the same values."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from capture.errors import TextFileError
from capture.number_rows import read_text
from capture.transaction import write_text


def write_yaml(file: Path, values: Mapping[str, object]) -> None:
    """Write values in the order given, UTF-8; raises `LogError` when the disk does not take it."""
    write_text(file, yaml_text(values))


def yaml_text(values: Mapping[str, object]) -> str:
    """The values as YAML; dataclasses, tuples, arrays and paths become what YAML knows."""
    import yaml

    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    text: str = yaml.dump(
        plain(values), Dumper=dumper, sort_keys=False, allow_unicode=True, width=100
    )
    return text


def read_yaml(file: Path) -> dict[str, object]:
    """The mapping in a YAML file; raises `TextFileError` when there is none in it."""
    import yaml

    try:
        values = yaml.load(read_text(file), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except yaml.YAMLError as err:
        raise TextFileError(f"{file}: no valid YAML: {err}; restore the file") from err
    if not isinstance(values, dict):
        raise TextFileError(f"{file}: expected keys with values; restore the file")
    return {str(key): value for key, value in values.items()}


def plain(value: object) -> object:
    """The value built from dict, list, str, int, float, bool and None only."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return str(value)
