"""One ring marker as the camera's pixels collect its light.

Each subpixel's ray is cast through the exact inverse of the lens onto the marker's plane. A
subpixel on an edge takes the share of it that lies inside (distance from the edge over the
distance gradient), so that a few subpixels a side are as good as dozens.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geometry import Floats, RingShape, View, turned
from simulation.light import Grey

_PAD_PX = 4
_STEPS_PER_PX = 3.0
_OUTLINE = 48


@dataclass(frozen=True)
class Ring:
    """A ring marker in the world.

    xyz_m : its centre in the middle of the exposure. tilt_rad : small turn about world x and y;
    0, 0 lies flat. velocity_m_s : of its centre, in the plane, constant during the exposure.
    """

    xyz_m: tuple[float, float, float]
    shape: RingShape = field(default_factory=RingShape)
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    velocity_m_s: tuple[float, float] = (0.0, 0.0)

    @property
    def axes(self) -> Floats:
        """Two unit vectors in the marker's plane and its normal, as columns (3, 3)."""
        return turned(np.array([*self.tilt_rad, 0.0]))

    def at(self, offset_s: float) -> Floats:
        """The centre (3,) so long after the middle of the exposure."""
        return np.array(self.xyz_m) + offset_s * np.array([*self.velocity_m_s, 0.0])


@dataclass(frozen=True, eq=False)
class Patch:
    """Pixels that a marker covers: light (h, w) already multiplied by coverage, coverage (h, w)."""

    rows: slice
    columns: slice
    light: Grey
    coverage: Grey

    def onto(self, picture: Grey) -> None:
        """Lay the patch over the picture, in place."""
        part = picture[self.rows, self.columns]
        part *= 1.0 - self.coverage
        part += self.light


def render_ring(
    view: View,
    ring: Ring,
    paper: float,
    black: float,
    *,
    exposure_s: float = 0.0,
    psf_sigma_px: float = 0.7,
    supersample: int = 4,
) -> Patch | None:
    """The patch of one ring, or None when nothing of it falls into the image."""
    import cv2

    travel = _outlines(view, ring, exposure_s)
    if not np.isfinite(travel).all():
        return None
    low = np.floor(travel.min(axis=(0, 1))).astype(int) - _PAD_PX
    high = np.ceil(travel.max(axis=(0, 1))).astype(int) + _PAD_PX + 1
    width, height = view.camera.width_px, view.camera.height_px
    if (high <= 0).any() or low[0] >= width or low[1] >= height:
        return None
    rays = _rays(view, low, high, supersample)
    blurred_px = np.linalg.norm(travel[-1] - travel[0], axis=-1).max()
    moments = max(1, int(np.ceil(_STEPS_PER_PX * blurred_px)))
    offsets = exposure_s * ((np.arange(moments) + 0.5) / moments - 0.5)
    light = np.zeros(rays.shape[:2], np.float32)
    coverage = np.zeros(rays.shape[:2], np.float32)
    for offset_s in offsets:
        one_light, one_coverage = _cast(view, ring, float(offset_s), rays, paper, black)
        light += one_light / moments
        coverage += one_coverage / moments
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    sigma = psf_sigma_px * supersample
    soft = [cv2.GaussianBlur(one, (0, 0), sigma) if sigma else one for one in (light, coverage)]
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in soft]
    first, last = np.maximum(low, 0), np.minimum(high, (width, height))
    inside = slice(first[1] - low[1], last[1] - low[1]), slice(first[0] - low[0], last[0] - low[0])
    return Patch(
        slice(int(first[1]), int(last[1])),
        slice(int(first[0]), int(last[0])),
        np.asarray(small[0], np.float32)[inside],
        np.asarray(small[1], np.float32)[inside],
    )


def _outlines(view: View, ring: Ring, exposure_s: float) -> Floats:
    """Pixels (2, k, 2) along the edge of the paper as the exposure begins and ends."""
    angle = np.arange(_OUTLINE) * (2.0 * np.pi / _OUTLINE)
    reach = ring.shape.radius_m * ring.shape.margin
    spokes = reach * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ ring.axes[:, :2].T
    ends = [ring.at(sign * exposure_s / 2.0) + spokes for sign in (-1.0, 1.0)]
    return view.project(np.stack(ends))


def _rays(view: View, low: Floats, high: Floats, supersample: int) -> Floats:
    """Points on the plane z = 1 of every subpixel, (rows, columns, 2)."""
    grid = [
        a - 0.5 + (np.arange((b - a) * supersample) + 0.5) / supersample
        for a, b in zip(low, high, strict=True)
    ]
    return view.camera.undistorted(np.stack(np.meshgrid(*grid), axis=-1))


def _cast(
    view: View, ring: Ring, offset_s: float, rays: Floats, paper: float, black: float
) -> tuple[Grey, Grey]:
    """Light and coverage of every subpixel at one moment."""
    axes = view.rotation @ ring.axes
    centre = view.rotation @ ring.at(offset_s) + view.translation
    to_marker = np.linalg.inv(np.column_stack([axes[:, :2], centre]))
    local = rays @ to_marker[:, :2].T + to_marker[:, 2]
    radius = np.hypot(local[..., 0], local[..., 1]) / local[..., 2]
    down, across = np.gradient(radius)
    step = np.maximum(np.hypot(down, across), 1e-12)
    inner, outer = ring.shape.inner_diameter_m / 2.0, ring.shape.radius_m

    def share(edge_m: float) -> Floats:
        return np.asarray(np.clip(0.5 - (radius - edge_m) / step, 0.0, 1.0))

    coverage = share(outer * ring.shape.margin)
    light = paper * coverage - (paper - black) * (share(outer) - share(inner))
    return light.astype(np.float32), coverage.astype(np.float32)
