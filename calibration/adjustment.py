"""The least squares adjustment of a floor: camera, its place and all markers at once.

Observed are the middles of the rings' images, the measured lengths, and the camera's parameters as
its own calibration gave them (with their covariance). So a slightly wrong focal length is corrected
where lengths and picture agree that it is, and every uncertainty reaches the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry import (
    Camera,
    Floats,
    View,
    apparent_centre,
    at_height,
    camera_of,
    intrinsics_of,
    turned,
)

_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class FloorObservations:
    """What is known of n markers, corners 1 to 4 first.

    centres_px : (n, 2) of the ellipses; sigma_px : (n,); heights_m : (n,); pairs : (m, 2) indices,
    lengths_m, sigma_m : (m,) of what was measured between them.
    """

    centres_px: Floats
    sigma_px: Floats
    heights_m: Floats
    pairs: npt.NDArray[np.int64]
    lengths_m: Floats
    sigma_m: Floats
    radius_m: float


@dataclass(frozen=True, eq=False)
class FloorFit:
    """view, xy : (n, 2) of the markers; covariance : (15, 15) of the view's parameters.

    marker_covariance : (n, 2, 2). residuals_px : (n, 2) seen minus predicted; length_residuals_m :
    (m,) fitted minus measured; length_sigma_m : (m,) of those residuals. strain : root of the mean
    squared residual over its expectation, 1 where all noise is as was told; freedom : how many
    observations there are more than unknowns.
    """

    view: View
    xy: Floats
    covariance: Floats
    marker_covariance: Floats
    residuals_px: Floats
    length_residuals_m: Floats
    length_sigma_m: Floats
    strain: float
    freedom: int


def adjust_floor(
    start: View, xy: Floats, intrinsics_covariance: Floats, seen: FloorObservations
) -> FloorFit:
    """The most likely floor near a start; corner 1 is the origin, corner 2 lies on the x axis."""
    from scipy.optimize import least_squares

    prior = _Prior(start.camera, intrinsics_covariance)
    view, z = start, np.zeros(9)
    for _ in range(_ROUNDS):
        unknowns = np.concatenate([z, np.zeros(3), view.translation, _free(xy)])
        base = view

        def residuals(x: Floats, base: View = base) -> Floats:
            return _residuals(prior, base, x, seen)

        # The turn is counted from the present place, so that its covariance is that of the result.
        solved = least_squares(residuals, unknowns, method="trf", x_scale="jac", jac="3-point")
        view, xy, z = *_placed(prior, base, solved.x), solved.x[:9]
    jacobian = np.asarray(solved.jac, np.float64)
    return _fit(prior, view, xy, jacobian, solved.fun, seen)


class _Prior:
    """The camera as it was calibrated: parameters = mean + root @ z, z standard normal."""

    def __init__(self, camera: Camera, covariance: Floats) -> None:
        self.mean, self.size = intrinsics_of(camera), (camera.width_px, camera.height_px)
        scale = np.sqrt(np.diag(covariance)) + 1e-12
        correlation = covariance / np.outer(scale, scale)
        values, vectors = np.linalg.eigh((correlation + correlation.T) / 2.0)
        self.root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))

    def camera(self, z: Floats) -> Camera:
        """The camera that far from the mean."""
        return camera_of(self.mean + self.root @ z, *self.size)


def _free(xy: Floats) -> Floats:
    """The coordinates that are unknown: all but corner 1 and the y of corner 2."""
    return np.concatenate([xy[1, :1], xy[2:].ravel()])


def _placed(prior: _Prior, base: View, x: Floats) -> tuple[View, Floats]:
    rotation = turned(x[9:12]) @ base.rotation
    u, _, v = np.linalg.svd(rotation)
    xy = np.concatenate([np.zeros(2), x[15:16], np.zeros(1), x[16:]]).reshape(-1, 2)
    return View(prior.camera(x[:9]), u @ v, x[12:15]), xy


def _residuals(prior: _Prior, base: View, x: Floats, seen: FloorObservations) -> Floats:
    """Pixels, lengths, prior; each over its standard deviation."""
    view, xy = _placed(prior, base, x)
    predicted = apparent_centre(view, xy, seen.heights_m, seen.radius_m)
    pixels = (seen.centres_px - predicted) / seen.sigma_px[:, None]
    # Far from any solution a ring can be behind the camera.
    pixels = np.nan_to_num(pixels, nan=1e6)
    lengths = (seen.lengths_m - _lengths(xy, seen)) / seen.sigma_m
    return np.concatenate([pixels.ravel(), lengths, x[:9]])


def _lengths(xy: Floats, seen: FloorObservations) -> Floats:
    points = at_height(xy, seen.heights_m)
    apart = points[seen.pairs[:, 0]] - points[seen.pairs[:, 1]]
    return np.asarray(np.linalg.norm(apart, axis=1))


def _fit(
    prior: _Prior, view: View, xy: Floats, jacobian: Floats, left: Floats, seen: FloorObservations
) -> FloorFit:
    scale = 1.0 / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    root = np.linalg.pinv(jacobian * scale) * scale[:, None]
    freedom = left.size - jacobian.shape[1]
    strain = float(np.sqrt((left**2).sum() / max(freedom, 1)))
    # Noise that was larger than told counts as large as it was; smaller may be luck.
    unknowns = root @ root.T * max(1.0, strain) ** 2
    to_camera = np.eye(15, len(unknowns))
    to_camera[:9, :9] = prior.root
    n = len(xy)
    to_markers = np.zeros((2 * n, len(unknowns)))
    to_markers[2, 15] = 1.0
    to_markers[4:, 16:] = np.eye(2 * n - 4)
    spread = to_markers @ unknowns @ to_markers.T
    first = 2 * n
    lines = slice(first, first + len(seen.pairs))
    # A residual is less uncertain than its length, for the fit follows the length.
    share = np.einsum("ij,ji->i", jacobian[lines], root[:, lines])
    return FloorFit(
        view,
        xy,
        to_camera @ unknowns @ to_camera.T,
        np.stack([spread[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(n)]),
        left[:first].reshape(-1, 2) * seen.sigma_px[:, None],
        -left[lines] * seen.sigma_m,
        seen.sigma_m * np.sqrt(np.maximum(1.0 - share, 1e-6)),
        strain,
        freedom,
    )
