"""A small picture in which rings are as large as in a large one: 28 px, and quick to render."""

from __future__ import annotations

import numpy as np

from geometry import Camera, View, looking_at

SHAPE = (480, 640)
CAMERA = Camera(640, 480, 800.0, 798.0, 318.0, 243.0, (-0.12, 0.03, 0.0006, -0.0004, 0.0))


def small_view() -> View:
    """Straight down from 3.5 m: x from -1.3 to 1.3, y from -1 to 1 m."""
    return looking_at(CAMERA, np.array([0.0, 0.0, 3.5]), np.zeros(3), np.array([0.0, 1.0, 0.0]))


def small_oblique_view() -> View:
    """From the side, 40 degrees off the vertical."""
    up = np.array([0.0, 0.0, 1.0])
    return looking_at(CAMERA, np.array([0.0, -2.2, 2.6]), np.zeros(3), up)
