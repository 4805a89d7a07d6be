"""A virtual track: what the instruments would have seen, and the exact truth behind it.

`simulation.overhead` renders the floor as the camera above sees it, `simulation.stereo` the track
as the ZED on the car does. Tests and benchmarks measure the rooms that look at pictures against it;
nothing that runs on site imports this room except the demo.
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
