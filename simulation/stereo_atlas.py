"""What floor and walls of the virtual room look like: one picture from which every eye samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from geometry import Floats
from simulation.light import Grey

ROOM_M = (-1.5, 5.5)
"""Least and greatest x and y inside the walls."""
WALL_HEIGHT_M = 2.0
TEXEL_M = 0.0025
LEVELS = 6
_SIDE_M = ROOM_M[1] - ROOM_M[0]
_SIDE = round(_SIDE_M / TEXEL_M)
_WALL_TEXEL_M = 0.01
_WALL = (round(WALL_HEIGHT_M / _WALL_TEXEL_M), round(_SIDE_M / _WALL_TEXEL_M))
# Size of the grain in metres, and how much it adds to the grey level.
_FLOOR_GRAIN = ((0.006, 9.0), (0.015, 12.0), (0.04, 12.0), (0.13, 9.0), (0.5, 8.0))
_WALL_GRAIN = ((0.06, 6.0), (0.2, 8.0), (0.7, 10.0))


@dataclass(frozen=True, eq=False)
class Atlas:
    """The floor at each level of detail, and below it the four walls in a row.

    picture : (h, w) grey levels. offset : (LEVELS, 2) texels, of each level of the floor.
    """

    picture: npt.NDArray[np.uint8]
    offset: Floats

    def wall(self, number: int) -> tuple[float, float]:
        """Texel (across, down) of the lower left corner of a wall, as seen from inside."""
        return float(number * _WALL[1]), float(_SIDE + _WALL[0])

    @property
    def wall_texels_per_m(self) -> float:
        """Of every wall."""
        return 1.0 / _WALL_TEXEL_M


@lru_cache(maxsize=2)
def room_atlas(seed: int) -> Atlas:
    """The atlas of a room; the same for the same seed."""
    import cv2

    rng = np.random.default_rng(seed)
    floor = _clipped(_floor(rng))
    picture = np.full((_SIDE + _WALL[0], _SIDE + _SIDE // 2), 128, np.uint8)
    offset = np.zeros((LEVELS, 2))
    offset[1:, 0] = _SIDE
    down = 0
    for level in range(LEVELS):
        side = _SIDE >> level
        across = int(offset[level, 0])
        offset[level, 1] = down
        picture[down : down + side, across : across + side] = floor
        down += side if level else 0
        floor = np.asarray(cv2.resize(floor, (side // 2, side // 2), interpolation=cv2.INTER_AREA))
    for number in range(4):
        here = slice(number * _WALL[1], (number + 1) * _WALL[1])
        picture[_SIDE:, here] = _clipped(_wall(rng))
    return Atlas(picture, offset)


def _clipped(grey: Grey) -> npt.NDArray[np.uint8]:
    return np.clip(np.rint(grey), 0.0, 255.0).astype(np.uint8)


def _grain(shape: tuple[int, int], texels: float, rng: np.random.Generator) -> Grey:
    """Noise of unit variance, smooth over so many texels."""
    import cv2

    small = [max(2, round(size / texels)) for size in shape]
    noise = rng.standard_normal(small, np.float32)
    grown = cv2.resize(noise, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
    return np.asarray(grown / grown.std(), np.float32)


def _floor(rng: np.random.Generator) -> Grey:
    """Grain of several sizes, and flecks with edges, as a hall's floor has them."""
    shape = (_SIDE, _SIDE)
    floor = np.full(shape, 112.0, np.float32)
    for size_m, strength in _FLOOR_GRAIN:
        floor += np.float32(strength) * _grain(shape, size_m / TEXEL_M, rng)
    for size_m, strength in ((0.012, 32.0), (0.03, -30.0), (0.12, 24.0)):
        floor[_grain(shape, size_m / TEXEL_M, rng) > 1.5] += np.float32(strength)
    return floor


def _wall(rng: np.random.Generator) -> Grey:
    """Grain, and rectangles as doors, posters and cupboards are; soft, as it is seen from afar."""
    import cv2

    wall = np.full(_WALL, 150.0, np.float32)
    for size_m, strength in _WALL_GRAIN:
        wall += np.float32(strength) * _grain(_WALL, size_m / _WALL_TEXEL_M, rng)
    for _ in range(45):
        size = rng.uniform(0.1, 0.8, 2) / _WALL_TEXEL_M
        low = rng.uniform(0.0, 1.0, 2) * np.array(_WALL) - size / 2.0
        first, last = (np.clip(np.rint(c), 0, _WALL).astype(int) for c in (low, low + size))
        wall[first[0] : last[0], first[1] : last[1]] += np.float32(rng.uniform(-70.0, 50.0))
    return np.asarray(cv2.GaussianBlur(wall, (0, 0), 1.2), np.float32)
