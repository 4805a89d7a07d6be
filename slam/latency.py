"""How long scans took from the sensor to the pose."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


class Latency:
    """Two times for each scan.

    update : computing, from the scan to the new pose: cones, prediction and update; age : from the
    arrival of the scan (log time) to the new pose, of scans that arrived while we were watching.
    """

    def __init__(self) -> None:
        self._update_s: list[float] = []
        self._age_s: list[float] = []

    def note(self, update_s: float, age_s: float | None) -> None:
        """Note the times of one scan; age None where it is older than our watch."""
        self._update_s.append(update_s)
        if age_s is not None:
            self._age_s.append(age_s)

    @property
    def last_update_s(self) -> float | None:
        """Of the last scan."""
        return self._update_s[-1] if self._update_s else None

    @property
    def last_age_s(self) -> float | None:
        """Of the last scan that arrived while we were watching."""
        return self._age_s[-1] if self._age_s else None

    def summary(self) -> dict[str, object]:
        """What an estimate keeps of it (`docs/formats.md`)."""
        return {
            "scans": len(self._update_s),
            "update_s": _statistics(self._update_s),
            "live_scans": len(self._age_s),
            "age_s": _statistics(self._age_s),
        }


def _statistics(times_s: Sequence[float]) -> dict[str, float] | None:
    if not times_s:
        return None
    times = np.array(times_s)
    return {
        "median": float(np.median(times)),
        "p99": float(np.quantile(times, 0.99)),
        "max": float(times.max()),
    }
