"""A preset as a file: where to start from, what to change, and the evidence for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from capture import ConfigurationError, read_configuration

FORMAT = 1
SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True, kw_only=True)
class PresetFile:
    """What `trackside slam --preset FILE.yaml` runs.

    algorithm, preset : to start from; settings : key -> value on top, `cones.` and `odometry.`
    before those of the cone finder and the source; odometry, association : None takes what is
    there; evidence : how it was found, for the reader.
    """

    format: int = FORMAT
    algorithm: str
    preset: str
    odometry: str | None = None
    association: str | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    evidence: Mapping[str, object] = field(default_factory=dict)

    @property
    def words(self) -> tuple[str, ...]:
        """The settings as `--set` takes them."""
        return tuple(f"{key}={text_of(value)}" for key, value in self.settings.items())


def is_preset_file(words: str) -> bool:
    """Whether the words of `--preset` name a file rather than a preset."""
    return words.lower().endswith(SUFFIXES)


def read_preset_file(file: Path) -> PresetFile:
    """The preset in a file; raises `ConfigurationError` with every fault and its place."""
    found = read_configuration(PresetFile, file)
    if found.format > FORMAT:
        raise ConfigurationError(
            f"{file}: has format {found.format}; this trackside reads formats up to {FORMAT}; "
            "update trackside"
        )
    return found


def text_of(value: object) -> str:
    """A setting's value as a person would write it after `key=`."""
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return "null"
    if isinstance(value, float):
        return {"inf": ".inf", "-inf": "-.inf"}.get(repr(value), repr(value))
    return str(value)
