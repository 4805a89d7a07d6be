"""The exact images of known rings: where their edges must be for a given place on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats, View, at_height
from tracking.profiles import spokes


@dataclass(frozen=True, eq=False)
class RingPlanes:
    """Heights (n,) and outer radii (n,) of n rings, and their one ratio of diameters."""

    heights: Floats
    radii: Floats
    ratio: float

    def take(self, which: Floats | np.ndarray) -> RingPlanes:
        """Some of them."""
        return RingPlanes(self.heights[which], self.radii[which], self.ratio)


@dataclass(frozen=True, eq=False)
class RingTemplates:
    """n rings, ready to be put anywhere near where they were prepared.

    spread : (n, 2 K + 1, 3) metres, in the camera's frame, from each ring's foot on the floor to
    its edge points (outer and inner by turns) and its centre. slopes : (n, 2, 2) d pixel / d world
    x, y, inverse its inverse; axes_px : (n, 2) longer and shorter half axis, all where prepared.
    """

    spread: Floats
    slopes: Floats
    inverse: Floats
    axes_px: Floats

    def placed(self, view: View, xy: Floats) -> tuple[Floats, Floats]:
        """Edges (n, K, 2, 2) and centres (n, 2) in pixels of the rings round (n, 2).

        Exact through perspective and lens. Only which points of the edges are meant comes from
        where the template was prepared, and a degree of that does no harm.
        """
        feet = xy @ view.rotation[:, :2].T + view.translation
        pixels = view.camera.project(self.spread + feet[:, None, :])
        return pixels[:, :-1].reshape(len(xy), -1, 2, 2), pixels[:, -1]


def ring_templates(view: View, xy: Floats, planes: RingPlanes, lines: int) -> RingTemplates:
    """Templates of rings (n,) prepared round (n, 2)."""
    slopes = view.plane_jacobian(xy, planes.heights)
    scaled = spokes(slopes, lines)[:, :, None, :] * np.array([1.0, planes.ratio])[:, None]
    flat = scaled.reshape(len(xy), 2 * lines, 2) * planes.radii[:, None, None]
    with_centre = np.concatenate([flat, np.zeros((len(xy), 1, 2))], axis=1)
    spread = at_height(with_centre, planes.heights[:, None]) @ view.rotation.T
    return RingTemplates(spread, slopes, inverse(slopes), half_axes(slopes, planes.radii))


def half_axes(slopes: Floats, radii: Floats) -> Floats:
    """Longer and shorter half axis (n, 2) in pixels of rings with these slopes and radii."""
    axes: Floats = np.linalg.svd(slopes, compute_uv=False) * radii[:, None]
    return axes


def inverse(matrices: Floats) -> Floats:
    """Of 2 x 2 matrices (n, 2, 2)."""
    a, b, c, d = (matrices[:, i, j] for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)))
    swapped = np.stack([d, -b, -c, a], axis=1).reshape(-1, 2, 2)
    result: Floats = swapped / (a * d - b * c)[:, None, None]
    return result
