"""A virtual track: what the instruments would have seen, and the exact truth behind it.

`simulation.overhead` renders the floor as the camera above sees it. Tests and benchmarks measure
the rooms that look at pictures against it; nothing that runs on site imports this room except the
demo.
"""

from simulation.light import Glare, Light, even_light, shadowed_light
from simulation.overhead import Blur, CarPlan, Frame, OverheadScene, Ring
from simulation.surroundings import Levels, cluttered_floor, plain_floor
from simulation.views import oblique_view, straight_down_view

__all__ = [
    "Blur",
    "CarPlan",
    "Frame",
    "Glare",
    "Levels",
    "Light",
    "OverheadScene",
    "Ring",
    "cluttered_floor",
    "even_light",
    "oblique_view",
    "plain_floor",
    "shadowed_light",
    "straight_down_view",
]
