"""Circles on a plane as a camera sees them, and where their centre really is.

A circle's image is an ellipse only without distortion, and even then the centre of the ellipse is
not the image of the circle's centre: for a ring of 12 cm seen obliquely the two are up to 0.2 px
apart (reference/ring_markers.md, section 7, pitfall 2). Here the one is computed from the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.angles import Floats
from geometry.camera import View, at_height
from geometry.errors import CameraError

_POINTS = 64
_MAX_STEPS = 30
_PRECISION_PX = 1e-9


@dataclass(frozen=True)
class RingShape:
    """A ring marker: black ring on white, white inside. Diameters in metres.

    margin : outer radius of the white around, in radii of the ring. Raises `CameraError` when the
    diameters are swapped or no lengths.
    """

    diameter_m: float = 0.122
    inner_diameter_m: float = 0.050
    margin: float = 1.35

    def __post_init__(self) -> None:
        if not 0.0 < self.inner_diameter_m < self.diameter_m:
            raise CameraError(
                f"a ring's inner diameter must be positive and below its outer one, got inner "
                f"{self.inner_diameter_m} m and outer {self.diameter_m} m: are they swapped?"
            )
        if not self.margin >= 1.0:
            raise CameraError(f"the margin is counted in radii, at least 1, got {self.margin}")

    @property
    def radius_m(self) -> float:
        """Of the ring's outer edge."""
        return self.diameter_m / 2.0

    @property
    def ratio(self) -> float:
        """Inner diameter over outer."""
        return self.inner_diameter_m / self.diameter_m


def circle_outline(
    view: View, xy: Floats, height_m: float | Floats, radius_m: float, points: int = _POINTS
) -> Floats:
    """Pixels (..., points, 2) along the images of circles round (..., 2), flat at these heights."""
    angle = np.arange(points) * (2.0 * np.pi / points)
    spokes = radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    height = np.asarray(height_m)[..., None]
    return view.project(at_height(xy[..., None, :] + spokes, height))


def apparent_centre(view: View, xy: Floats, height_m: float | Floats, radius_m: float) -> Floats:
    """Pixels (..., 2) of the centroids of the areas that circles round (..., 2) cover in the image.

    What fits of ellipses and blobs find. Exact to rounding: the integral runs over a smooth
    closed curve (Green's theorem), where equally spaced points converge geometrically.
    """
    outline = circle_outline(view, xy, height_m, radius_m)
    origin = outline.mean(axis=-2, keepdims=True)
    p = outline - origin
    # Derivatives of the trigonometric polynomial through the points, not of the polygon.
    order = np.fft.rfftfreq(p.shape[-2], 1.0 / p.shape[-2])
    order[-1] = 0.0
    d = np.fft.irfft(1j * order[:, None] * np.fft.rfft(p, axis=-2), n=p.shape[-2], axis=-2)
    swept = p[..., 0] * d[..., 1] - p[..., 1] * d[..., 0]
    area = swept.sum(axis=-1) / 2.0
    moment = (p * swept[..., None]).sum(axis=-2) / 3.0
    return np.asarray(origin[..., 0, :] + moment / area[..., None])


def circle_centres(view: View, pixels: Floats, height_m: float | Floats, radius_m: float) -> Floats:
    """World x, y (..., 2) of the centres of circles whose images have these centroids (..., 2).

    The bias of the ellipse's centre, perspective and distortion together, removed exactly. NaN
    where a ray does not meet the plane.
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    aim = pixels
    xy = view.on_plane(aim, height_m)
    for _ in range(_MAX_STEPS):
        miss = pixels - apparent_centre(view, xy, height_m, radius_m)
        aim = aim + miss
        xy = view.on_plane(aim, height_m)
        if not np.nanmax(np.abs(miss), initial=0.0) > _PRECISION_PX:
            break
    return xy
