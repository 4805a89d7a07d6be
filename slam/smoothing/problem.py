"""What the smoother starts from: the filter's result and the data as poses, motions and sights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from capture import Estimate, Observations, Odometry
from geometry import Floats, LandmarkMap, Stamps, Trajectory, between, compose, wrap
from slam import motion
from slam.config import ObservationNoise
from slam.errors import SlamError
from slam.smoothing.config import SmoothingConfig
from slam.smoothing.kernels import CAUCHY, HUBER, NO_LOSS, Factors, chain_motions

LOSSES = {"none": NO_LOSS, "huber": HUBER, "cauchy": CAUCHY}
_LEAST_MOTION_SIGMA = 1e-5
"""Metres and radians between two poses that the odometry calls the same: they stay apart from
being one only so that one kind of equation serves all."""


@dataclass(frozen=True, eq=False)
class Problem:
    """The factors and a first guess of what they are to determine.

    node_ns : (K + 1,) times of the poses, the first pose of the path and then every scan; poses :
    (K + 1, 3); landmarks : (n, 2), in the order of landmark_ids (n,), that of the first sighting;
    driven : the odometry; path : the filter's; left_out : observations that are not used.
    """

    node_ns: Stamps
    poses: Floats
    landmarks: Floats
    landmark_ids: npt.NDArray[np.int64]
    factors: Factors
    driven: Trajectory
    path: Trajectory
    left_out: int


def problem_of(
    estimate: Estimate,
    odometry: Odometry,
    observations: Observations,
    associations: npt.NDArray[np.int64],
    config: SmoothingConfig,
) -> Problem:
    """The problem; raises `SlamError` when the parts do not belong together."""
    landmarks = _checked(estimate, odometry, observations, associations)
    path, driven = estimate.path, Trajectory.from_poses(odometry.t_ns, odometry.pose_odom_base)
    t_ns = observations.t_ns
    inside = (t_ns >= path.t_ns[0]) & (t_ns <= path.t_ns[-1])
    finite = np.isfinite(observations.range_m) & np.isfinite(observations.bearing_rad)
    used = np.flatnonzero(np.isin(associations, landmarks.ids) & inside & finite)
    if used.size == 0:
        raise SlamError(
            f"estimate {estimate.name!r}: none of {t_ns.size} observations belongs to one of its "
            f"{landmarks.ids.size} landmarks; there is nothing to smooth"
        )
    ids = _by_first_sighting(associations[used])
    node_ns = np.union1d(path.t_ns[:1], t_ns[used])
    motions, information = _motions(driven, node_ns, motion.noise_array(config.motion))
    factors = Factors(
        motions,
        information,
        np.searchsorted(node_ns, t_ns[used]).astype(np.int64),
        _rows(ids, associations[used]),
        observations.range_m[used],
        observations.bearing_rad[used],
        sight_information(observations.range_m[used], config.observation),
        LOSSES[config.loss],
        config.loss_scale,
    )
    poses = path.interpolated(node_ns).poses
    positions = landmarks.positions[_rows(landmarks.ids, ids)]
    left_out = int(t_ns.size - used.size)
    return Problem(node_ns, poses, positions, ids, factors, driven, path, left_out)


def path_between(problem: Problem, nodes: Floats, covariances: Floats) -> tuple[Trajectory, Floats]:
    """The path at the filter's stamps and its covariances, from those of the nodes.

    Between two nodes the odometry is laid from both sides and the two are blended in the measure of
    the motion, so that a standing car stands; covariances are blended, too. Behind the last node
    the odometry goes on from it.
    """
    t_ns, node_ns = problem.path.t_ns, problem.node_ns
    before = np.searchsorted(node_ns, t_ns, side="right") - 1
    after = np.minimum(before + 1, node_ns.size - 1)
    moved, moved_at_node = _moved(problem.driven, t_ns), _moved(problem.driven, node_ns)
    whole = moved_at_node[after] - moved_at_node[before]
    share = (moved - moved_at_node[before]) / np.where(whole > 0.0, whole, np.inf)
    share = np.clip(share, 0.0, 1.0)
    driven = problem.driven.interpolated(t_ns).poses
    at_node = problem.driven.interpolated(node_ns).poses
    ahead = compose(nodes[before], between(at_node[before], driven))
    back = compose(nodes[after], between(at_node[after], driven))
    poses = ahead + share[:, None] * (back - ahead)
    poses[:, 2] = wrap(ahead[:, 2] + share * wrap(back[:, 2] - ahead[:, 2]))
    weights = share[:, None, None]
    blended = (1.0 - weights) * covariances[before] + weights * covariances[after]
    return Trajectory.from_poses(t_ns, poses), blended


def _moved(driven: Trajectory, t_ns: Stamps) -> Floats:
    """How much the car has moved up to each stamp: metres and radians, added up."""
    step = between(driven.poses[:-1], driven.poses[1:])
    moved = np.concatenate([[0.0], np.cumsum(np.abs(step).sum(axis=1))])
    origin_ns = driven.t_ns[0]
    at: Floats = np.interp(t_ns - origin_ns, driven.t_ns - origin_ns, moved)
    return at


def _checked(
    estimate: Estimate,
    odometry: Odometry,
    observations: Observations,
    associations: npt.NDArray[np.int64],
) -> LandmarkMap:
    """The map of the estimate, after a look at whether all parts are of one run."""
    name, path = f"estimate {estimate.name!r}", estimate.path
    if estimate.map is None or len(estimate.map) == 0:
        raise SlamError(f"{name} has no landmarks; only a path with a map can be smoothed")
    if associations.shape != observations.t_ns.shape:
        raise SlamError(
            f"{name}: {associations.size} associations for {observations.t_ns.size} observations; "
            "expected one each, in their order"
        )
    if path.t_ns[0] < odometry.t_ns[0] or path.t_ns[-1] > odometry.t_ns[-1]:
        raise SlamError(
            f"{name} covers {path.t_ns[0] * 1e-9:.3f} to {path.t_ns[-1] * 1e-9:.3f} s, the "
            f"odometry {odometry.t_ns[0] * 1e-9:.3f} to {odometry.t_ns[-1] * 1e-9:.3f} s; smooth "
            "with the odometry that the estimate was made from"
        )
    return estimate.map.landmarks


def _by_first_sighting(
    seen: npt.NDArray[np.int64],
) -> npt.NDArray[np.int64]:
    """The ids that were seen, in the order in which they first were."""
    found, first = np.unique(seen, return_index=True)
    return found[np.argsort(first)]


def _rows(ids: npt.NDArray[np.int64], wanted: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The row of each wanted id in `ids`, which holds it."""
    order = np.argsort(ids)
    return order[np.searchsorted(ids, wanted, sorter=order)].astype(np.int64)


