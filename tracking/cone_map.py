"""The first step: where the cones' rings are, from seconds in which nothing moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from capture import WorldCalibration
from geometry import Floats, LandmarkMap, circle_centres, floor_covariance
from tracking.errors import ImageError
from tracking.identity import NOBODY, unique_matches
from tracking.outlines import half_axes
from tracking.scene import Scene
from tracking.still_rings import StillRings

Indices: TypeAlias = npt.NDArray[np.int64]

_CORNER_M, _CONE_M = 0.10, 0.25
_SPAN_M = 0.02
_SIZE_PX, _SIZE_SHARE = 0.8, 0.06


@dataclass(frozen=True, eq=False)
class ConeMap:
    """What stands on the floor at the beginning.

    cones : their rings, with covariances; remarks : what a person should know.
    """

    cones: LandmarkMap
    remarks: tuple[str, ...]


def map_cones(rings: StillRings, world: WorldCalibration, scene: Scene) -> ConeMap:
    """What each ring that stands is: a corner, one of the car's two, or a cone's.

    Raises `ImageError` for pictures of another resolution than the calibration's.
    """
    size = (world.camera.width_px, world.camera.height_px)
    if rings.size_px != size:
        raise ImageError(
            f"the film has {rings.size_px[0]}x{rings.size_px[1]} pixels, the calibration is for "
            f"{size[0]}x{size[1]}: film and calibrate at one resolution"
        )
    left = _without_corners(rings, world)
    pair = _car_pair(rings, left, world, scene)
    if pair is not None:
        left = np.setdiff1d(left, pair)
    xy = _places(rings, left, world, scene.cones.height_m)
    fits = _has_size(rings, left, world, scene.cones.height_m, xy)
    remarks = []
    if not fits.all():
        remarks.append(f"{int((~fits).sum())} rings have not the size of a cone's ring: left out")
    left, xy = left[fits], xy[fits]
    ids, order, more = _numbered(xy, scene)
    left, xy = left[order], xy[order]
    covariance = _covariances(rings, left, world, scene, xy)
    return ConeMap(LandmarkMap(ids, xy, covariance), (*remarks, *more))


def _without_corners(rings: StillRings, world: WorldCalibration) -> Indices:
    """Indices of the rings that are no corners of the calibration."""
    taken = np.zeros(len(rings.centres_px), bool)
    for marker in world.markers:
        if marker.corner is None:
            continue
        at = circle_centres(world.view, rings.centres_px, marker.xyz_m[2], world.ring.radius_m)
        taken |= np.linalg.norm(at - marker.xyz_m[:2], axis=1) < _CORNER_M
    return np.flatnonzero(~taken).astype(np.int64)


def _car_pair(
    rings: StillRings, left: Indices, world: WorldCalibration, scene: Scene
) -> Indices | None:
    """The two rings that are so far apart and so large as the car's; the best pair, if any."""
    height = scene.car.height_m
    xy = _places(rings, left, world, height)
    off = _size_off(rings, left, world, height, xy)
    best: tuple[float, Indices] | None = None
    for i in range(len(left)):
        for j in range(i):
            span = float(np.hypot(*(xy[i] - xy[j])))
            fits = abs(span - scene.car.span_m) < _SPAN_M and max(off[i], off[j]) < 1.0
            score = float(off[i] + off[j])
            if fits and (best is None or score < best[0]):
                best = (score, left[[i, j]])
    return None if best is None else best[1]


def _places(rings: StillRings, which: Indices, world: WorldCalibration, height_m: float) -> Floats:
    return circle_centres(world.view, rings.centres_px[which], height_m, world.ring.radius_m)


def _size_off(
    rings: StillRings, which: Indices, world: WorldCalibration, height_m: float, xy: Floats
) -> Floats:
    """By how much each ring's axes differ from those at this height, over what is allowed."""
    if not len(which):
        return np.zeros(0)
    slopes = world.view.plane_jacobian(xy, height_m)
    due = 2.0 * half_axes(slopes, np.full(len(xy), world.ring.radius_m))
    allowed = _SIZE_SHARE * due + _SIZE_PX
    off: Floats = (np.abs(rings.diameters_px[which] - due) / allowed).max(axis=1)
    return off


def _has_size(
    rings: StillRings, which: Indices, world: WorldCalibration, height_m: float, xy: Floats
) -> npt.NDArray[np.bool_]:
    return np.asarray(_size_off(rings, which, world, height_m, xy) < 1.0)


def _numbered(xy: Floats, scene: Scene) -> tuple[Indices, Indices, list[str]]:
    """Ids and the rings that have them: as the scene names them, or along x, then y."""
    if not scene.cones.places:
        order = np.lexsort((xy[:, 1], xy[:, 0]))
        return np.arange(1, len(xy) + 1, dtype=np.int64), order.astype(np.int64), []
    names = sorted(scene.cones.places, key=int)
    near = np.array([scene.cones.places[name] for name in names])
    matches = unique_matches(near, np.full(len(names), _CONE_M), xy)
    found = matches != NOBODY
    remarks = [
        f"cone {name}: no ring, or more than one, within {_CONE_M} m of {list(place)}"
        for name, place, hit in zip(names, near.tolist(), found, strict=True)
        if not hit
    ]
    spare = len(xy) - int(found.sum())
    if spare:
        remarks.append(f"{spare} rings stand where the scene names no cone: left out")
    ids = np.array([int(name) for name in names], np.int64)[found]
    return ids, matches[found], remarks


def _covariances(
    rings: StillRings, which: Indices, world: WorldCalibration, scene: Scene, xy: Floats
) -> Floats:
    """(n, 2, 2): of the average, of the calibration, and of the height."""
    if not len(xy):
        return np.zeros((0, 2, 2))
    height, sigma_m = scene.cones.height_m, scene.cones.height_sigma_m
    to_floor = np.linalg.inv(world.view.plane_jacobian(xy, height))
    variance = rings.sigma_px[which][:, None, None] ** 2
    image = variance * to_floor @ to_floor.transpose(0, 2, 1)
    known = floor_covariance(world.view, world.covariance_matrix, xy, height, sigma_m)
    return np.asarray(image + known)
