"""How many beams strike a cone at a distance, and so where a lidar can see it at all.

Thesis appendix A, with the exact geometry: from distance d a cone of radius r fills the angle
W = 2 asin(r / d) (its Eq. A.1 has the tangent); beams D apart strike it floor(W / D) times or once
more, the latter with probability frac(W / D). All angles in radians, all lengths in metres from
the lidar to the cone's axis. Where no distance fulfils a limit outside the cone, it is the radius.
"""

from __future__ import annotations

import math

from dialogue import Cell, Table
from slam.cones.config import MANY_HITS, ConeConfig


def subtense_rad(distance_m: float, radius_m: float) -> float:
    """The angle a cone fills; pi from its surface inwards."""
    return math.pi if distance_m <= radius_m else 2.0 * math.asin(radius_m / distance_m)


def d_certain(hits: int, radius_m: float, spacing_rad: float) -> float:
    """Up to this distance every revolution gives `hits` hits or more."""
    return _distance_filling(hits * spacing_rad, radius_m)


def d_possible(hits: int, radius_m: float, spacing_rad: float) -> float:
    """Beyond this distance no revolution gives `hits` hits; infinite for a single hit."""
    return _distance_filling((hits - 1) * spacing_rad, radius_m)


def near_certain(hits: int, radius_m: float, spacing_rad: float) -> float:
    """From this distance on every revolution gives `hits` hits or fewer."""
    return _distance_filling(hits * spacing_rad, radius_m)


def near_possible(hits: int, radius_m: float, spacing_rad: float) -> float:
    """Below this distance every revolution gives more than `hits` hits: the blind zone."""
    return _distance_filling((hits + 1) * spacing_rad, radius_m)


def detection_probability(
    distance_m: float, radius_m: float, spacing_rad: float, min_hits: int, max_hits: int = MANY_HITS
) -> float:
    """Probability that a revolution strikes the cone `min_hits` to `max_hits` times."""
    beams = subtense_rad(distance_m, radius_m) / spacing_rad
    fewer = math.floor(beams)
    more = beams - fewer
    return (1.0 - more) * (min_hits <= fewer <= max_hits) + more * (
        min_hits <= fewer + 1 <= max_hits
    )


def explain_range(config: ConeConfig, spacing_rad: float, step_m: float = 0.1) -> Table:
    """Distance -> hits and probability of detection, and where that is certain and impossible."""
    radius, low, high = config.cone_radius_m, config.min_hits, config.max_hits
    certain = (
        max(near_certain(high, radius, spacing_rad), config.min_range_m),
        min(d_certain(low, radius, spacing_rad), config.max_range_m),
    )
    possible = (
        max(near_possible(high, radius, spacing_rad), config.min_range_m),
        min(d_possible(low, radius, spacing_rad), config.max_range_m),
    )
    steps = range(max(1, math.floor(possible[0] / step_m)), math.ceil(possible[1] / step_m) + 1)
    where = (
        f"certain from {certain[0]:.3f} to {certain[1]:.3f} m"
        if certain[0] <= certain[1]
        else "certain nowhere"
    )
    upto = f"{low}-{high}" if high < MANY_HITS else f"{low} or more"
    return Table(
        ("distance [m]", "angle [deg]", "hits", "detected"),
        tuple(_row(config, spacing_rad, round(i * step_m, 9)) for i in steps),
        f"a cone of radius {radius:g} m, beams {math.degrees(spacing_rad):.3g} deg apart, "
        f"{upto} hits",
        f"{where}, nil below {possible[0]:.3f} m and beyond {possible[1]:.3f} m",
    )


def _row(config: ConeConfig, spacing_rad: float, distance_m: float) -> tuple[Cell, ...]:
    angle = subtense_rad(distance_m, config.cone_radius_m)
    fewer = math.floor(angle / spacing_rad)
    probability = detection_probability(
        distance_m, config.cone_radius_m, spacing_rad, config.min_hits, config.max_hits
    )
    inside = config.min_range_m <= distance_m <= config.max_range_m
    return (
        distance_m,
        math.degrees(angle),
        f"{fewer}-{fewer + 1}",
        probability if inside else 0.0,
    )


def _distance_filling(angle_rad: float, radius_m: float) -> float:
    """The distance at which a cone fills just this angle."""
    if angle_rad <= 0.0:
        return math.inf
    return radius_m if angle_rad >= math.pi else radius_m / math.sin(angle_rad / 2.0)
