"""Cones in the scans of a session, as the lidar itself saw them, each with the cone that it is."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import Odometry, Scans, Session
from geometry import Floats, LandmarkMap, Stamps, Trajectory, compose, inverse, transform_points

MAX_GAP_S = 0.12
CLUSTER_S = 0.25
TRIED_YAWS = 72


@dataclass(frozen=True, eq=False)
class Seen:
    """Detections (n,) of one session in the frame of the lidar, at the middle of their revolution.

    t_ns : on the clock of the lidar; path, cones : the truth.
    """

    name: str
    t_ns: Stamps
    range_m: Floats
    bearing_rad: Floats
    path: Trajectory
    cones: LandmarkMap

    @property
    def points(self) -> Floats:
        """(n, 2) in the frame of the lidar."""
        bearing = self.bearing_rad
        along = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
        return np.asarray(self.range_m[:, None] * along)

    def poses(self, late_s: float) -> Floats:
        """(n, 3) of the car at the detections, whose stamps are late by so much."""
        t_ns = self.t_ns - round(late_s * 1e9)
        inside = np.clip(t_ns, self.path.t_ns[0], self.path.t_ns[-1])
        unique, row = np.unique(inside, return_inverse=True)
        return np.asarray(self.path.interpolated(unique).poses[row])

    @property
    def clusters(self) -> npt.NDArray[np.int64]:
        """(n,) detections that share the errors of the pose from which they were made."""
        return np.asarray((self.t_ns - self.path.t_ns[0]) // round(CLUSTER_S * 1e9), np.int64)


def seen_in(
    session: Session, mounting: Floats, late_s: float, radius_m: float, scans: Scans | None = None
) -> Seen:
    """The cones of a session's scans; beams are carried along the truth, not along an odometry.

    mounting (3,), late_s : what is known so far, for beams of a revolution are shot from different
    places. Raises `MissingStreamError` without truth or scans.
    """
    from slam.cones.config import Mounting, cone_config
    from slam.cones.detection import detect_cones

    truth = session.ground_truth()
    path = truth.path
    assert truth.landmarks is not None, "checked before"
    x, y, yaw = mounting.tolist()
    config = dataclasses.replace(
        cone_config("robust"), mounting=Mounting(x_m=x, y_m=y, yaw_rad=yaw), cone_radius_m=radius_m
    )
    zero = np.zeros(len(path))
    late_ns = round(late_s * 1e9)
    driven = Odometry("truth", path.t_ns + late_ns, path.poses, zero, zero)
    found = detect_cones(scans or session.scans(), driven, config).observations
    covered = path.covers(found.t_ns - late_ns, MAX_GAP_S)
    t_ns, reach = found.t_ns[covered], found.range_m[covered]
    bearing = found.bearing_rad[covered]
    on_car = reach[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    own = transform_points(inverse(mounting), on_car)
    return Seen(
        session.name,
        t_ns,
        np.hypot(*own.T),
        np.arctan2(own[:, 1], own[:, 0]),
        path,
        truth.landmarks,
    )


def nearest_cones(
    seen: Seen, mounting: Floats, late_s: float, gate_m: float
) -> npt.NDArray[np.int64]:
    """(n,) row of the cone that each detection is, -1 where none is within the gate."""
    world = transform_points(compose(seen.poses(late_s), mounting), seen.points)
    apart = np.linalg.norm(world[:, None] - seen.cones.positions, axis=2)
    nearest = apart.argmin(axis=1)
    return np.where(apart.min(axis=1) <= gate_m, nearest, -1).astype(np.int64)


def best_yaw(seen: Seen, mounting: Floats, gate_m: float) -> float:
    """The yaw at which most detections are cones: a lidar may be mounted any way round."""
    rows = slice(None, None, max(seen.t_ns.size // 600, 1))
    thinned = dataclasses.replace(
        seen, t_ns=seen.t_ns[rows], range_m=seen.range_m[rows], bearing_rad=seen.bearing_rad[rows]
    )
    yaws = np.linspace(-np.pi, np.pi, TRIED_YAWS, endpoint=False)
    counts = [
        int((nearest_cones(thinned, np.array([*mounting[:2], yaw]), 0.0, gate_m) >= 0).sum())
        for yaw in yaws.tolist()
    ]
    return float(yaws[int(np.argmax(counts))])
