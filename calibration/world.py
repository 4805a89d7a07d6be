"""The floor's frame: the camera's place above four corner rings whose distances were measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from calibration.adjustment import FloorFit, FloorObservations, adjust_floor
from calibration.corners import find_corners, find_other
from calibration.errors import CalibrationError
from calibration.survey import Floor, FloorMarker
from capture import (
    CameraCalibration,
    LengthResidual,
    PlacedMarker,
    WorldCalibration,
    now_utc,
)
from geometry import Camera, CameraError, Floats, View, at_height, fit_planar_view, floor_covariance
from tracking import StillRings

_GRID = 15


@dataclass(frozen=True, kw_only=True)
class WorldLimits:
    """When a floor is accepted."""

    max_residual_px: float = field(default=0.5, metadata={"min": 0.0})
    max_length_sigmas: float = field(default=3.5, metadata={"min": 1.0})
    """A length's residual over its standard deviation."""
    max_strain: float = field(default=2.5, metadata={"min": 1.0})
    max_sigma_m: float = field(default=0.005, metadata={"min": 0.0})
    """Predicted standard deviation anywhere between the corners."""
    car_height_m: float = field(default=0.2, metadata={"min": 0.0})
    """Where the accuracy is predicted, beside the floor."""


@dataclass(frozen=True, eq=False)
class WorldResult:
    """A calibration, and what its picture shows: rings, the fit, predicted sigmas on a grid."""

    calibration: WorldCalibration
    fit: FloorFit
    rings: StillRings
    names: tuple[str, ...]
    centres_px: Floats
    grid: Floats
    sigma_m: Floats


def calibrate_world(
    floor: Floor,
    rings: StillRings,
    camera: CameraCalibration,
    how: Mapping[str, object],
    limits: WorldLimits = WorldLimits(),
) -> WorldResult:
    """The frame that explains rings and lengths, with a verdict.

    Raises `CalibrationError` for pictures of another resolution than the camera's, missing or
    collinear corners, and when nothing fits.
    """
    size = (camera.camera.width_px, camera.camera.height_px)
    if rings.size_px != size:
        raise CalibrationError(
            f"the pictures have {rings.size_px[0]}x{rings.size_px[1]} pixels, the camera was "
            f"calibrated at {size[0]}x{size[1]}: film and calibrate at one resolution"
        )
    corners = find_corners(floor, rings.centres_px, size[0])
    view, xy = _start(floor, rings.centres_px[corners], camera.camera)
    markers, indices, missing = _others(floor, rings, view, corners)
    heights = np.array([marker.height_m for marker in markers])
    seen = _observations(floor, markers, rings, indices, heights)
    places = view.on_plane(rings.centres_px[indices[4:]], heights[4:])
    fit = adjust_floor(view, np.concatenate([xy, places]), camera.covariance_matrix, seen)
    grid = _grid(fit.xy[:4])
    accuracy, sigma = _accuracy(fit, grid, limits)
    reasons = _reasons(floor, fit, markers, missing, camera, sigma, limits)
    calibration = WorldCalibration(
        made_utc=now_utc(),
        accepted=not reasons,
        reasons=tuple(reasons),
        camera=fit.view.camera,
        rotation=tuple(tuple(row) for row in fit.view.rotation.tolist()),
        translation_m=_three(fit.view.translation),
        covariance=tuple(tuple(row) for row in fit.covariance.tolist()),
        ring=floor.ring,
        markers=tuple(_placed(fit, k, marker) for k, marker in enumerate(markers)),
        lengths=_length_residuals(floor, markers, fit),
        accuracy_m=accuracy,
        how={"pictures": rings.pictures, "strain": fit.strain, "freedom": fit.freedom,
             "camera_made_utc": camera.made_utc, "floor": floor, "limits": limits, **how},
    )  # fmt: skip
    names = tuple(marker.name for marker in markers)
    return WorldResult(calibration, fit, rings, names, rings.centres_px[indices], grid, sigma)


def _start(floor: Floor, pixels: Floats, camera: Camera) -> tuple[View, Floats]:
    """A view and corners (4, 2) that are roughly right: a rectangle of the measured sides."""
    names = {marker.name: k for k, marker in enumerate(floor.corner_markers)}
    sides: dict[frozenset[int], list[float]] = {}
    for length in floor.lengths:
        pair = frozenset(names.get(name, -1) for name in length.between)
        sides.setdefault(pair, []).append(length.length_m)

    def mean(*pairs: tuple[int, int]) -> float | None:
        values = [value for pair in pairs for value in sides.get(frozenset(pair), [])]
        return float(np.mean(values)) if values else None

    wide, deep = mean((0, 1), (2, 3)), mean((1, 2), (0, 3))
    across = mean((0, 2), (1, 3))
    if wide is None or deep is None:
        known = wide or deep
        assert known is not None, "four of six lengths include a side"
        assert across is not None, "without one pair of sides there are diagonals"
        other = float(np.sqrt(max(across**2 - known**2, (0.1 * across) ** 2)))
        wide, deep = wide or other, deep or other
    xy = np.array([[0.0, 0.0], [wide, 0.0], [wide, deep], [0.0, deep]])
    height = float(np.mean([marker.height_m for marker in floor.corner_markers]))
    try:
        return fit_planar_view(camera, at_height(xy, height), pixels).view, xy
    except (CameraError, np.linalg.LinAlgError) as err:
        raise CalibrationError(f"the corners do not fix the camera's place: {err}") from err


