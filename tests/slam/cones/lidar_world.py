"""A lidar among cones and walls, beam by beam, on a car that moves: what a real one would say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from capture import Odometry, Scans
from geometry import Floats, compose

PERIOD_NS = 66_666_667
Wall = tuple[float, float, float, float]


def room(half_m: float) -> list[Wall]:
    """Four walls around the origin."""
    a = half_m
    return [(-a, -a, a, -a), (a, -a, a, a), (a, a, -a, a), (-a, a, -a, -a)]


@dataclass
class LidarWorld:
    """Cones (k, 2) and walls in the world, and how the car with the lidar drives through them."""

    cones: Floats
    walls: Sequence[Wall] = ()
    radius_m: float = 0.05
    beams: int = 800
    speed_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)
    range_sigma_m: float = 0.0
    seed: int = 0

    def pose(self, t_s: Floats) -> Floats:
        """(n, 3): a circle at constant speed, through the origin at time 0."""
        turn = self.yaw_rate_rad_s * t_s
        half = np.sinc(turn / 2 / math.pi) * self.speed_m_s * t_s
        return np.stack([half * np.cos(turn / 2), half * np.sin(turn / 2), turn], axis=1)

    def ranges(self, lidar: Floats, bearing_rad: Floats) -> Floats:
        """(n,): from each pose of the lidar (n, 3) along each bearing; NaN without echo."""
        angle = lidar[:, 2] + bearing_rad
        cos, sin = np.cos(angle), np.sin(angle)
        nearest = np.full(angle.size, np.inf)
        for x, y in self.cones:
            dx, dy = x - lidar[:, 0], y - lidar[:, 1]
            along, across = cos * dx + sin * dy, cos * dy - sin * dx
            depth = along - np.sqrt(np.maximum(self.radius_m**2 - across**2, 0.0))
            struck = (np.abs(across) < self.radius_m) & (along > 0)
            nearest = np.where(struck, np.minimum(nearest, depth), nearest)
        for x0, y0, x1, y1 in self.walls:
            ex, ey, dx, dy = x1 - x0, y1 - y0, x0 - lidar[:, 0], y0 - lidar[:, 1]
            # A beam parallel to a wall meets it nowhere; its cross product is then exactly 0.
            cross = np.where(cos * ey - sin * ex == 0.0, np.nan, cos * ey - sin * ex)
            away, share = (dx * ey - dy * ex) / cross, (dx * sin - dy * cos) / cross
            struck = (away > 0) & (share >= 0) & (share <= 1)
            nearest = np.where(struck, np.minimum(nearest, away), nearest)
        return np.where(np.isfinite(nearest), nearest, np.nan)

    def scans(self, revolutions: int) -> Scans:
        """Clockwise revolutions as an RPLidar gives them, the first beam at a random angle."""
        generator = np.random.default_rng(self.seed)
        starts = np.arange(revolutions + 1) * self.beams
        t_ns = np.arange(revolutions) * PERIOD_NS
        steps = np.arange(self.beams)
        beam_t_ns = (t_ns[:, None] + steps * (PERIOD_NS // self.beams)).ravel()
        first = generator.uniform(-math.pi, math.pi, revolutions)
        turned = (first[:, None] - steps * (2 * math.pi / self.beams)).ravel()
        bearing_rad = (turned + math.pi) % (2 * math.pi) - math.pi
        lidar = compose(
            self.pose(np.asarray(beam_t_ns * 1e-9, np.float64)), np.array(self.mounting)
        )
        range_m = self.ranges(lidar, bearing_rad)
        range_m += self.range_sigma_m * generator.standard_normal(range_m.size)
        return Scans(t_ns, starts, beam_t_ns, range_m, bearing_rad, np.full(range_m.size, np.nan))

    def odometry(self, revolutions: int) -> Odometry:
        """Perfect odometry at 50 Hz that covers those revolutions."""
        t_ns = np.arange(-50, revolutions * PERIOD_NS // 20_000_000 + 50) * 20_000_000
        still = np.zeros(t_ns.size)
        return Odometry("test", t_ns, self.pose(np.asarray(t_ns * 1e-9, np.float64)), still, still)

    def seen_from_car(self, t_ns: int) -> Floats:
        """(k, 2): where the cones are in the frame of the car at that time."""
        x, y, heading = self.pose(np.array([t_ns * 1e-9]))[0]
        cos, sin = math.cos(heading), math.sin(heading)
        away = self.cones - (x, y)
        turned: Floats = away @ np.array([[cos, -sin], [sin, cos]])
        return turned