def _motions(driven: Trajectory, node_ns: Stamps, noise: Floats) -> tuple[Floats, Floats]:
    """Motion (K, 3) between nodes as the odometry tells it, and its information (K, 3, 3)."""
    inner = (driven.t_ns > node_ns[0]) & (driven.t_ns < node_ns[-1])
    t_ns = np.union1d(driven.t_ns[inner], node_ns)
    poses = driven.interpolated(t_ns).poses
    motions, covariances = chain_motions(
        between(poses[:-1], poses[1:]),
        np.diff(t_ns) * 1e-9,
        np.searchsorted(t_ns, node_ns).astype(np.int64),
        noise,
    )
    return motions, motion_information(covariances)


def motion_information(covariances: Floats) -> Floats:
    """(K, 3, 3): what motions of these covariances tell."""
    information = np.linalg.inv(covariances + _LEAST_MOTION_SIGMA**2 * np.eye(3))
    return information.astype(np.float64)


def sight_information(range_m: Floats, noise: ObservationNoise) -> Floats:
    """(m, 2): one over the variances of range and bearing."""
    var_r = noise.range_sigma_m**2 + (noise.range_sigma_per_m * range_m) ** 2
    var_b = np.full(range_m.size, noise.bearing_sigma_rad**2)
    return 1.0 / np.stack([var_r, var_b], axis=1)
