"""A virtual track: what the instruments would have seen, and the exact truth behind it.

`world` makes everything of one seed: cones, a car that slides (`car`, `driver`, `drive`), what its
sensors feel (`sensors`), what the camera above and the ZED see (`overhead`, `stereo`). `recordings`
and `real_time` put the real drivers and the real recorder before it. Only `trackside/`, tests and
benchmarks import this room.
"""

from simulation.light import Glare, Light, even_light, shadowed_light
from simulation.overhead import Blur, CarPlan, Frame, OverheadScene, Ring
from simulation.stereo import (
    ZED_MOUNTING,
    StereoScene,
    factory_text,
    write_factory_file,
    zed_calibration,
    zed_pair,
)
from simulation.surroundings import Levels, cluttered_floor, plain_floor
from simulation.views import oblique_view, straight_down_view

__all__ = [
    "ZED_MOUNTING",
    "Blur",
    "CarPlan",
    "Frame",
    "Glare",
    "Levels",
    "Light",
    "OverheadScene",
    "Ring",
    "StereoScene",
    "cluttered_floor",
    "even_light",
    "factory_text",
    "oblique_view",
    "plain_floor",
    "shadowed_light",
    "straight_down_view",
    "write_factory_file",
    "zed_calibration",
    "zed_pair",
]
