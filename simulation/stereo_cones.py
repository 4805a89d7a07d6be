"""Cones as an eye on the car sees them: shaded strips with a light band, far ones first."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

from geometry import Floats, inverse, transform_points
from simulation.stereo_eye import Placed

BASE_RADIUS_M = 0.09
APEX_M = 0.36
CUT_M = 0.30
_BAND_M = (0.12, 0.20)
_STRIPS = 16
_NEAREST_M = 0.08
_LIGHT_FROM_RAD = 2.2
"""Of the room: a cone is lit from one side of it, whichever way the car looks."""
_SUB = 16
"""Sixteenths of a pixel, in which OpenCV is told where corners are."""


def draw_cones(image: npt.NDArray[np.uint8], eye: Placed, cones: Floats, pose: Floats) -> None:
    """Paint cones (n, 2), where they stand in the world, into what an eye at a pose sees."""
    import cv2

    if not len(cones):
        return
    middles = transform_points(inverse(pose), cones)
    away = np.hypot(*(middles - eye.position[:2]).T)
    ahead = (middles - eye.position[:2]) @ eye.rotation[:2, 2] - eye.position[2] * eye.rotation[
        2, 2
    ]
    near = np.flatnonzero((away > BASE_RADIUS_M + _NEAREST_M) & (ahead > BASE_RADIUS_M))
    near = near[np.argsort(-away[near])]
    points = np.zeros((near.size, *_CORNERS.shape)) + _CORNERS
    points[..., :2] += middles[near, None, None]
    pixels = eye.project(points)
    finite = np.isfinite(pixels).all(axis=(2, 3))
    # Seen from outside only: a face is there when the eye is on its outer side.
    outer = ((eye.position - points[:, :, 0]) * _NORMALS).sum(axis=2) > 0.0
    in_view = _may_be_seen(pixels, eye)
    drawn = finite & outer & in_view
    fixed = np.rint(np.where(drawn[..., None, None], pixels, 0.0) * _SUB).astype(np.int32)
    grey = (_ALBEDO * (0.62 + 0.38 * np.cos(_ANGLES + pose[2] - _LIGHT_FROM_RAD))).tolist()
    for cone, face in np.argwhere(drawn).tolist():
        cv2.fillConvexPoly(image, fixed[cone, face], grey[face], cv2.LINE_AA, 4)


def _may_be_seen(pixels: Floats, eye: Placed) -> npt.NDArray[np.bool_]:
    """(n, faces): not wholly to one side of the picture. Far outside a lens folds back."""
    size = np.array([eye.camera.width_px, eye.camera.height_px])
    low, high = pixels.min(axis=2), pixels.max(axis=2)
    with np.errstate(invalid="ignore"):
        outside = (high < 0.0) | (low > size) | (low < -size) | (high > 2.0 * size)
    seen: npt.NDArray[np.bool_] = ~outside.any(axis=2)
    return seen


def _faces() -> tuple[Floats, Floats, Floats, Floats]:
    """Corners (faces, 4, 3), outer normals (faces, 3), angles and greys (faces,) of a cone."""
    corners, normals, angles, albedo = [], [], [], []
    for low, high in itertools.pairwise((0.0, *_BAND_M, CUT_M)):
        for strip in range(_STRIPS):
            edges = 2.0 * np.pi * (strip + np.array([0.0, 1.0, 1.0, 0.0])) / _STRIPS
            heights = np.array([low, low, high, high])
            radii = BASE_RADIUS_M * (1.0 - heights / APEX_M)
            corners.append(np.stack([radii * np.cos(edges), radii * np.sin(edges), heights], 1))
            middle = 2.0 * np.pi * (strip + 0.5) / _STRIPS
            normals.append([np.cos(middle), np.sin(middle), BASE_RADIUS_M / APEX_M])
            angles.append(middle)
            albedo.append(225.0 if low == _BAND_M[0] else 120.0)
    return np.array(corners), np.array(normals), np.array(angles), np.array(albedo)


_CORNERS, _NORMALS, _ANGLES, _ALBEDO = _faces()
