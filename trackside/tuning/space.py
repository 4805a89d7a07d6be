"""What is searched: the values of each parameter, and the sets of values that are tried."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture import read_yaml
from dialogue import UsageError, nearest_names
from slam.preset_file import is_preset_file, text_of

DIGITS = 6
"""Significant digits of a drawn number: more would only be hard to read."""


@dataclass(frozen=True)
class Values:
    """These values, as a person writes them."""

    texts: tuple[str, ...]

    def draw(self, random: np.random.Generator, *, whole: bool) -> str:  # noqa: ARG002  as Range
        """One of them."""
        return self.texts[int(random.integers(len(self.texts)))]


@dataclass(frozen=True)
class Range:
    """All values between two, both included; with `log` each order of magnitude is as likely."""

    low: float
    high: float
    log: bool = False

    @property
    def texts(self) -> tuple[str, ...]:
        """Its ends, by which its limits can be checked."""
        return (_number_text(self.low), _number_text(self.high))

    def draw(self, random: np.random.Generator, *, whole: bool) -> str:
        """One value."""
        if whole:
            return str(int(random.integers(math.ceil(self.low), math.floor(self.high) + 1)))
        ends = (math.log(self.low), math.log(self.high)) if self.log else (self.low, self.high)
        value = float(random.uniform(*ends))
        return f"{math.exp(value) if self.log else value:.{DIGITS}g}"


Dimension = Values | Range
Space = Mapping[str, Dimension]
ParameterSet = Mapping[str, str]
"""Parameter -> its value as text; empty for the preset as it is."""


def parsed_space(words: Sequence[str]) -> Space:
    """The space that files and `KEY=LIST` words tell; later ones replace earlier ones.

    A list is `1,2,3`, `[1, 2, 3]` or `{min: 1, max: 3, scale: log}`. Raises `UsageError` with a
    line for every word that cannot be understood, `TextFileError` for files.
    """
    space: dict[str, Dimension] = {}
    faults = []
    for word in words:
        try:
            if is_preset_file(word):
                entries: Mapping[str, object] = read_yaml(Path(word))
            else:
                entries = dict([_assignment(word)])
            space |= {key: _dimension(key, value) for key, value in entries.items()}
        except UsageError as err:
            faults.append(str(err))
    if faults:
        raise UsageError("\n".join(faults))
    if not space:
        raise UsageError("nothing to search: give --parameters FILE.yaml or KEY=1,2,3")
    return space


def grid(space: Space) -> Iterator[ParameterSet]:
    """Every combination of values; raises `UsageError` where there is a range."""
    ranges = [key for key, dimension in space.items() if isinstance(dimension, Range)]
    if ranges:
        raise UsageError(
            f"{', '.join(ranges)}: a range has no end of values; give --runs N to draw from it, or "
            "a list"
        )
    for texts in itertools.product(*(dimension.texts for dimension in space.values())):
        yield dict(zip(space, texts, strict=True))


def draws(
    space: Space, whole: Mapping[str, bool], seed: int, number: int
) -> Iterator[ParameterSet]:
    """Sets drawn for place `number` of a search, without end: take the first that is possible.

    Each place has random numbers of its own, so that a longer search begins as a shorter one.
    """
    random = np.random.default_rng([seed, number])
    while True:
        yield {key: space[key].draw(random, whole=whole[key]) for key in sorted(space)}


def _assignment(word: str) -> tuple[str, object]:
    import yaml

    key, equals, text = word.partition("=")
    if not equals or not key.strip():
        raise UsageError(
            f"--parameters {word}: expected FILE.yaml or KEY=LIST, as accept_gate=6,9,12"
        )
    text = text.strip()
    try:
        value = yaml.safe_load(text if text[:1] in ("[", "{") else f"[{text}]")
    except yaml.YAMLError as err:
        raise UsageError(f"--parameters {word}: not a list of values") from err
    return key.strip(), value


def _dimension(key: str, value: object) -> Dimension:
    if isinstance(value, Mapping):
        return _range(key, value)
    values = value if isinstance(value, list) else [value]
    nested = [entry for entry in values if isinstance(entry, list | Mapping)]
    if not values or nested:
        raise UsageError(f"{key}: expected a list of values, or min and max")
    return Values(tuple(dict.fromkeys(text_of(entry) for entry in values)))


def _range(key: str, value: Mapping[object, object]) -> Range:
    names = ("min", "max", "scale")
    for name in map(str, value):
        if name not in names:
            raise UsageError(f"{key}: no {name!r} in a range; {nearest_names(name, names)}")
    try:
        low, high = (float(str(value[name])) for name in ("min", "max"))
    except (KeyError, ValueError) as err:
        raise UsageError(f"{key}: a range needs the numbers min and max") from err
    scale = value.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise UsageError(f"{key}: scale {scale}: expected linear or log")
    if not -math.inf < low < high < math.inf or (scale == "log" and low <= 0.0):
        raise UsageError(
            f"{key}: from {low:g} to {high:g} is no range; expected min below max"
            + (", both above 0" if scale == "log" else "")
        )
    return Range(low, high, scale == "log")


def _number_text(value: float) -> str:
    return str(int(value)) if value == int(value) else repr(value)
