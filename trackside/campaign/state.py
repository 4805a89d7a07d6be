"""What was made of a session already, and by which inputs: one small file for each."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from capture import LogError, write_text


@dataclass
class State:
    """Task -> the digest of everything that decided what it made; every change is kept at once.

    The digest of a task is blotted out before it is begun again, so that a broken one is never
    taken for done, and yet is known to be ours.
    """

    file: Path
    _keys: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, file: Path) -> State:
        """The state in a file; nothing was made where there is none, or none that can be read."""
        try:
            held = json.loads(file.read_text(encoding="utf-8"))
            keys = {str(name): str(key) for name, key in held["made"].items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            keys = {}
        return cls(file, keys)

    @property
    def keys(self) -> Mapping[str, str]:
        """Task -> digest."""
        return dict(self._keys)

    def made(self, task: str, key: str) -> None:
        """Note that a task is done."""
        self._keys[task] = key
        self._write()

    def begun(self, task: str) -> None:
        """Note that what a task made before does not count any more."""
        if self._keys.get(task):
            self._keys[task] = ""
            self._write()

    def forget(self, tasks: Iterable[str]) -> None:
        """Note that what these tasks made is gone."""
        gone = [task for task in tasks if self._keys.pop(task, None) is not None]
        if gone:
            self._write()

    def _write(self) -> None:
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
        except OSError as err:
            why = err.strerror or str(err)
            raise LogError(f"cannot write {self.file}: {why}; choose another -o") from err
        write_text(self.file, json.dumps({"made": self._keys}, indent=1) + "\n")
