"""What stands in the plane of the lidar: cones, table legs and boxes, and the walls of the room."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geometry import Floats
from simulation.tracks import SIDE_M


@dataclass(frozen=True, kw_only=True)
class ConeShape:
    """A cone cut off at `top_m`; its ring of paper lies on the top."""

    base_radius_m: float = 0.09
    apex_m: float = 0.36
    top_m: float = 0.30

    def radius_m(self, height_m: float) -> float:
        """Of its section at a height."""
        return self.base_radius_m * (1.0 - height_m / self.apex_m)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """centres (n, 2) and radii (n,) of what is round; walls (m, 4): segments x1, y1, x2, y2."""

    centres: Floats
    radii: Floats
    walls: Floats

    def distances(self, x: Floats, y: Floats, angle: Floats) -> tuple[Floats, Floats]:
        """How far rays (k,) go until they hit, and the cosine of their angle to the surface there.

        Infinity where they hit nothing.
        """
        ux, uy = np.cos(angle), np.sin(angle)
        round_m, round_cos = self._to_round(x, y, ux, uy)
        flat_m, flat_cos = self._to_flat(x, y, ux, uy)
        nearer = round_m < flat_m
        return np.where(nearer, round_m, flat_m), np.where(nearer, round_cos, flat_cos)

    def _to_round(self, x: Floats, y: Floats, ux: Floats, uy: Floats) -> tuple[Floats, Floats]:
        dx, dy = self.centres[:, 0] - x[:, None], self.centres[:, 1] - y[:, None]
        along = dx * ux[:, None] + dy * uy[:, None]
        aside2 = dx * dx + dy * dy - along * along
        half2 = self.radii**2 - aside2
        hit = (half2 > 0.0) & (along > 0.0)
        half = np.sqrt(np.maximum(half2, 0.0))
        far = np.where(hit, along - half, np.inf)
        first = far.argmin(axis=1)
        rows = np.arange(x.size)
        return far[rows, first], half[rows, first] / self.radii[first]

    def _to_flat(self, x: Floats, y: Floats, ux: Floats, uy: Floats) -> tuple[Floats, Floats]:
        x1, y1, x2, y2 = self.walls.T
        wx, wy = x2 - x1, y2 - y1
        across = ux[:, None] * wy - uy[:, None] * wx
        with np.errstate(divide="ignore", invalid="ignore"):
            dx, dy = x1 - x[:, None], y1 - y[:, None]
            far = (dx * wy - dy * wx) / across
            part = (dx * uy[:, None] - dy * ux[:, None]) / across
        far = np.where((far > 0.0) & (part >= 0.0) & (part <= 1.0), far, np.inf)
        first = far.argmin(axis=1)
        rows = np.arange(x.size)
        return far[rows, first], np.abs(across[rows, first]) / np.hypot(wx, wy)[first]


@dataclass(frozen=True, kw_only=True)
class Room:
    """The room around the track: how far its walls are from the square, and what stands there."""

    beyond_m: float = 1.5
    boxes: int = 3
    legs: int = 8
    leg_radius_m: float = 0.02
    cone: ConeShape = field(default_factory=ConeShape)

    def around(self, cones: Floats, height_m: float, rng: np.random.Generator) -> Surroundings:
        """What a lidar at that height can hit; boxes and legs stand outside of the square."""
        low, high = -self.beyond_m, SIDE_M + self.beyond_m
        corners = np.array([[low, low], [high, low], [high, high], [low, high]])
        walls = [np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)]
        walls += [_box(_outside(rng, 0.5, 1.1), rng) for _ in range(self.boxes)]
        legs = np.array([_outside(rng, 0.4, 1.3) for _ in range(self.legs)]).reshape(-1, 2)
        radii = np.repeat(
            [self.cone.radius_m(height_m), self.leg_radius_m], [len(cones), len(legs)]
        )
        return Surroundings(np.concatenate([cones, legs]), radii, np.concatenate(walls))


def _outside(rng: np.random.Generator, nearest_m: float, furthest_m: float) -> Floats:
    """A place beside one of the four sides of the square."""
    beyond, along = float(rng.uniform(nearest_m, furthest_m)), float(rng.uniform(0.0, SIDE_M))
    places = [
        (along, -beyond),
        (SIDE_M + beyond, along),
        (along, SIDE_M + beyond),
        (-beyond, along),
    ]
    return np.array(places[int(rng.integers(4))])


def _box(centre: Floats, rng: np.random.Generator) -> Floats:
    turn, half = float(rng.uniform(0.0, np.pi)), rng.uniform(0.12, 0.25, 2)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    corners = centre + (half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])) @ axes
    return np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)
