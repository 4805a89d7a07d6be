"""The layouts that are driven: the thesis' three maps, and one for calibrating the car.

Cones stand inside the square of 4 x 4 m whose corners are corner markers; the line is what the
driver wants `base_link` to follow. (Thesis section 3.2.3 and figure 3.6: turn and s-curve from the
bottom left to the top right, loop one lap around the middle; the exact places are ours.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dialogue import UsageError, nearest_names
from geometry import Floats

SIDE_M = 4.0
LANE_M = 0.45
"""From the line to the cones on either side."""
_STEP_M = 0.01


@dataclass(frozen=True, eq=False)
class Track:
    """line : (k, 2) points 1 cm apart, the first is the start; cones : (n, 2).

    pace : (k,) how fast the line is driven at each point, 1 as the power has it.
    """

    name: str
    line: Floats
    cones: Floats
    pace: Floats

    @property
    def length_m(self) -> float:
        """Along the line."""
        return float(np.hypot(*np.diff(self.line, axis=0).T).sum())

    @property
    def start(self) -> Floats:
        """(3,) pose on the line."""
        dx, dy = self.line[1] - self.line[0]
        return np.array([*self.line[0], math.atan2(dy, dx)])


def track(name: str) -> Track:
    """The layout of that name; raises `UsageError`."""
    if name not in TRACKS:
        raise UsageError(f"--map {name}: no such map; {nearest_names(name, TRACKS)}")
    return TRACKS[name]()


class _Line:
    """Points along straights and arcs, one after the other."""

    def __init__(self, x: float, y: float, heading: float = 0.0) -> None:
        self.points = [np.array([[x, y]])]
        self._at, self._heading = np.array([x, y]), heading

    def straight(self, length_m: float) -> _Line:
        """Go ahead."""
        along = np.array([math.cos(self._heading), math.sin(self._heading)])
        s = np.linspace(0.0, length_m, max(round(length_m / _STEP_M), 1) + 1)[1:, None]
        self.points.append(self._at + s * along)
        self._at = self._at + length_m * along
        return self

    def arc(self, radius_m: float, turn_rad: float) -> _Line:
        """Turn, counter-clockwise if `turn_rad` is positive."""
        side = math.copysign(1.0, turn_rad)
        normal = side * np.array([-math.sin(self._heading), math.cos(self._heading)])
        centre = self._at + radius_m * normal
        steps = max(round(abs(turn_rad) * radius_m / _STEP_M), 1)
        angle = self._heading + np.linspace(0.0, turn_rad, steps + 1)[1:]
        outward = side * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        self.points.append(centre + radius_m * outward)
        self._at, self._heading = self.points[-1][-1], self._heading + turn_rad
        return self

    @property
    def line(self) -> Floats:
        """(k, 2)."""
        return np.concatenate(self.points)


def _turn() -> Track:
    line = _Line(0.55, 0.75).straight(1.45).arc(1.1, math.pi / 2).straight(1.4).line
    at = np.linspace(0.45, 4.4, 7)
    return Track("turn", line, _beside(line, at, at), np.ones(len(line)))


def _s_curve() -> Track:
    quarter = math.pi / 2
    line = _Line(0.5, 0.8).straight(0.5).arc(1.0, quarter).arc(1.0, -quarter).straight(0.5).line
    at = np.linspace(0.4, 3.9, 8)
    return Track("s-curve", line, _beside(line, at, at), np.ones(len(line)))


def _loop() -> Track:
    line = _Line(2.0, 0.75).arc(1.25, 2.0 * math.pi).line
    outside, inside = (np.arange(n) * 2.0 * math.pi / n for n in (9, 5))
    ring = [
        2.0 + radius * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        for radius, angle in ((1.25 + LANE_M, outside + 0.2), (1.25 - LANE_M, inside + 0.4))
    ]
    return Track("loop", line, np.concatenate(ring), np.ones(len(line)))


def _figures() -> Track:
    """Straights, then circles of two radii to either side, as an eight: slowly, then faster."""
    drawn, paces = _Line(0.55, 2.0).straight(1.45), [1.0]
    ends = [len(drawn.line)]
    for radius_m, slower in ((0.60, 0.55), (0.75, 0.55), (0.75, 1.15)):
        drawn.arc(radius_m, 2.0 * math.pi).arc(radius_m, -2.0 * math.pi)
        paces.append(slower)
        ends.append(len(drawn.line))
    line = drawn.straight(1.4).line
    pace = np.repeat([*paces, 1.0], np.diff([0, *ends, len(line)]))
    near, middle, far = 0.2, 2.0, SIDE_M - 0.2
    around = [
        (near, near), (1.1, near), (2.9, near), (far, near), (far, 1.2), (far, 2.8), (far, far),
        (2.9, far), (1.1, far), (near, far), (near, 2.8), (near, 1.2), (middle, near),
    ]  # fmt: skip
    return Track("figures", line, np.array(around), pace)


def _beside(line: Floats, left_at: Floats, right_at: Floats) -> Floats:
    """Cones to the left and to the right of the line, at those distances along it."""
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    along = np.gradient(line, travelled, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sides: Sequence[tuple[Floats, float]] = ((left_at, LANE_M), (right_at, -LANE_M))
    placed = [
        np.stack(
            [np.interp(at, travelled, line[:, k] + aside * normal[:, k]) for k in range(2)], axis=1
        )
        for at, aside in sides
    ]
    return np.concatenate(placed)


TRACKS: dict[str, Callable[[], Track]] = {
    "turn": _turn,
    "s-curve": _s_curve,
    "loop": _loop,
    "figures": _figures,
}
