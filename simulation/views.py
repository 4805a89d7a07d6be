"""The two places where a camera above a track usually hangs.

The figures are those of reference/ring_markers.md, section 4: 3.5 m high, 4.75 m of floor from top
to bottom when it looks straight down (4.4 mm a pixel, 28 px a ring at 1080p).
"""

from __future__ import annotations

import numpy as np

from geometry import Camera, View, looking_at

HEIGHT_M = 3.5
SEEN_M = 4.75
DISTORTION = (-0.12, 0.03, 0.0006, -0.0004, 0.0)
_SIZES = {480: 640, 720: 1280, 1080: 1920, 2160: 3840}


def make_camera(height_px: int = 1080) -> Camera:
    """A camera with a usual lens, 480, 720, 1080 or 2160 rows."""
    width_px = _SIZES[height_px]
    focal = height_px * HEIGHT_M / SEEN_M
    centre = (0.497 * width_px, 0.506 * height_px)
    return Camera(width_px, height_px, focal, 0.9985 * focal, *centre, DISTORTION)


def straight_down_view(height_px: int = 1080) -> View:
    """Above the middle of the world, x to the right and y up in the image."""
    camera = make_camera(height_px)
    return looking_at(camera, np.array([0, 0, HEIGHT_M]), np.zeros(3), np.array([0.0, 1.0, 0.0]))


def oblique_view(height_px: int = 1080) -> View:
    """From 1.2 m outside of a square of 3 m, looking at a point before its middle."""
    camera = make_camera(height_px)
    position = np.array([0.0, -2.7, HEIGHT_M])
    return looking_at(camera, position, np.array([0.0, -0.3, 0.0]), np.array([0.0, 0.0, 1.0]))
