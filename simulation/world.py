"""One seed, one world: a track with its cones as they were set down, a drive, exact truth."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geometry import Floats, LandmarkMap
from simulation.build import AS_BUILT, AS_DRAWN, Build
from simulation.drive import Drive, driven
from simulation.driver import power
from simulation.surfaces import Room, Surroundings
from simulation.tracks import SIDE_M, track

START_UTC_NS = 1_557_835_200_000_000_000
"""14 May 2019, noon: a simulated recording is of that day."""
CONE_SIGMA_M = 0.02
CORNER_SIGMA_M = 0.002
_STREAMS = ("drive", "cones", "room", "lidar", "imu", "corners", "film", "clock", "stereo")


@dataclass(frozen=True, eq=False)
class World:
    """What is true.

    cones : where they stand; corners : (4, 2) of the corner markers, the first is the origin and
    the second lies on the x axis. `rng(what)` gives the random numbers of one purpose, so that a
    change in one does not move the others.
    """

    map: str
    power: str
    seed: int
    drive: Drive
    cones: LandmarkMap
    corners: Floats
    around: Surroundings
    built: Build = AS_BUILT
    drawn: Build = AS_DRAWN
    room: Room = field(default_factory=Room)

    def rng(self, what: str) -> np.random.Generator:
        """Random numbers for one of the purposes of this room."""
        return _rng(self.seed, what)


def world(map_name: str, power_name: str, seed: int) -> World:
    """The world of a seed; raises `UsageError` for names that are none."""
    layout, setting, room = track(map_name), power(power_name), Room()
    placed = layout.cones + CONE_SIGMA_M * _rng(seed, "cones").standard_normal(layout.cones.shape)
    return World(
        map_name,
        power_name,
        seed,
        driven(layout, setting, AS_BUILT.model, _rng(seed, "drive")),
        LandmarkMap(np.arange(1, len(placed) + 1), placed),
        site_corners(),
        room.around(placed, AS_BUILT.lidar.height_m, _rng(seed, "room")),
        room=room,
    )


def site_corners() -> Floats:
    """Where somebody laid the corner markers down, the same for every seed: there is one site."""
    square = SIDE_M * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    off = CORNER_SIGMA_M * _rng(0, "corners").standard_normal((4, 2))
    off[0] = 0.0
    off[1, 1] = 0.0
    corners: Floats = square + off
    return corners


def _rng(seed: int, what: str) -> np.random.Generator:
    return np.random.default_rng([seed, _STREAMS.index(what)])
