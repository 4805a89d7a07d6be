"""Which columns the default firmware prints, and how to find that out from its lines. Pure.

Its keys are toggles in flash and it cannot be asked, so the lines themselves must tell: how many
numbers, with how many decimals, and of what size (reference protocols C.2).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from drivers.imu.mpu9250 import registers as reg
from drivers.imu.razor.lines import Row

Floats = npt.NDArray[np.float64]

MOST_STEP_MS = 2100
"""Between two lines, at 1 Hz with one of them missing."""
QUATERNION_ONE = float(1 << 30)
WORST, CLEAR = 3.0, 0.5


@dataclass(frozen=True)
class Columns:
    """What each line holds, in this order; raw: counts in place of g, deg/s and uT."""

    time: bool
    accel: bool
    gyro: bool
    mag: bool
    quaternion: bool
    euler: bool
    heading: bool
    raw: bool

    def decimals(self) -> tuple[int, ...]:
        """How many decimals each number of a line has."""
        return tuple(
            digits
            for name, (count, calculated, raw) in GROUPS.items()
            if getattr(self, name)
            for digits in [raw if self.raw else calculated] * count
        )

    def places(self) -> dict[str, slice]:
        """Where each group that is on stands in a line."""
        found, at = {}, 0
        for name, (count, _, _) in GROUPS.items():
            if getattr(self, name):
                found[name] = slice(at, at + count)
                at += count
        return found

    def toggled(self, key: str) -> Columns:
        """After one of `KEYS` was pressed."""
        name = NAMES[key]
        return replace(self, **{name: not getattr(self, name)})

    def key_towards(self, wished: Columns) -> str | None:
        """The next key to press, None if it is as wished."""
        for key in KEY_ORDER:
            if getattr(self, NAMES[key]) != getattr(wished, NAMES[key]):
                return key
        return None


GROUPS = {
    "time": (1, 0, 0),
    "accel": (3, 2, 0),
    "gyro": (3, 2, 0),
    "mag": (3, 2, 0),
    "quaternion": (4, 4, 0),
    "euler": (3, 2, 2),
    "heading": (1, 2, 2),
}
"""Numbers in a group, and their decimals when calculated and when raw."""
NAMES = {
    "t": "time",
    "c": "raw",
    "a": "accel",
    "g": "gyro",
    "m": "mag",
    "q": "quaternion",
    "e": "euler",
    "h": "heading",
}
KEY_ORDER = "tacgmqeh"
"""The accelerometer before raw values, which cannot be seen while there are none."""
FACTORY = Columns(True, True, True, True, False, False, False, raw=False)
WISHED = replace(FACTORY, raw=True)

EVERY = tuple(
    Columns(*switches) for switches in itertools.product((True, False), repeat=len(fields(Columns)))
)


def candidates(rows: Sequence[Row]) -> list[Columns]:
    """Every state that prints such lines, the likeliest first.

    rows : some lines of one form. Sizes decide among states of the same form; they are right for a
    car at rest, and among equals that which is nearer to the factory's.
    """
    if not rows:
        return []
    values = np.array([row.values for row in rows], float)
    likely = [
        (_unlikeliness(columns, values), k, columns)
        for k, columns in enumerate(_BY_FORM.get(rows[0].decimals, ()))
    ]
    return [columns for _, _, columns in sorted(likely, key=lambda item: item[:2])]


def accel_range_g(mean_count: float) -> tuple[int, bool]:
    """The full scale at which so many counts are 1 g, and whether that is beyond doubt.

    mean_count : size of the acceleration in raw mode, best at rest.
    """
    octaves = [abs(math.log2(max(mean_count, 1.0) / counts)) for counts in reg.ACCEL_COUNTS_PER_G]
    nearest = octaves.index(min(octaves))
    return reg.ACCEL_RANGES_G[nearest], octaves[nearest] < 0.3


def _unlikeliness(columns: Columns, values: Floats) -> float:
    """How badly sizes fit; 0 is a perfect fit at rest."""
    unusual = [
        item.name
        for item in fields(Columns)
        if getattr(columns, item.name) != getattr(FACTORY, item.name)
    ]
    misfits = (
        _MISFITS[name](values[:, place], columns.raw) for name, place in columns.places().items()
    )
    return 0.05 * len(unusual) + sum(misfits)


def _time_misfit(values: Floats, _: bool) -> float:
    steps = np.diff(values[:, 0])
    grows = bool(((steps > 0) & (steps < MOST_STEP_MS)).all())
    return 0.0 if grows and bool((values >= 0).all()) else WORST


def _accel_misfit(values: Floats, raw: bool) -> float:
    size = max(float(np.linalg.norm(values, axis=1).mean()), 1e-6)
    ones = reg.ACCEL_COUNTS_PER_G if raw else (1.0,)
    misfit: float = min(WORST, min(abs(math.log2(size / one)) for one in ones))
    return misfit - CLEAR if misfit < 0.1 else misfit  # nothing else is 1 g by chance


def _gyro_misfit(values: Floats, raw: bool) -> float:
    return _beyond(values, 0.0, 160.0 if raw else 10.0)


def _mag_misfit(values: Floats, raw: bool) -> float:
    unit = 1.0 if raw else 0.15
    return _beyond(values, 100.0 * unit, 800.0 * unit)


def _quaternion_misfit(values: Floats, raw: bool) -> float:
    size = np.linalg.norm(values, axis=1) / (QUATERNION_ONE if raw else 1.0)
    return min(WORST, 10.0 * float(np.abs(size - 1.0).max()))


def _angle_misfit(values: Floats, _: bool) -> float:
    return 0.0 if bool(((values >= -180.0) & (values <= 360.0)).all()) else WORST


def _beyond(values: Floats, least: float, most: float) -> float:
    """Octaves by which the mean size is out of its bounds."""
    size = max(float(np.linalg.norm(values, axis=1).mean()), 1e-6)
    low = math.log2(least / size) if size < least else 0.0
    high = math.log2(size / most) if size > most else 0.0
    return min(WORST, max(low, high))


_BY_FORM = {
    form: tuple(states)
    for form, states in itertools.groupby(sorted(EVERY, key=Columns.decimals), key=Columns.decimals)
}
_MISFITS: dict[str, Callable[[Floats, bool], float]] = {
    "time": _time_misfit,
    "accel": _accel_misfit,
    "gyro": _gyro_misfit,
    "mag": _mag_misfit,
    "quaternion": _quaternion_misfit,
    "euler": _angle_misfit,
    "heading": _angle_misfit,
}
