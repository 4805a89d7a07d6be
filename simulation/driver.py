"""A person at the remote control: follows the line, holds a speed, gives power in the turns.

The thesis: more power "did not cause the car to drive much faster, but caused it to drift during
turns" (section 3.2.3). So power is how hard the wheels spin in the bursts with which a turn is
taken; the speed over all stays nearly the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dialogue import UsageError, nearest_names
from simulation.car import Command
from simulation.tracks import Track


@dataclass(frozen=True, kw_only=True)
class Power:
    """A setting of the engine: the speed aimed at, and how much faster the wheels spin in bursts.

    burst : of the speed, added to it for `burst_s` of every `every_s` while the car turns.
    """

    speed_m_s: float
    burst: float
    burst_s: float = 0.30
    every_s: float = 0.75


POWERS = {
    "low": Power(speed_m_s=0.68, burst=0.0),
    "medium": Power(speed_m_s=0.74, burst=0.9),
    "high": Power(speed_m_s=0.84, burst=2.2),
}
AHEAD_M = 0.38
"""How far ahead of the rear axle the driver looks (pure pursuit; Coulter, CMU-RI-TR-92-01)."""
PULL_M_S2 = 0.9
TURNING_PER_M = 0.45
"""Curvature from which on a driver gives power."""
STOP_M = 0.03
REACTION = 1.2
"""How strongly he corrects his speed."""


def power(name: str) -> Power:
    """The setting of that name; raises `UsageError`."""
    if name not in POWERS:
        raise UsageError(f"--power {name}: no such setting; {nearest_names(name, POWERS)}")
    return POWERS[name]


class Driver:
    """Commands from where the car is; it has its own way of driving, drawn from `rng`.

    He aims a little beside the line, wanders, and is never twice equally fast.
    """

    def __init__(
        self, track: Track, setting: Power, wheelbase_m: float, rng: np.random.Generator
    ) -> None:
        self._line, self._pace = track.line, track.pace
        self._power, self._wheelbase_m = setting, wheelbase_m
        step = np.hypot(*np.diff(track.line, axis=0).T)
        self._travelled = np.concatenate([[0.0], np.cumsum(step)])
        self._near = 0
        self._speed_m_s = setting.speed_m_s * (1.0 + 0.06 * float(rng.uniform(-1.0, 1.0)))
        self._wander = [
            (0.02 * float(rng.uniform(0.3, 1.0)), rate, float(rng.uniform(0.0, math.tau)))
            for rate in (0.7, 1.7, 3.1)
        ]
        self._phase_s = float(rng.uniform(0.0, setting.every_s))
        self.finished = False

    def command(self, t_s: float, pose: tuple[float, float, float], speed_m_s: float) -> Command:
        """What he does at a time (since he began) with base_link at `pose`, so fast."""
        x, y, heading = pose
        left_m = self._progress(x, y)
        self.finished = self.finished or left_m < STOP_M
        if self.finished:
            return Command(0.0, 0.0)
        aim_x, aim_y = self._aim(t_s)
        ahead = (aim_x - x) * math.cos(heading) + (aim_y - y) * math.sin(heading)
        aside = (aim_y - y) * math.cos(heading) - (aim_x - x) * math.sin(heading)
        curvature = 2.0 * aside / max(ahead * ahead + aside * aside, 1e-6)
        pace = float(self._pace[self._near])
        speed = self._speed_m_s * pace
        wanted = min(speed, 0.10 + PULL_M_S2 * t_s, math.sqrt(2.0 * PULL_M_S2 * left_m))
        wheel = wanted + REACTION * min(wanted - speed_m_s, 0.1)
        turns = abs(curvature) > TURNING_PER_M and left_m > 0.6
        # Where a pace is told the driver measures, he does not race.
        if turns and pace == 1.0 and self._bursting(t_s):
            wheel += self._power.burst * self._speed_m_s
        return Command(max(wheel, 0.0), math.atan(self._wheelbase_m * curvature))

    def _progress(self, x: float, y: float) -> float:
        """How far it still is to the end; the nearest point of the line never goes back."""
        window = self._line[self._near : self._near + 60]
        self._near += int(np.argmin((window[:, 0] - x) ** 2 + (window[:, 1] - y) ** 2))
        return float(self._travelled[-1] - self._travelled[self._near])

    def _aim(self, t_s: float) -> tuple[float, float]:
        at = self._travelled[self._near] + AHEAD_M
        beyond = max(at - self._travelled[-1], 0.0)
        x, y = (float(np.interp(at, self._travelled, self._line[:, k])) for k in range(2))
        dx, dy = (
            self._line[min(self._near + 38, len(self._line) - 1)]
            - self._line[min(self._near + 37, len(self._line) - 2)]
        )
        size = math.hypot(dx, dy)
        aside = sum(size_m * math.sin(rate * t_s + phase) for size_m, rate, phase in self._wander)
        return (
            x + (beyond * dx - aside * dy) / size,
            y + (beyond * dy + aside * dx) / size,
        )

    def _bursting(self, t_s: float) -> bool:
        return (t_s + self._phase_s) % self._power.every_s < self._power.burst_s
