"""A whole drive of the virtual car: exact truth at every millisecond."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from geometry import Floats, Stamps, Trajectory, wrap
from simulation.car import CarModel, CarState, Command, advanced, rates
from simulation.driver import Driver, Power
from simulation.tracks import Track

STEP_NS = 1_000_000
LOOK_STEPS = 20
"""The driver looks and acts fifty times a second."""
STANDS_S, RESTS_S = 2.5, 0.7
LONGEST_S = 120.0


class Moment(NamedTuple):
    """The car at one moment; base_link in the world, motion in the car's frame.

    ahead_m_s, aside_m_s : of base_link; pulled_m_s2 : (ahead, aside) acceleration of the centre of
    mass, gravity left out; counted_m : by the driven wheels.
    """

    x_m: float
    y_m: float
    heading_rad: float
    ahead_m_s: float
    aside_m_s: float
    turn_rad_s: float
    pulled_ahead_m_s2: float
    pulled_aside_m_s2: float
    wheel_m_s: float
    counted_m: float
    steering_rad: float


@dataclass(frozen=True, eq=False)
class Drive:
    """What happened: a row of `Moment` every millisecond from world time 0 on.

    rows : (n, 11). commands : (m, 3) time in s, wheels' speed and steering that were commanded.
    Before the first row the car stands there, after the last row it stands there.
    """

    rows: Floats
    commands: Floats

    @property
    def end_ns(self) -> int:
        """World time of the last row."""
        return (len(self.rows) - 1) * STEP_NS

    def at(self, t_ns: int) -> Moment:
        """The car at a world time."""
        place = min(max(t_ns / STEP_NS, 0.0), len(self.rows) - 1.0)
        row = min(int(place), len(self.rows) - 2)
        part = place - row
        before, after = self.rows[row].tolist(), self.rows[row + 1].tolist()
        return Moment(*(a + part * (b - a) for a, b in zip(before, after, strict=True)))

    def poses(self, t_ns: Stamps) -> Floats:
        """(k, 3) of base_link at world times (k,); headings are not wrapped."""
        at = np.arange(len(self.rows)) * float(STEP_NS)
        return np.stack(
            [np.interp(t_ns.astype(np.float64), at, self.rows[:, k]) for k in range(3)], axis=1
        )

    def path(self, zero_ns: int, every: int = 5) -> Trajectory:
        """The truth as a trajectory; world time 0 is at `zero_ns`, one pose for `every` rows."""
        rows = self.rows[::every]
        t_ns = zero_ns + np.arange(len(rows), dtype=np.int64) * (STEP_NS * every)
        return Trajectory(t_ns, rows[:, 0], rows[:, 1], np.asarray(wrap(rows[:, 2])))


def driven(track: Track, setting: Power, car: CarModel, rng: np.random.Generator) -> Drive:
    """Stand for `STANDS_S`, follow the line, come to rest; `RuntimeError` if that never ends."""
    driver = Driver(track, setting, car.wheelbase_m, rng)
    x, y, heading = track.start
    com = car.com_m
    state = CarState(
        x + com * math.cos(heading), y + com * math.sin(heading), heading, 0, 0, 0, 0, 0, 0
    )
    rows: list[Moment] = []
    commands: list[tuple[float, float, float]] = []
    command, left_s, limit = Command(0.0, 0.0), RESTS_S, car.steering_limit_rad
    for step in range(round(LONGEST_S * 1e9 / STEP_NS)):
        t_s = step * STEP_NS * 1e-9
        here = _moment(car, state, command)
        rows.append(here)
        if step % LOOK_STEPS == 0 and t_s >= STANDS_S:
            wanted = driver.command(t_s - STANDS_S, here[:3], here.ahead_m_s)
            command = Command(wanted.wheel_m_s, min(max(wanted.steering_rad, -limit), limit))
        if step % LOOK_STEPS == 0:
            commands.append((t_s, *command))
        if driver.finished and abs(here.ahead_m_s) < 0.01:
            left_s -= STEP_NS * 1e-9
            if left_s <= 0.0:
                return Drive(np.array(rows), np.array(commands))
        state = advanced(car, state, command, STEP_NS * 1e-9)
    raise RuntimeError(f"the car did not reach the end of {track.name} in {LONGEST_S:g} s")


def _moment(car: CarModel, state: CarState, command: Command) -> Moment:
    com = car.com_m
    change = rates(car, state, command)
    return Moment(
        state.x_m - com * math.cos(state.heading_rad),
        state.y_m - com * math.sin(state.heading_rad),
        state.heading_rad,
        state.ahead_m_s,
        state.aside_m_s - com * state.turn_rad_s,
        state.turn_rad_s,
        change.ahead_m_s - state.turn_rad_s * state.aside_m_s,
        change.aside_m_s + state.turn_rad_s * state.ahead_m_s,
        state.wheel_m_s,
        state.counted_m,
        state.steering_rad,
    )
