"""What carries rings on the track: the cones and the car."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from capture import read_configuration


@dataclass(frozen=True, kw_only=True)
class CarRings:
    """Two rings on the car, seen from `base_link`, the middle of the rear axle; metres.

    front_x_m, rear_x_m : how far ahead of it; side_m : how far to its left both are; yaw_rad : by
    how much the line through them, from rear to front, is turned to the left about their middle;
    height_m : of their plane above the floor; sigmas : how well height and distances were measured.
    """

    front_x_m: float = 0.25
    rear_x_m: float = 0.05
    side_m: float = 0.0
    yaw_rad: float = field(default=0.0, metadata={"min": -0.5, "max": 0.5})
    height_m: float = field(default=0.2, metadata={"min": 0.0, "max": 1.0})
    height_sigma_m: float = field(default=0.002, metadata={"min": 0.0})
    lever_sigma_m: float = field(default=0.001, metadata={"min": 0.0})

    def __post_init__(self) -> None:
        if self.front_x_m - self.rear_x_m < 0.05:
            raise ValueError(
                f"the front ring must be ahead of the rear one by 0.05 m at least, got front_x_m "
                f"{self.front_x_m} and rear_x_m {self.rear_x_m}"
            )

    @property
    def pose_line_base(self) -> tuple[float, float, float]:
        """`base_link` as seen from a base_link that lies straight behind both rings."""
        middle = (self.front_x_m + self.rear_x_m) / 2.0
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (
            middle - cos * middle - sin * self.side_m,
            sin * middle - cos * self.side_m,
            -self.yaw_rad,
        )

    @property
    def span_m(self) -> float:
        """From ring to ring."""
        return self.front_x_m - self.rear_x_m


@dataclass(frozen=True, kw_only=True)
class ConeRings:
    """Rings where cones stand or will stand.

    places : id -> x, y in the world, to a quarter of a metre; without it every ring that is no
    corner and not on the car is a cone, numbered along x. height_m : of the rings.
    """

    height_m: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0})
    height_sigma_m: float = field(default=0.001, metadata={"min": 0.0})
    places: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, place in self.places.items():
            if not name.isdigit() or len(place) != 2:
                raise ValueError(
                    f"places are numbers with x, y, like 7: [1.0, 0.5]; got {name}: {list(place)}"
                )


@dataclass(frozen=True, kw_only=True)
class Scene:
    """The content of `scene.yaml`.

    settle_s : time at the start in which the cones' rings are measured; max_bridge_s : longest gap
    that is bridged; start_heading_deg : of the car, to a sixth of a turn; without it the car is
    taken to drive forwards.
    """

    format: int = 1
    car: CarRings = CarRings()
    cones: ConeRings = ConeRings()
    settle_s: float = field(default=3.0, metadata={"min": 0.1})
    max_bridge_s: float = field(default=0.5, metadata={"min": 0.0, "max": 5.0})
    start_heading_deg: float | None = None


def read_scene(file: Path) -> Scene:
    """The scene of a file; raises `ConfigurationError` with every fault and its place."""
    return read_configuration(Scene, file)
