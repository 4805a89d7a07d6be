"""What decides which lidar echoes are a cone, and the two presets that ship."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from capture import with_overrides
from dialogue import UsageError, nearest_names
from slam.config import UNLIMITED, ObservationNoise

MANY_HITS = 100_000
CENTRES = ("centroid", "shifted", "fit")


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """`pose_base_lidar`: where the lidar sits on the car, and where its zero bearing points."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ConeConfig:
    """Everything that decides what cones a revolution shows.

    `hit` is the noise of a single echo, `floor` what is added to every detection for what its hits
    do not tell: tilt, a cone out of round, the odometry used in deskewing.
    """

    mounting: Mounting = field(default_factory=Mounting)
    cone_radius_m: float = field(default=0.05, metadata={"min": 1e-3})
    """At the height of the lidar's plane."""
    min_range_m: float = field(metadata={"min": 0.0})
    max_range_m: float = field(metadata={"min": 0.0})
    join_m: float = field(metadata={"min": 1e-3})
    """Echoes closer than this belong to one thing; a cone this close to a wall is part of it."""
    within_m: float = field(default=UNLIMITED, metadata={"min": 0.0})
    """No hit may lie further than this, or join_m and two radii, from the mean of its cluster."""
    min_hits: int = field(metadata={"min": 1})
    max_hits: int = field(default=MANY_HITS, metadata={"min": 1})
    hits_tolerance: float = field(default=UNLIMITED, metadata={"min": 0.0})
    """Hits may differ by this share, and one, from what cone, distance and beams foretell."""
    round_share: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0})
    """Share of the hits that must lie on the fitted circle (three standard deviations)."""
    centre: str = field(metadata={"choices": CENTRES})
    """centroid of the hits; that, shifted back by radius * pi/4; or fit of the known circle."""
    see_walls: bool = False
    """Keep echoes beyond max_range_m while clustering, and refuse what stands half hidden."""
    hit: ObservationNoise = field(
        default=ObservationNoise(
            range_sigma_m=0.008, bearing_sigma_rad=math.radians(0.1), range_sigma_per_m=0.005
        )
    )
    floor: ObservationNoise = field(
        default=ObservationNoise(range_sigma_m=0.01, bearing_sigma_rad=math.radians(0.3))
    )


CONE_PRESETS = {
    # Thesis section 3.2.4: points of 0.3-2.0 m, clusters of 4-10 within 0.3 m, their mean; read as
    # Euclidean clustering, so that a wall is one large cluster and not a row of small ones.
    "thesis": ConeConfig(
        min_range_m=0.3,
        max_range_m=2.0,
        join_m=0.3,
        within_m=0.3,
        min_hits=4,
        max_hits=10,
        centre="centroid",
    ),
    # A cone is what has the hits and the roundness of a cone of that radius at that distance: no
    # blind zone near the car, and centres on the axis.
    "robust": ConeConfig(
        min_range_m=0.2,
        max_range_m=3.0,
        join_m=0.1,
        min_hits=3,
        hits_tolerance=0.3,
        round_share=0.7,
        centre="fit",
        see_walls=True,
    ),
}


def cone_config(preset: str, overrides: Sequence[str] = ()) -> ConeConfig:
    """The preset with `key=value` settings on top; raises `UsageError` for names or values."""
    if preset not in CONE_PRESETS:
        raise UsageError(f"no cone preset {preset!r}; {nearest_names(preset, CONE_PRESETS)}")
    config = with_overrides(CONE_PRESETS[preset], overrides)
    for low, high in (("min_range_m", "max_range_m"), ("min_hits", "max_hits")):
        if getattr(config, low) > getattr(config, high):
            raise UsageError(
                f"{low} {getattr(config, low)} is above {high} {getattr(config, high)}: no cone "
                "could be found; lower the one or raise the other"
            )
    return config
