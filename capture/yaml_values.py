"""YAML nodes into typed values; every fault is noted with its place instead of raised."""

from __future__ import annotations

import dataclasses
import math
import re
import types
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Union, get_args, get_origin, get_type_hints

import yaml

from dialogue import UsageError, nearest_names

_INVALID = object()
_INTEGER = re.compile(r"[-+]?[0-9]+")
_INFINITY = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf}


@dataclass(frozen=True, order=True)
class Fault:
    """What is wrong at one place; line and column count from 1, 0 where there is no file."""

    line: int
    column: int
    key: str
    message: str

    def text(self, file: str) -> str:
        """`file:line:column: key: message`."""
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        return f"{place}: {self.key + ': ' if self.key else ''}{self.message}"


def value_of(kind: object, node: yaml.Node, key: str, faults: list[Fault]) -> object:
    """The value of type `kind` that `node` holds; faults are appended, the value is then void."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        if _is_null(node) and type(None) in arguments:
            return None
        (kind,) = (argument for argument in arguments if argument is not type(None))
        return value_of(kind, node, key, faults)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return _dataclass_of(kind, node, key, faults)
    if origin in (list, tuple):
        return _sequence_of(origin, arguments[0], node, key, faults)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return _mapping_of(arguments[1], node, key, faults)
    if origin is Literal:
        value = _scalar_of(type(arguments[0]), node, key, faults)
        return _chosen(arguments, value, node, key, faults)
    if kind is object:
        return yaml.constructor.SafeConstructor().construct_document(node)
    return _scalar_of(kind, node, key, faults)


def bounded_value_of(
    kind: object, limits: Mapping[str, object], node: yaml.Node, key: str, faults: list[Fault]
) -> object:
    """As `value_of`, and within the limits `min`, `max` and `choices` of a field's metadata."""
    value = value_of(kind, node, key, faults)
    choices = limits.get("choices")
    for item in value if isinstance(value, (list, tuple)) else [value]:
        if isinstance(choices, tuple):
            _chosen(choices, item, node, key, faults)
        if isinstance(item, (int, float)):
            _check_range(item, limits, node, key, faults)
    return value


def _dataclass_of(kind: type, node: yaml.Node, key: str, faults: list[Fault]) -> object:
    if not isinstance(node, yaml.MappingNode):
        faults.append(_fault(node, key, f"expected keys with values, found {_found(node)}"))
        return _INVALID
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    hints = get_type_hints(kind)
    known, values = len(faults), {}
    for name, name_node, value_node in _items(node, key, faults):
        if name not in fields:
            hint = nearest_names(name, fields)
            faults.append(_fault(name_node, _joined(key, name), f"unknown key; {hint}"))
            continue
        limits = fields[name].metadata
        values[name] = bounded_value_of(hints[name], limits, value_node, _joined(key, name), faults)
    for name, field in fields.items():
        optional = (field.default, field.default_factory) != (dataclasses.MISSING,) * 2
        if name not in values and not optional:
            faults.append(_fault(node, _joined(key, name), "missing; it has no default"))
    if len(faults) > known:
        return _INVALID
    try:
        return kind(**values)
    except (ValueError, UsageError) as err:
        faults.append(_fault(node, key, str(err)))
        return _INVALID


def _sequence_of(
    origin: type, kind: object, node: yaml.Node, key: str, faults: list[Fault]
) -> object:
    if not isinstance(node, yaml.SequenceNode):
        faults.append(_fault(node, key, f"expected a list, found {_found(node)}"))
        return _INVALID
    return origin(
        value_of(kind, item, f"{key}[{index}]", faults) for index, item in enumerate(node.value)
    )


def _mapping_of(kind: object, node: yaml.Node, key: str, faults: list[Fault]) -> object:
    if not isinstance(node, yaml.MappingNode):
        faults.append(_fault(node, key, f"expected keys with values, found {_found(node)}"))
        return _INVALID
    return {
        name: value_of(kind, value_node, _joined(key, name), faults)
        for name, _, value_node in _items(node, key, faults)
    }


