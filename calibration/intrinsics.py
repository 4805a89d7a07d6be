"""Sightings of a board -> the nine parameters of a camera, and how well each is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.board import BoardSighting
from calibration.errors import CalibrationError
from geometry import Camera, Floats, View, apparent_centre, camera_of, view_jacobian

_CIRCLE_ROUNDS = 3
LEAST_VIEWS = 3


@dataclass(frozen=True, eq=False)
class IntrinsicsFit:
    """A camera, where each board was, residuals (n, 2) of each board, covariance (9, 9)."""

    camera: Camera
    views: tuple[View, ...]
    residuals: tuple[Floats, ...]
    covariance: Floats

    @property
    def rms_px(self) -> float:
        """Root mean square distance of a point from where it should be."""
        return rms(np.concatenate(self.residuals))

    @property
    def view_rms_px(self) -> Floats:
        """The same of each board."""
        return np.array([rms(one) for one in self.residuals])

    @property
    def tilts_rad(self) -> Floats:
        """Of each board against the picture; 0 is square on."""
        return np.array([np.arccos(min(1.0, abs(view.rotation[2, 2]))) for view in self.views])


def rms(residuals: Floats) -> float:
    """Root mean square length of rows (n, 2)."""
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


def fit_intrinsics(
    sightings: Sequence[BoardSighting], size_px: tuple[int, int], radius_m: float
) -> IntrinsicsFit:
    """The camera with the least squared residuals; all five coefficients of distortion are free.

    size_px : width, height. radius_m : of the board's circles, whose images' middles are not the
    images of their middles; 0 for points. Raises `CalibrationError` when nothing fits.
    """
    if len(sightings) < LEAST_VIEWS:
        raise CalibrationError(
            f"{len(sightings)} pictures of the board cannot calibrate a camera; "
            f"expected {LEAST_VIEWS} at the very least"
        )
    bias = [np.zeros_like(one.pixels) for one in sightings]
    for _ in range(_CIRCLE_ROUNDS if radius_m else 1):
        camera, views = _solved(sightings, bias, size_px)
        if radius_m:
            bias = [_circle_bias(v, s, radius_m) for v, s in zip(views, sightings, strict=True)]
    residuals = tuple(
        one.pixels - b - view.project(one.points_m)
        for one, b, view in zip(sightings, bias, views, strict=True)
    )
    covariance = _covariance(sightings, views, residuals)
    return IntrinsicsFit(camera, tuple(views), residuals, covariance)


def _solved(
    sightings: Sequence[BoardSighting], bias: Sequence[Floats], size_px: tuple[int, int]
) -> tuple[Camera, list[View]]:
    """OpenCV's bundle adjustment (Zhang's start, Levenberg-Marquardt)."""
    import cv2

    points = [one.points_m.astype(np.float32) for one in sightings]
    pixels = [(s.pixels - b).astype(np.float32) for s, b in zip(sightings, bias, strict=True)]
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-12)
    try:
        _, matrix, bent, turns, moves = cv2.calibrateCamera(
            points, pixels, size_px, np.eye(3), np.zeros(5), criteria=stop
        )
    except cv2.error as err:
        raise CalibrationError(
            f"no camera explains these pictures: {err.err}; is the board as large and as fine as "
            "was told, and tilted in some of them?"
        ) from err
    values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *bent.ravel()[:5]])
    camera = camera_of(values, *size_px)
    views = [
        View(
            camera,
            np.asarray(cv2.Rodrigues(turn)[0], np.float64),
            np.asarray(move, np.float64).ravel(),
        )
        for turn, move in zip(turns, moves, strict=True)
    ]
    return camera, views


def _circle_bias(view: View, sighting: BoardSighting, radius_m: float) -> Floats:
    """By how much the middles (n, 2) of the circles' images miss the images of their middles."""
    seen = apparent_centre(view, sighting.points_m[:, :2], 0.0, radius_m)
    return seen - view.project(sighting.points_m)


def _covariance(
    sightings: Sequence[BoardSighting], views: Sequence[View], residuals: Sequence[Floats]
) -> Floats:
    """(9, 9): the inverse of J^T J with every board's place eliminated, times the variance."""
    information = np.zeros((9, 9))
    for sighting, view in zip(sightings, views, strict=True):
        jacobian = view_jacobian(view, sighting.points_m).reshape(-1, 15)
        own, pose = jacobian[:, :9], jacobian[:, 9:]
        across = own.T @ pose
        information += own.T @ own - across @ np.linalg.solve(pose.T @ pose, across.T)
    left = np.concatenate(list(residuals))
    freedom = max(left.size - 9 - 6 * len(views), 1)
    # Scaled, as focal lengths and coefficients of distortion differ by many powers of ten.
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * scale[:, None] * scale)
    covariance: Floats = inverse * scale[:, None] * scale * float((left**2).sum()) / freedom
    return (covariance + covariance.T) / 2.0


def sigmas(covariance: Floats) -> Floats:
    """Standard deviations (9,)."""
    return np.sqrt(np.diag(covariance))
