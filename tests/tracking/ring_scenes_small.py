"""Small floors with cones and a car, for the tests of the tracker."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry import Camera, Floats, View, looking_at
from simulation import Blur, CarPlan, Frame, Light, OverheadScene, Ring
from tracking import Marker, RingTracker, TrackerConfig

CAMERA = Camera(640, 480, 800.0, 798.0, 318.0, 243.0, (-0.12, 0.03, 0.0006, -0.0004, 0.0))
CAR = CarPlan()
PERIOD_NS = 33_333_333
CONES = ((-1.0, -0.7), (-1.0, 0.7), (1.0, 0.7), (1.0, -0.7), (0.0, 0.75))


def small_view() -> View:
    """Straight down from 3.5 m, rings of 28 px."""
    return looking_at(CAMERA, np.array([0.0, 0.0, 3.5]), np.zeros(3), np.array([0.0, 1.0, 0.0]))


def small_oblique_view() -> View:
    """From the side, 40 degrees off the vertical."""
    up = np.array([0.0, 0.0, 1.0])
    return looking_at(CAMERA, np.array([0.0, -2.2, 2.6]), np.zeros(3), up)


def cone_rings(places: Sequence[tuple[float, float]] = CONES) -> list[Ring]:
    """Rings lying on the floor."""
    return [Ring((x, y, 0.0)) for x, y in places]


def cone_markers(places: Sequence[tuple[float, float]] = CONES) -> list[Marker]:
    """The same as the tracker is told of them."""
    return [Marker(f"cone {i}", 0.0, place) for i, place in enumerate(places)]


def car_markers() -> list[Marker]:
    """Front and rear."""
    return [Marker("front", CAR.height_m), Marker("rear", CAR.height_m)]


class Track:
    """A scene, its tracker and a clock: `see` renders a frame and gives it to the tracker."""

    def __init__(
        self,
        view: View,
        places: Sequence[tuple[float, float]] = CONES,
        *,
        car: bool = False,
        exposure_s: float = 0.0,
        config: TrackerConfig | None = None,
        seed: int = 0,
    ) -> None:
        self.view, self.rng, self.frame_number = view, np.random.default_rng(seed), 0
        self.scene = OverheadScene(view, cone_rings(places), blur=Blur(exposure_s=exposure_s))
        markers = [*cone_markers(places), *(car_markers() if car else [])]
        pair = ("front", "rear", CAR.front_x_m - CAR.rear_x_m) if car else None
        self.tracker = RingTracker(view, markers, config, pair)

    def picture(
        self,
        pose: Floats | None = None,
        velocity: tuple[float, float] = (0.0, 0.0),
        occluders: Sequence[tuple[Floats, float]] = (),
        light: Light | None = None,
    ) -> Frame:
        """A frame, with the car at a pose or without it."""
        return self.scene.frame(
            self.rng,
            moving=[] if pose is None else CAR.rings(pose, velocity),
            body=None if pose is None else CAR.outline(pose),
            occluders=occluders,
            light=light,
        )

    def t_ns(self) -> int:
        """Time of the next frame."""
        self.frame_number += 1
        return self.frame_number * PERIOD_NS


def sheet(centre: Floats, half: tuple[float, float]) -> Floats:
    """Corners (4, 2) of a rectangle in pixels."""
    return np.asarray(centre + np.array(half) * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]))
