"""Film -> where the car was at every frame and where the cones are, with what is worth knowing.

Two steps, as in the thesis: first the rings of the cones, while nothing moves; then the run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import GroundTruth, WorldCalibration, software
from geometry import Floats, LandmarkMap, Stamps, Trajectory, compose, floor_covariance, wrap
from tracking.bridging import bridge
from tracking.cone_map import ConeMap, map_cones
from tracking.errors import TrackingError
from tracking.film import Film, still_images
from tracking.following import Tracks, follow
from tracking.identity import car_pose
from tracking.scene import CarRings, Scene
from tracking.still_rings import average_rings
from tracking.torn import without_torn
from tracking.verdict import Judgement, judged
from tracking.watching import Watch, watch

STILL_PICTURES = 90


@dataclass(frozen=True, eq=False)
class TrackResult:
    """The truth, and everything that a summary and its pictures show of it.

    rows : (n,) of the tracks that the poses of the truth are of; span_m : (k,) distance of the
    car's rings wherever both were seen.
    """

    truth: GroundTruth
    tracks: Tracks
    watch: Watch
    judgement: Judgement
    rows: npt.NDArray[np.int64]
    span_m: Floats

    @property
    def bridged(self) -> npt.NDArray[np.bool_]:
        """(n,) poses that nobody saw."""
        assert self.truth.bridged is not None
        return self.truth.bridged


def track_film(
    film: Film,
    world: WorldCalibration,
    scene: Scene,
    *,
    cones: LandmarkMap | None = None,
    how: Mapping[str, object] | None = None,
    advance: Callable[[int], None] = lambda _: None,
) -> TrackResult:
    """The ground truth of a film.

    cones : measured before, as when cones stand on their rings during the run; None measures them
    at the beginning of this film. Raises `TrackingError` when the calibration was rejected, or the
    car was never seen.
    """
    if not world.accepted:
        raise TrackingError(
            "the world's calibration was rejected, nothing can be measured with it: "
            + "; ".join(world.reasons)
        )
    remarks: tuple[str, ...] = ()
    if cones is None:
        found = cones_of(film, world, scene)
        cones, remarks = found.cones, found.remarks
    tracks = without_torn(follow(film, world, scene, cones, advance))
    path, covariances, bridged, rows = _car_path(tracks, world, scene)
    seen = watch(tracks)
    both = tracks.seen[:, -2:].all(axis=1)
    span = np.linalg.norm(tracks.xy[both, -2] - tracks.xy[both, -1], axis=1)
    judgement = judged(tracks, seen, bridged, rows, span, scene, remarks)
    provenance: dict[str, object] = {
        "made_by": "trackside track",
        "software": software(),
        "film": film.source,
        "stamps": film.stamps,
        "calibration_made_utc": world.made_utc,
        "scene": scene,
        **judgement.record(),
        **(how or {}),
    }
    truth = GroundTruth(path, cones, provenance, covariances, bridged)
    return TrackResult(truth, tracks, seen, judgement, rows, span)


def cones_of(film: Film, world: WorldCalibration, scene: Scene) -> ConeMap:
    """The first step: the rings of the cones at the beginning of a film."""
    images = still_images(film, scene.settle_s)
    return map_cones(average_rings(images, world.ring, STILL_PICTURES), world, scene)


def _car_path(
    tracks: Tracks, world: WorldCalibration, scene: Scene
) -> tuple[Trajectory, Floats, npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
    """Poses at all frames from the first sight to the last, long gaps left out."""
    seen = np.asarray(tracks.seen[:, -2:].all(axis=1))
    if not seen.any():
        raise TrackingError(
            f"the car was seen in none of {len(tracks.t_ns)} frames; expected two rings "
            f"{scene.car.span_m:g} m apart at a height of {scene.car.height_m:g} m: are these the "
            "car's, is it in the picture, is the exposure short enough?"
        )
    poses, image = _measured(tracks, seen, scene.car)
    first, last = np.flatnonzero(seen)[[0, -1]]
    kept = np.zeros(len(seen), bool)
    kept[first : last + 1] = ~_in_long_gap(tracks.t_ns, seen, scene.max_bridge_s)[first : last + 1]
    inside = slice(first, last + 1)
    smooth, spread = bridge(tracks.t_ns[inside], poses[inside], image[inside], seen[inside])
    hidden = ~seen[inside]
    poses[inside][hidden] = smooth[hidden]
    image[inside][hidden] = spread[hidden]
    rows = np.flatnonzero(kept)
    poses[:, 2] = wrap(poses[:, 2])
    covariances = image[rows] + _systematic(poses[rows], world, scene.car)
    path = Trajectory.from_poses(tracks.t_ns[rows], poses[rows])
    return path, covariances, ~seen[rows], rows


def _measured(tracks: Tracks, seen: npt.NDArray[np.bool_], car: CarRings) -> tuple[Floats, Floats]:
    """Poses (n, 3) of base_link and covariances (n, 3, 3) of the image alone; 0 where not seen."""
    poses, covariances = np.zeros((len(seen), 3)), np.zeros((len(seen), 3, 3))
    for k in np.flatnonzero(seen).tolist():
        front, rear = tracks.xy[k, -2:]
        spread = tracks.covariances[k, -2:]
        pose, covariances[k] = car_pose(
            front, rear, spread[0], spread[1], car.front_x_m, car.rear_x_m
        )
        poses[k] = compose(pose, np.array(car.pose_line_base))
    return poses, covariances


def _in_long_gap(
    t_ns: Stamps, seen: npt.NDArray[np.bool_], limit_s: float
) -> npt.NDArray[np.bool_]:
    """Frames (n,) between sights that are further apart than the limit."""
    rows = np.arange(len(seen))
    before = np.maximum.accumulate(np.where(seen, rows, -1))
    after = np.minimum.accumulate(np.where(seen, rows, len(seen))[::-1])[::-1]
    inside = ~seen & (before >= 0) & (after < len(seen))
    gap_s = np.zeros(len(seen))
    gap_s[inside] = (t_ns[after[inside]] - t_ns[before[inside]]) * 1e-9
    return np.asarray(gap_s > limit_s)


def _systematic(poses: Floats, world: WorldCalibration, car: CarRings) -> Floats:
    """(n, 3, 3): what calibration, height and lever arm add; the same for all of a run."""
    ahead = (car.front_x_m + car.rear_x_m) / 2.0
    along = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    rings = poses[:, :2] + ahead * along
    covariance = np.zeros((len(poses), 3, 3))
    covariance[:, :2, :2] = floor_covariance(
        world.view, world.covariance_matrix, rings, car.height_m, car.height_sigma_m
    )
    covariance[:, :2, :2] += car.lever_sigma_m**2 * np.eye(2)
    covariance[:, 2, 2] = 2.0 * (car.lever_sigma_m / car.span_m) ** 2
    return covariance