def _others(
    floor: Floor, rings: StillRings, view: View, corners: npt.NDArray[np.int64]
) -> tuple[list[FloorMarker], npt.NDArray[np.int64], list[str]]:
    """Markers that are seen with the indices of their rings, corners first; names of the others."""
    markers, indices, missing = [*floor.corner_markers], corners.tolist(), []
    for marker in floor.others:
        left = np.setdiff1d(np.arange(len(rings.centres_px)), indices)
        expected = None
        if marker.near_m is not None:
            expected = view.project(np.array([*marker.near_m, marker.height_m]))
        found = find_other(marker, rings.centres_px[left], expected, rings.size_px[0])
        if found is None:
            missing.append(marker.name)
            continue
        markers.append(marker)
        indices.append(int(left[found]))
    return markers, np.array(indices, np.int64), missing


def _observations(
    floor: Floor,
    markers: list[FloorMarker],
    rings: StillRings,
    indices: npt.NDArray[np.int64],
    heights: Floats,
) -> FloorObservations:
    place = {marker.name: k for k, marker in enumerate(markers)}
    used = [length for length in floor.lengths if set(length.between) <= set(place)]
    return FloorObservations(
        rings.centres_px[indices],
        rings.sigma_px[indices],
        heights,
        np.array([[place[name] for name in length.between] for length in used]),
        np.array([length.length_m for length in used]),
        np.array([length.sigma_m for length in used]),
        floor.ring.radius_m,
    )


def _grid(corners: Floats) -> Floats:
    """Places (k, 2) between the corners."""
    a, b = (grid.ravel()[:, None] for grid in np.meshgrid(*[np.linspace(0.0, 1.0, _GRID)] * 2))
    lower = (1.0 - a) * corners[0] + a * corners[1]
    upper = (1.0 - a) * corners[3] + a * corners[2]
    return np.asarray((1.0 - b) * lower + b * upper)


def _accuracy(fit: FloorFit, grid: Floats, limits: WorldLimits) -> tuple[dict[str, float], Floats]:
    """Standard deviations over the floor and at the car's height; those of the worse, (k,)."""
    told: dict[str, float] = {}
    worst = np.zeros(len(grid))
    for name, height in (("floor", 0.0), ("car", limits.car_height_m)):
        spread = floor_covariance(fit.view, fit.covariance, grid, height)
        sigma = np.sqrt(np.linalg.eigvalsh(spread)[:, 1])
        told[f"{name}_rms"] = float(np.sqrt(np.trace(spread, axis1=1, axis2=2).mean()))
        told[f"{name}_max"] = float(sigma.max())
        worst = np.maximum(worst, sigma)
    return told, worst


def _reasons(
    floor: Floor,
    fit: FloorFit,
    markers: list[FloorMarker],
    missing: list[str],
    camera: CameraCalibration,
    sigma_m: Floats,
    limits: WorldLimits,
) -> list[str]:
    reasons = [f"{name} was not seen where it should be: remove or uncover it" for name in missing]
    if not camera.accepted:
        reasons.append("the camera's own calibration was rejected: " + "; ".join(camera.reasons))
    off_px = np.linalg.norm(fit.residuals_px, axis=1)
    for k in np.flatnonzero(off_px > limits.max_residual_px):
        reasons.append(
            f"{markers[k].name} is seen {off_px[k]:.2f} px from where it should be, at most "
            f"{limits.max_residual_px} px: is its height right, is it the ring you mean?"
        )
    used = [one for one in floor.lengths if not set(one.between) & set(missing)]
    ratio = np.abs(fit.length_residuals_m) / fit.length_sigma_m
    worst = int(ratio.argmax())
    if ratio[worst] > limits.max_length_sigmas:
        one = used[worst]
        reasons.append(
            f"the length {' to '.join(one.between)} was measured as {one.length_m:.4f} m, the "
            f"others make it {one.length_m + float(fit.length_residuals_m[worst]):.4f} m: "
            "measure it again, between the middles of the rings"
        )
    if fit.strain > limits.max_strain:
        reasons.append(
            f"residuals are {fit.strain:.1f} times as large as told, at most {limits.max_strain}: "
            "a length, a height, the diameter or the camera's calibration is wrong"
        )
    if not sigma_m.max() <= limits.max_sigma_m:
        reasons.append(
            f"places are known to {1e3 * sigma_m.max():.1f} mm only, at most "
            f"{1e3 * limits.max_sigma_m:g} mm: measure all sides and both diagonals, or better"
        )
    return reasons


def _placed(fit: FloorFit, k: int, marker: FloorMarker) -> PlacedMarker:
    spread = fit.marker_covariance[k]
    return PlacedMarker(
        name=marker.name,
        xyz_m=(float(fit.xy[k, 0]), float(fit.xy[k, 1]), marker.height_m),
        covariance_m2=_three(spread[[0, 0, 1], [0, 1, 1]]),
        residual_px=float(np.hypot(*fit.residuals_px[k])),
        corner=marker.corner,
    )


def _length_residuals(
    floor: Floor, markers: list[FloorMarker], fit: FloorFit
) -> tuple[LengthResidual, ...]:
    names = {marker.name for marker in markers}
    used = [length for length in floor.lengths if set(length.between) <= names]
    return tuple(
        LengthResidual(
            markers=one.between, length_m=one.length_m, sigma_m=one.sigma_m, residual_m=float(off)
        )
        for one, off in zip(used, fit.length_residuals_m, strict=True)
    )


def _three(values: Floats) -> tuple[float, float, float]:
    first, second, third = values.tolist()
    return first, second, third
