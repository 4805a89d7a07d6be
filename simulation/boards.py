"""Calibration boards as a camera sees them: a printed sheet, and how a person holds it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from geometry import Camera, Floats, View, at_height, turned
from simulation.surroundings import plain_floor

_MOST_TILT_RAD = 0.5
_MARGIN_PX = 12.0
_TRIES = 200
_BAND_ROWS = 128


def held_boards(
    camera: Camera, size_m: tuple[float, float], count: int, rng: np.random.Generator
) -> list[View]:
    """Views of a board (width, height) that lies at x, y >= 0 of its own plane z = 0.

    Every place of the picture gets its turn; tilts reach 29 degrees; the board is always wholly in
    the picture and covers a third to two thirds of its height.
    """
    picture = np.array([camera.width_px, camera.height_px])
    views: list[View] = []
    for k in range(count):
        # A grid of places, visited in turn, or the corners would be left to chance.
        aim = (np.array([(k % 3) / 2.0, (k // 3 % 3) / 2.0]) - 0.5) * 0.5 + 0.5
        for _ in range(_TRIES):
            view = _held(camera, size_m, aim * picture, rng)
            corners = at_height(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size_m, 0.0)
            seen = view.project(corners)
            inside = (seen > _MARGIN_PX) & (seen < picture - 1 - _MARGIN_PX)
            if inside.all():
                views.append(view)
                break
            aim = 0.5 + 0.97 * (aim - 0.5)
    return views


def render_sheet(
    view: View,
    sheet: npt.NDArray[np.uint8],
    metres_per_texel: float,
    rng: np.random.Generator,
    *,
    light: tuple[float, float] = (45.0, 170.0),
    noise: float = 2.5,
    psf_sigma_px: float = 0.7,
    supersample: int = 3,
) -> npt.NDArray[np.uint8]:
    """The picture of a printed sheet on z = 0, its first texel at the origin, x along its rows.

    light : grey levels of its black and white.
    """
    import cv2

    camera = view.camera
    floor = plain_floor((camera.height_px, camera.width_px), rng)
    bright = light[0] + sheet.astype(np.float32) * ((light[1] - light[0]) / 255.0)
    texels = (_places(view) / metres_per_texel - 0.5).astype(np.float32)
    picture = np.empty_like(floor)
    for first in range(0, camera.height_px, _BAND_ROWS):
        # A row more on each side, for the map is interpolated between pixels.
        rows = slice(max(first - 1, 0), min(first + _BAND_ROWS + 1, camera.height_px))
        size = (camera.width_px, rows.stop - rows.start)
        fine = (supersample * size[0], supersample * size[1])
        at = np.asarray(cv2.resize(texels[rows], fine, interpolation=cv2.INTER_LINEAR))
        nothing = np.zeros(0, np.float32)
        seen = cv2.remap(bright, at, nothing, cv2.INTER_LINEAR, borderValue=-1e4)
        part = np.asarray(cv2.resize(seen, size, interpolation=cv2.INTER_AREA), np.float32)
        inner = slice(first - rows.start, first - rows.start + _BAND_ROWS)
        band = slice(first, min(first + _BAND_ROWS, camera.height_px))
        picture[band] = np.where(part[inner] < 0.0, floor[band], part[inner])
    soft = np.asarray(cv2.GaussianBlur(picture, (0, 0), psf_sigma_px), np.float32)
    soft += np.float32(noise) * rng.standard_normal(soft.shape, np.float32)
    return np.clip(np.rint(soft), 0.0, 255.0).astype(np.uint8)


def _held(
    camera: Camera, size_m: tuple[float, float], aim_px: Floats, rng: np.random.Generator
) -> View:
    """A board with its middle at a place of the picture, tilted and turned at random."""
    share = rng.uniform(0.35, 0.65)
    distance = camera.fy * size_m[1] / (share * camera.height_px)
    tilt = rng.uniform(0.15, _MOST_TILT_RAD)
    about = rng.uniform(0.0, 2.0 * np.pi)
    spin = rng.normal(0.0, 0.3)
    rotation = turned(tilt * np.array([np.cos(about), np.sin(about), 0.0]))
    rotation = rotation @ turned(np.array([0.0, 0.0, spin]))
    ray = np.array([*camera.undistorted(aim_px), 1.0])
    middle = np.array([*size_m, 0.0]) / 2.0
    return View(camera, rotation, distance * ray - rotation @ middle)


def _places(view: View) -> Floats:
    """Where the ray of each pixel meets z = 0, (rows, columns, 2) metres; far off if nowhere."""
    directions = _rays(view.camera) @ view.rotation[:2] + view.rotation[2]
    position = view.position
    with np.errstate(divide="ignore", invalid="ignore"):
        along = -position[2] / directions[..., 2:]
        places = position[:2] + along * directions[..., :2]
    return np.clip(np.where(along > 0.0, np.nan_to_num(places, nan=-1e3), -1e3), -1e3, 1e3)


@lru_cache(maxsize=1)
def _rays(camera: Camera) -> Floats:
    """Points (rows, columns, 2) on the plane z = 1 of every pixel."""
    grid = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    return camera.undistorted(np.stack(grid, axis=-1).astype(np.float64))
