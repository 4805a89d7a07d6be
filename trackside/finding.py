"""One thing that `trackside doctor` looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """What was looked at, whether it is well, what was seen, what to do if not."""

    what: str
    well: bool
    seen: str
    remedy: str = ""