def _items(
    node: yaml.MappingNode, key: str, faults: list[Fault]
) -> list[tuple[str, yaml.Node, yaml.Node]]:
    """Key, its node and its value's node; a key that comes twice is a fault."""
    lines: dict[str, int] = {}
    items = []
    for name_node, value_node in node.value:
        name = str(name_node.value)
        line = _place(name_node)[0]
        if name in lines:
            message = f"stands in line {lines[name]} already; keep one of them"
            faults.append(_fault(name_node, _joined(key, name), message))
            continue
        lines[name] = line
        items.append((name, name_node, value_node))
    return items


def _scalar_of(kind: object, node: yaml.Node, key: str, faults: list[Fault]) -> object:
    """A bool, int, float or str. YAML 1.1 reads `no` as false and `1e-3` as text: neither here."""
    text = str(node.value) if isinstance(node, yaml.ScalarNode) else ""
    quoted = isinstance(node, yaml.ScalarNode) and node.style in ("'", '"', "|", ">")
    tag = node.tag.rpartition(":")[2]
    if kind is str and tag == "str":
        return text
    if kind is Path and tag == "str":
        return Path(text)
    if kind is bool and tag == "bool":
        return text.lower() in ("true", "yes", "on")
    if kind is int and not quoted and _INTEGER.fullmatch(text):
        return int(text)
    if kind is float and not quoted and "_" not in text and isinstance(node, yaml.ScalarNode):
        number = _float(text)
        if not math.isnan(number):
            return number
    advice = (
        "; put it in quotes" if kind in (str, Path) and isinstance(node, yaml.ScalarNode) else ""
    )
    faults.append(_fault(node, key, f"expected {_NAMES[kind]}, found {_found(node)}{advice}"))
    return _INVALID


def _float(text: str) -> float:
    """The number, NaN where the text is none (and for NaN, which no configuration needs)."""
    try:
        return _INFINITY.get(text.lower()) or float(text)
    except ValueError:
        return math.nan


_NAMES: dict[object, str] = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "text",
    Path: "a path",
}

_TAGS = {"bool": "the truth value", "int": "the number", "float": "the number", "str": "the text"}


def _found(node: yaml.Node) -> str:
    """What stands at a node, for the end of an error message."""
    if isinstance(node, yaml.MappingNode):
        return "keys with values"
    if isinstance(node, yaml.SequenceNode):
        return "a list"
    if _is_null(node):
        return "nothing"
    return f"{_TAGS.get(node.tag.rpartition(':')[2], 'the value')} {str(node.value)!r}"


def _chosen(
    choices: tuple[object, ...], value: object, node: yaml.Node, key: str, faults: list[Fault]
) -> object:
    if value not in choices and value is not _INVALID:
        hint = nearest_names(str(value), map(str, choices))
        faults.append(_fault(node, key, f"{value!r} is no choice; {hint}"))
    return value


def _check_range(
    value: float, limits: Mapping[str, object], node: yaml.Node, key: str, faults: list[Fault]
) -> None:
    low, high = limits.get("min"), limits.get("max")
    if isinstance(low, (int, float)) and value < low:
        faults.append(_fault(node, key, f"{value!r} is too small; expected at least {low!r}"))
    if isinstance(high, (int, float)) and value > high:
        faults.append(_fault(node, key, f"{value!r} is too large; expected at most {high!r}"))


def _is_null(node: yaml.Node) -> bool:
    return bool(node.tag.endswith(":null"))


def _joined(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def _place(node: yaml.Node) -> tuple[int, int]:
    mark = node.start_mark
    return (mark.line + 1, mark.column + 1) if mark else (0, 0)


def _fault(node: yaml.Node, key: str, message: str) -> Fault:
    return Fault(*_place(node), key, message)
