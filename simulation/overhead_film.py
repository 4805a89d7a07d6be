"""The drive as the overhead camera films it: an emulated camera's scene, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Floats, RingShape, View, looking_at
from simulation.drive import Moment
from simulation.marker_patch import Ring
from simulation.overhead import Blur, OverheadScene
from simulation.tracks import SIDE_M
from simulation.views import HEIGHT_M, make_camera
from simulation.world import World, site_corners

EXPOSURE_S = 0.004
JPEG_QUALITY = 90
NOISE_GREY = 2.5
TAPE_SIGMA_M = 0.001
_NOISES, _SPARE = 2, 256


@dataclass(frozen=True)
class FilmClock:
    """The clock of the machine that films: its time = (world time) * (1 + skew) + zero_ns."""

    zero_ns: int
    skew: float

    def world_ns(self, t_ns: int) -> int:
        """World time at a time of this clock."""
        return round((t_ns - self.zero_ns) / (1.0 + self.skew))

    def own_ns(self, world_ns: int) -> int:
        """The time of this clock at a world time."""
        return self.zero_ns + round(world_ns * (1.0 + self.skew))


def hung_view(height_px: int = 1080) -> View:
    """Where the camera hangs: above the middle of the square, a little off and askew."""
    half = SIDE_M / 2.0
    position = np.array([half + 0.03, half - 0.04, HEIGHT_M])
    aim = np.array([half - 0.02, half + 0.01, 0.0])
    return looking_at(make_camera(height_px), position, aim, np.array([0.0, 1.0, 0.0]))


class FilmScene:
    """What the camera sees of a world: corner rings, rings on the cones, the car."""

    def __init__(self, world: World, view: View) -> None:
        self.world, self.view = world, view
        top = world.room.cone.top_m
        rings = [Ring((x, y, 0.0), RingShape()) for x, y in world.corners.tolist()]
        rings += [Ring((x, y, top), RingShape()) for x, y in world.cones.positions.tolist()]
        self._scene = OverheadScene(view, rings, blur=Blur(exposure_s=EXPOSURE_S))
        self._rng = world.rng("film")
        # Drawing two million normal numbers for each frame would take longer than all the rest:
        # two larger fields of noise are drawn once, and each frame takes another part of one.
        high, wide = view.camera.height_px, view.camera.width_px
        self._noises = [
            NOISE_GREY * self._rng.standard_normal((high + _SPARE, wide + _SPARE), np.float32)
            for _ in range(_NOISES)
        ]

    def image(self, world_ns: int) -> npt.NDArray[np.uint8]:
        """The picture whose exposure is half over at a world time."""
        here, plan = self.world.drive.at(world_ns), self.world.built.rings
        pose = np.array([here.x_m, here.y_m, here.heading_rad])
        rings = plan.rings(pose, _velocity(here), here.turn_rad_s)
        exact = self._scene.light_of(moving=rings, body=plan.outline(pose))
        down, right = (int(self._rng.integers(_SPARE)) for _ in range(2))
        high, wide = exact.shape
        exact += self._noises[int(self._rng.integers(_NOISES))][
            down : down + high, right : right + wide
        ]
        return np.asarray(np.clip(exact + 0.5, 0.0, 255.0), np.uint8)

    def jpeg(self, world_ns: int) -> bytes:
        """That picture as the camera sends it."""
        import cv2

        quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        good, data = cv2.imencode(".jpg", self.image(world_ns), quality)
        assert good
        return bytes(data)


def empty_floor(
    view: View, rng: np.random.Generator, count: int
) -> Iterator[npt.NDArray[np.uint8]]:
    """Pictures of the corner rings alone, as they are taken for calibrating the world."""
    corners = [Ring((x, y, 0.0), RingShape()) for x, y in site_corners().tolist()]
    scene = OverheadScene(view, corners, blur=Blur(exposure_s=EXPOSURE_S))
    for _ in range(count):
        yield scene.frame(rng, noise=NOISE_GREY).image


def _velocity(here: Moment) -> tuple[float, float]:
    cos, sin = float(np.cos(here.heading_rad)), float(np.sin(here.heading_rad))
    return (
        here.ahead_m_s * cos - here.aside_m_s * sin,
        here.ahead_m_s * sin + here.aside_m_s * cos,
    )


def measured_lengths(corners: Floats, rng: np.random.Generator) -> list[tuple[int, int, float]]:
    """What a person's tape says between all pairs of corners: to the millimetre."""
    pairs = [(a, b) for a in range(4) for b in range(a + 1, 4)]
    true = [float(np.linalg.norm(corners[a] - corners[b])) for a, b in pairs]
    told = [round(length + TAPE_SIGMA_M * float(rng.standard_normal()), 3) for length in true]
    return [(a, b, length) for (a, b), length in zip(pairs, told, strict=True)]
