"""Rendered floors with four corners, and what a person would measure on them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from calibration import Floor, FloorMarker, MeasuredLength, Picture
from capture import CameraCalibration
from geometry import Floats, View, at_height, inverse, transform_points
from simulation import OverheadScene, Ring, oblique_view
from tracking import StillRings, average_rings

VIEW = oblique_view(720)
CORNERS = np.array([[-1.2, -1.2], [1.2, -1.2], [1.2, 1.2], [-1.2, 1.2]])
UNEVEN = CORNERS + np.array([[0.05, 0.02], [-0.03, 0.0], [0.04, -0.06], [0.0, 0.07]])
SIGMAS = np.array([0.3, 0.3, 0.1, 0.1, 2e-4, 2e-4, 2e-5, 2e-5, 1e-4])


def camera(view: View = VIEW, accepted: bool = True) -> CameraCalibration:
    """The exact camera, calibrated as well as a good board does it."""
    return CameraCalibration(
        made_utc="2026-05-14T10:00:00Z",
        accepted=accepted,
        reasons=() if accepted else ("2 views",),
        camera=view.camera,
        covariance=tuple(tuple(row) for row in np.diag(SIGMAS**2).tolist()),
        rms_px=0.1,
        coverage=1.0,
        views=(),
    )


def pictures(xyz: Floats, view: View = VIEW, count: int = 4, seed: int = 0) -> list[Picture]:
    """Of flat rings at (n, 3)."""
    rng = np.random.default_rng(seed)
    scene = OverheadScene(view, [Ring((x, y, z)) for x, y, z in xyz.tolist()])
    return [Picture(f"picture {k}", scene.frame(rng).image) for k in range(count)]


def floor_of(corners: Floats, others: Sequence[FloorMarker] = (), error_m: float = 0.0) -> Floor:
    """All six lengths between corners (4, 2 or 3); error_m : added to the first."""
    lengths = [
        MeasuredLength(
            between=(f"c{a + 1}", f"c{b + 1}"),
            length_m=float(np.linalg.norm(corners[a] - corners[b])) + error_m * (a + b == 1),
        )
        for a, b in combinations(range(4), 2)
    ]
    marks = [
        FloorMarker(name=f"c{k + 1}", corner=k + 1, height_m=float(corner[2:].sum()))
        for k, corner in enumerate(corners)
    ]
    return Floor(markers=(*marks, *others), lengths=tuple(lengths))


def seen(xyz: Floats, view: View = VIEW, count: int = 4, seed: int = 0) -> StillRings:
    """Rings averaged over rendered pictures."""
    return average_rings(
        (one.image for one in pictures(xyz, view, count, seed)), floor_of(CORNERS).ring
    )


def in_frame(corners: Floats, xy: Floats) -> Floats:
    """Places (n, 2) in the frame of the corners: origin in 1, x along 1 -> 2."""
    along = corners[1, :2] - corners[0, :2]
    pose = np.array([*corners[0, :2], np.arctan2(along[1], along[0])])
    return transform_points(inverse(pose), xy)


def errors_m(view: View, found: View, corners: Floats, height_m: float) -> Floats:
    """How far off places between the corners come out, (n,)."""
    line = np.linspace(-1.1, 1.1, 9)
    xy = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    places = found.on_plane(view.project(at_height(xy, height_m)), height_m)
    return np.asarray(np.linalg.norm(places - in_frame(corners, xy), axis=1))
