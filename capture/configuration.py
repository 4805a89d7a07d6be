"""Configuration: YAML into frozen dataclasses, every fault at once and with its place.

The dataclass is the schema. Its field types may be nested dataclasses, `list[X]`, `tuple[X, ...]`,
`Mapping[str, X]`, `X | None`, `Literal`, bool, int, float, str and object (anything); the metadata
of a field may bound it: `field(metadata={"min": 0.0, "max": 1.0})` or `{"choices": ("a", "b")}`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, get_type_hints

from capture.errors import ConfigurationError, TextFileError
from capture.number_rows import read_text
from dialogue import UsageError, nearest_names

if TYPE_CHECKING:
    import yaml

    from capture.yaml_values import Fault

_Config = TypeVar("_Config")


def read_configuration(kind: type[_Config], file: Path) -> _Config:
    """The dataclass `kind` from a YAML file.

    Raises `ConfigurationError` with one line `file:line:column: key: message` for every fault.
    """
    try:
        text = read_text(file)
    except TextFileError as err:
        raise ConfigurationError(str(err)) from err
    return configuration_from_text(kind, text, str(file))


def configuration_from_text(kind: type[_Config], text: str, name: str) -> _Config:
    """The dataclass `kind` from YAML text; `name` stands for the file in error messages."""
    import yaml

    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as err:
        mark = err.problem_mark
        place = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        raise ConfigurationError(f"{place}: no valid YAML: {err.problem}") from err
    except yaml.YAMLError as err:
        raise ConfigurationError(f"{name}: no valid YAML: {err}") from err
    return _checked(kind, node or yaml.MappingNode("tag:yaml.org,2002:map", []), name)


def configuration_from_mapping(
    kind: type[_Config], values: Mapping[str, object], name: str
) -> _Config:
    """The dataclass `kind` from plain values, as a program or a result file holds them."""
    from yaml.representer import SafeRepresenter

    from capture.yaml_file import plain

    return _checked(kind, SafeRepresenter().represent_data(plain(values)), name)


def with_overrides(config: _Config, assignments: Sequence[str]) -> _Config:
    """The configuration with `key=value` changes; dots reach into nested parts, values are YAML.

    Raises `UsageError` with a line for each assignment that names no field or has a wrong value.
    """
    faults: list[str] = []
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals:
            faults.append(f"{assignment!r} is no assignment; expected key=value")
            continue
        try:
            config = _replaced(config, key.strip(), key.strip().split("."), text)
        except UsageError as err:
            faults.append(str(err))
    if faults:
        raise UsageError("\n".join(faults))
    return config


def _checked(kind: type[_Config], node: yaml.Node, name: str) -> _Config:
    from capture.yaml_values import value_of

    faults: list[Fault] = []
    value = value_of(kind, node, "", faults)
    if faults:
        raise ConfigurationError("\n".join(fault.text(name) for fault in sorted(faults)))
    assert isinstance(value, kind)
    return value


def _replaced(config: _Config, key: str, path: Sequence[str], text: str) -> _Config:
    """The configuration with the field at `path` set to what `text` says."""
    if not dataclasses.is_dataclass(config) or isinstance(config, type):
        raise UsageError(f"{key}: has no parts to set; leave out {'.' + '.'.join(path)!r}")
    fields = {field.name: field for field in dataclasses.fields(config)}
    if path[0] not in fields:
        raise UsageError(f"{key}: no such key; {nearest_names(path[0], fields)}")
    if len(path) > 1:
        value = _replaced(getattr(config, path[0]), key, path[1:], text)
    else:
        value = _parsed(get_type_hints(type(config))[path[0]], fields[path[0]].metadata, key, text)
    try:
        changed: _Config = dataclasses.replace(config, **{path[0]: value})
    except ValueError as err:
        raise UsageError(f"{key}={text}: {err}") from err
    return changed


def _parsed(kind: object, limits: Mapping[str, object], key: str, text: str) -> object:
    import yaml

    from capture.yaml_values import bounded_value_of

    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as err:
        raise UsageError(f"{key}={text}: no valid YAML value; put text in quotes") from err
    faults: list[Fault] = []
    null = yaml.ScalarNode("tag:yaml.org,2002:null", "")
    value = bounded_value_of(kind, limits, node or null, key, faults)
    if faults:
        raise UsageError("\n".join(f"{fault.key}={text}: {fault.message}" for fault in faults))
    return value
