"""A known length, measured by the calibrated camera, to see whether it comes out right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.errors import CalibrationError
from capture import WorldCalibration
from geometry import Floats, circle_centres, floor_covariance
from tracking import StillRings

_SAME_M = 0.05


@dataclass(frozen=True)
class LengthCheck:
    """A length that is known and as it was measured, with its predicted standard deviation."""

    known_m: float
    measured_m: float
    sigma_m: float
    tolerance_m: float
    places_m: tuple[tuple[float, float], tuple[float, float]]

    @property
    def error_m(self) -> float:
        """Measured minus known."""
        return self.measured_m - self.known_m

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return abs(self.error_m) <= self.tolerance_m


def verify_length(
    world: WorldCalibration,
    rings: StillRings,
    known_m: float,
    *,
    height_m: float = 0.0,
    between: tuple[str, str] | None = None,
    tolerance_m: float = 0.005,
) -> LengthCheck:
    """The distance between two rings at a height: two named ones, or the only two unknown ones.

    Raises `CalibrationError` for another resolution, or when it is not clear which rings are meant.
    """
    size = (world.camera.width_px, world.camera.height_px)
    if rings.size_px != size:
        raise CalibrationError(
            f"the pictures have {rings.size_px[0]}x{rings.size_px[1]} pixels, the calibration is "
            f"for {size[0]}x{size[1]}"
        )
    if between is None:
        places = _unknown(world, rings, height_m)
        heights = np.array([height_m, height_m])
    else:
        marks = [_marker(world, name) for name in between]
        heights = np.array([mark[2] for mark in marks])
        places = np.array(
            [_seen_at(world, rings, mark, between[k]) for k, mark in enumerate(marks)]
        )
    apart = places[1] - places[0]
    flat = float(np.hypot(*apart))
    spread = sum(
        floor_covariance(world.view, world.covariance_matrix, place, height)
        for place, height in zip(places, heights, strict=True)
    )
    direction = apart / flat
    first, second = places.tolist()
    return LengthCheck(
        known_m=known_m,
        measured_m=float(np.hypot(flat, heights[1] - heights[0])),
        sigma_m=float(np.sqrt(direction @ spread @ direction)),
        tolerance_m=tolerance_m,
        places_m=((first[0], first[1]), (second[0], second[1])),
    )


def _unknown(world: WorldCalibration, rings: StillRings, height_m: float) -> Floats:
    """Places (2, 2) of the only two rings that are no markers of the calibration."""
    radius = world.ring.radius_m
    known = np.zeros(len(rings.centres_px), bool)
    for marker in world.markers:
        at = circle_centres(world.view, rings.centres_px, marker.xyz_m[2], radius)
        known |= np.linalg.norm(at - marker.xyz_m[:2], axis=1) < _SAME_M
    left = circle_centres(world.view, rings.centres_px[~known], height_m, radius)
    if len(left) != 2:
        found = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in left) or "none"
        raise CalibrationError(
            f"beside the markers of the calibration exactly two rings must be seen, {len(left)} "
            f"are: {found}; remove the others, or name two markers with --between"
        )
    return left


def _marker(world: WorldCalibration, name: str) -> tuple[float, float, float]:
    for marker in world.markers:
        if marker.name == name:
            return marker.xyz_m
    names = ", ".join(marker.name for marker in world.markers)
    raise CalibrationError(f"the calibration has no marker {name!r}; it has {names}")


def _seen_at(
    world: WorldCalibration, rings: StillRings, xyz_m: tuple[float, float, float], name: str
) -> Floats:
    """Where a marker is seen now, (2,)."""
    at = circle_centres(world.view, rings.centres_px, xyz_m[2], world.ring.radius_m)
    off = np.linalg.norm(at - xyz_m[:2], axis=1) if len(at) else np.array([np.inf])
    if not off.min() < _SAME_M:
        raise CalibrationError(f"{name} is not seen where the calibration has it")
    return np.asarray(at[int(off.argmin())])
