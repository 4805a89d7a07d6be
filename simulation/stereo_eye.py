"""One eye of a camera on a car, in a room: where each of its pixels looks.

The car stays on the floor, so what a pixel sees of the floor is fixed in the frame of the car, its
level of detail as well; only the walls have to be found anew at each pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import Camera, Floats
from simulation.stereo_atlas import LEVELS, ROOM_M, TEXEL_M, Atlas

_NEVER_A_WALL_M = 1.2
"""Floor nearer than this is not behind a wall: the track keeps off them by more."""
_SHARPER = 0.3
"""Levels of detail above the mean footprint of a pixel, against the flicker of what is finer."""

Single = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Placed:
    """A camera in base_link: rotation (3, 3) from its axes, position (3,)."""

    camera: Camera
    rotation: Floats
    position: Floats

    def project(self, points_base: Floats) -> Floats:
        """Pixels (..., 2) of points (..., 3); NaN behind the camera."""
        return self.camera.project((points_base - self.position) @ self.rotation)


class Eye:
    """Renders floor and walls as one camera sees them."""

    def __init__(self, placed: Placed, atlas: Atlas) -> None:
        self._atlas = atlas
        self._position = placed.position
        camera = placed.camera
        grid = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
        plane = camera.undistorted(np.stack(grid, axis=-1).astype(np.float64))
        rays = plane @ placed.rotation[:, :2].T + placed.rotation[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = np.where(rays[..., 2] < -1e-6, -placed.position[2] / rays[..., 2], np.inf)
        reach = along * np.hypot(rays[..., 0], rays[..., 1])
        # One cut through the rows: above it a wall may be seen, below only the floor.
        self._cut = int(np.flatnonzero((reach > _NEVER_A_WALL_M).any(axis=1)).max(initial=-1)) + 1
        self._rays = _apart(rays[: self._cut])
        self._along = along[: self._cut].astype(np.float32)
        near = np.minimum(along, 30.0)[..., None]
        floor = placed.position[:2] + near * rays[..., :2]
        self._floor = _apart(floor)
        self._levels(near, floor)

    def _levels(self, near: Floats, floor: Floats) -> None:
        """Of every pixel the two levels of detail between which it lies, and how much of each."""
        down, across = (np.gradient(floor, axis=axis) for axis in (0, 1))
        area = np.abs(down[..., 0] * across[..., 1] - down[..., 1] * across[..., 0])
        level = np.log2(np.sqrt(np.maximum(area, 1e-12)) / TEXEL_M) + _SHARPER
        level = np.clip(np.where(near[..., 0] < 30.0, level, LEVELS - 1), 0.0, LEVELS - 1.001)
        fine = level.astype(int)
        self._share = (level - fine).astype(np.float32)
        self._rest = np.float32(1.0) - self._share
        offset = self._atlas.offset.astype(np.float32)
        self._scales = [(1.0 / (TEXEL_M * 2.0 ** (fine + k))).astype(np.float32) for k in (0, 1)]
        self._offsets = [_apart(offset[fine + k] - np.float32(0.5)) for k in (0, 1)]

    def render(self, pose: Floats) -> npt.NDArray[np.uint8]:
        """The room from a pose (x, y, heading) of the car."""
        import cv2

        x, y, heading = (float(value) for value in pose)
        cos, sin = np.cos(heading), np.sin(heading)
        # In one pass each: this is most of what a frame costs.
        world_x = cv2.addWeighted(self._floor[0], cos, self._floor[1], -sin, x - ROOM_M[0])
        world_y = cv2.addWeighted(self._floor[0], sin, self._floor[1], cos, y - ROOM_M[0])
        is_wall, wall_u, wall_v = self._walls(x, y, heading)
        seen = []
        for scale, offset in zip(self._scales, self._offsets, strict=True):
            u, v = (
                np.asarray(cv2.add(cv2.multiply(world, scale), part), np.float32)
                for world, part in ((world_x, offset[0]), (world_y, offset[1]))
            )
            np.copyto(u[: self._cut], wall_u, where=is_wall)
            np.copyto(v[: self._cut], wall_v, where=is_wall)
            seen.append(cv2.remap(self._atlas.picture, u, v, cv2.INTER_LINEAR))
        return np.asarray(cv2.blendLinear(seen[0], seen[1], self._rest, self._share), np.uint8)

    def _walls(
        self, x: float, y: float, heading: float
    ) -> tuple[npt.NDArray[np.bool_], Single, Single]:
        """Which pixels above the cut see a wall, and where in the atlas."""
        import cv2

        cos, sin = np.cos(heading), np.sin(heading)
        across_x = np.asarray(cv2.addWeighted(self._rays[0], cos, self._rays[1], -sin, 0.0))
        across_y = np.asarray(cv2.addWeighted(self._rays[0], sin, self._rays[1], cos, 0.0))
        ahead, left, up = (float(value) for value in self._position)
        at_x, at_y = x + cos * ahead - sin * left, y + sin * ahead + cos * left
        low, high = ROOM_M
        right, back = across_x > 0.0, across_y > 0.0
        with np.errstate(divide="ignore"):
            to_x = np.where(right, np.float32(high - at_x), np.float32(low - at_x)) / across_x
            to_y = np.where(back, np.float32(high - at_y), np.float32(low - at_y)) / across_y
        along = np.minimum(to_x, to_y)
        by_x = to_x < to_y
        texels = self._atlas.wall_texels_per_m
        width, bottom = self._atlas.wall(1)
        # Walls 0 and 1 end the room along x, 2 and 3 along y.
        start_x = right * np.float32(width) + np.float32((at_y - low) * texels)
        start_y = back * np.float32(width) + np.float32((at_x - low) * texels + 2.0 * width)
        aside = np.where(by_x, across_y, across_x)
        u = np.where(by_x, start_x, start_y) + along * aside * np.float32(texels)
        height = along * self._rays[2]
        height *= np.float32(texels)
        height += np.float32(up * texels)
        v = np.float32(bottom - 1.0) - np.clip(height, 0.0, 198.0, out=height)
        return along < self._along, u, v


def _apart(columns: Floats) -> tuple[Single, ...]:
    """Each of the last axis as an array of its own, which is read much faster."""
    return tuple(
        np.ascontiguousarray(columns[..., axis], np.float32) for axis in range(columns.shape[-1])
    )
