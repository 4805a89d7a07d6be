"""Scenes for `benchmarks/rings.py`: cones with rings, a car that drives, light and clutter."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from geometry import Floats, View
from simulation import (
    Blur,
    CarPlan,
    Frame,
    Light,
    OverheadScene,
    Ring,
    cluttered_floor,
    shadowed_light,
)
from tracking import Marker, RingTracker

FPS = 30.0
EXPOSURE_S = 0.005
PLACE_SIGMA_M = 0.003
"""How well the tracker is told where the cones stand."""
CAR = CarPlan()


def image_shape(view: View) -> tuple[int, int]:
    """Rows and columns."""
    return view.camera.height_px, view.camera.width_px


def cones(view: View, count: int, rng: np.random.Generator, lane_m: tuple[float, float]) -> Floats:
    """Places (count, 2), rings wholly in view, 0.2 m apart, none in the car's lane (radii)."""
    places: list[Floats] = []
    size = np.array(image_shape(view)[::-1])
    while len(places) < count:
        place = rng.uniform(-2.2, 2.2, 2)
        pixel = view.project(np.array([*place, 0.0]))
        radius = float(np.hypot(*place))
        inside = bool((pixel > 40).all() and (pixel < size - 40).all())
        clear = not lane_m[0] - 0.3 < radius < lane_m[1] + 0.45
        apart = all(np.hypot(*(place - other)) > 0.2 for other in places)
        if inside and clear and apart:
            places.append(place)
    return np.array(places)


@dataclass(frozen=True)
class Drive:
    """A car on a circle round the middle of the world that speeds up to `top_m_s`."""

    radius_m: float = 0.8
    start_m_s: float = 0.8
    top_m_s: float = 0.8
    along_m_s2: float = 0.0

    def at(self, t_s: float) -> tuple[Floats, tuple[float, float], float]:
        """Pose (3,), velocity and turn rate."""
        ramp_s = (self.top_m_s - self.start_m_s) / self.along_m_s2 if self.along_m_s2 else 0.0
        ramp = min(t_s, ramp_s)
        way = self.start_m_s * ramp + self.along_m_s2 * ramp**2 / 2.0
        way += self.top_m_s * (t_s - ramp)
        speed = self.start_m_s + self.along_m_s2 * ramp
        angle = 0.5 + way / self.radius_m
        heading = angle + np.pi / 2.0
        pose = np.array([self.radius_m * np.cos(angle), self.radius_m * np.sin(angle), heading])
        velocity = (speed * float(np.cos(heading)), speed * float(np.sin(heading)))
        return pose, velocity, speed / self.radius_m


@dataclass(frozen=True, eq=False)
class Run:
    """A scene with `count` rings, two of them on a car, and the tracker that is to follow them."""

    scene: OverheadScene
    light: Light | None
    drive: Drive
    markers: tuple[Marker, ...]
    view: View
    rng: np.random.Generator

    def tracker(self) -> RingTracker:
        """A fresh one that knows the view, the cones' places to 3 mm, and where the car points."""
        pair = ("front", "rear", CAR.front_x_m - CAR.rear_x_m)
        tracker = RingTracker(self.view, self.markers, pair=pair)
        tracker.expect_heading(float(self.drive.at(0.0)[0][2]))
        return tracker

    def frames(self, count: int) -> Iterator[tuple[int, float, Frame]]:
        """Time [ns], heading of the car, picture."""
        for k in range(count):
            t_s = k / FPS
            pose, velocity, turn = self.drive.at(t_s)
            frame = self.scene.frame(
                self.rng, moving=CAR.rings(pose, velocity, turn), body=CAR.outline(pose),
                light=self.light,
            )  # fmt: skip
            yield round(1e9 * t_s), float(pose[2]), frame


def make_run(
    view: View, count: int, seed: int, *, shadows: bool = False, drive: Drive = Drive()
) -> Run:
    """A run of its own for every seed."""
    rng = np.random.default_rng(seed)
    places = cones(view, count - 2, rng, (drive.radius_m, drive.radius_m))
    light = shadowed_light(image_shape(view), rng) if shadows else None
    rings = [Ring((x, y, 0.0)) for x, y in places.tolist()]
    told = places + rng.normal(0.0, PLACE_SIGMA_M, places.shape)
    markers = [Marker(f"cone {i}", 0.0, (x, y)) for i, (x, y) in enumerate(told.tolist())]
    movers = [Marker("front", CAR.height_m), Marker("rear", CAR.height_m)]
    scene = OverheadScene(view, rings, blur=Blur(exposure_s=EXPOSURE_S))
    return Run(scene, light, drive, (*markers, *movers), view, rng)


def still_picture(
    view: View, count: int, seed: int, *, shadows: bool = False, clutter: bool = False
) -> Frame:
    """One picture with `count` rings lying on the floor, anywhere in view."""
    rng = np.random.default_rng(seed)
    floor = cluttered_floor(image_shape(view), rng) if clutter else None
    light = shadowed_light(image_shape(view), rng) if shadows else None
    places = cones(view, count, rng, (-9.0, -9.0)) if count else np.zeros((0, 2))
    rings = [Ring((x, y, 0.0)) for x, y in places.tolist()]
    return OverheadScene(view, rings, floor=floor).frame(rng, light=light)
