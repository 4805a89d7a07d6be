"""The exact images of known rings: where their edges must be for a given place on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats, View, at_height
from tracking.profiles import spokes

_PROBES = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


@dataclass(frozen=True, eq=False)
class Outlines:
    """Of n rings. edges : (n, K, 2, 2) pixels where the lines cross the outer and the inner edge.

    centres : (n, 2) images of the rings' centres. slopes : (n, 2, 2) d pixel / d world x, y.
    """

    edges: Floats
    centres: Floats
    slopes: Floats


@dataclass(frozen=True, eq=False)
class RingPlanes:
    """Heights (n,) and outer radii (n,) of n rings, and their one ratio of diameters."""

    heights: Floats
    radii: Floats
    ratio: float

    def take(self, which: Floats | np.ndarray) -> RingPlanes:
        """Some of them."""
        return RingPlanes(self.heights[which], self.radii[which], self.ratio)


def outlines(
    view: View, xy: Floats, planes: RingPlanes, lines: int, slopes: Floats | None = None
) -> Outlines:
    """Edges of the rings round (n, 2), through perspective and lens without approximation.

    slopes : (n, 2, 2) of a place nearby, which choose where the lines cross; a degree off does no
    harm. Without them they are worked out first.
    """
    if slopes is None:
        slopes = view.plane_jacobian(xy, planes.heights)
    n = len(xy)
    scaled = spokes(slopes, lines)[:, :, None, :] * np.array([1.0, planes.ratio])[:, None]
    unit = np.concatenate([scaled.reshape(n, 2 * lines, 2), np.broadcast_to(_PROBES, (n, 5, 2))], axis=1)
    points = unit * planes.radii[:, None, None] + xy[:, None, :]
    pixels = view.project(at_height(points, planes.heights[:, None]))
    probes = pixels[:, 2 * lines :]
    across = (probes[:, 1::2] - probes[:, 2::2]) / (2.0 * planes.radii)[:, None, None]
    edges = pixels[:, : 2 * lines].reshape(n, lines, 2, 2)
    return Outlines(edges, probes[:, 0], across.transpose(0, 2, 1))


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
