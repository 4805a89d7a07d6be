"""A last pass over any filter's result: the most likely path and map given all data at once.

A filter knows only the past when it places a pose; the smoother moves all poses and landmarks
together until odometry and observations are contradicted least (GraphSLAM: Thrun, Burgard, Fox
2005, chapter 11; Dellaert and Kaess, Square Root SAM, IJRR 25, 2006), by Levenberg-Marquardt with a
robust loss as iteratively reweighted least squares. Which observation belongs to which landmark is
taken from the filter.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from capture import Estimate, EstimatedMap, Observations, Odometry
from geometry import Floats, LandmarkMap, wrap
from slam.errors import SlamError
from slam.smoothing import chain, kernels
from slam.smoothing.config import SmoothingConfig
from slam.smoothing.problem import Problem, path_between, problem_of

_Number = TypeVar("_Number", np.int64, np.float64)

_FIRST_DAMPING, _LEAST_DAMPING = 1e-2, 1e-9
_SETTLED_DAMPING = 1.0
_COLUMNS_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class Solution:
    """Where Levenberg-Marquardt came to rest."""

    poses: Floats
    landmarks: Floats
    cost: float
    iterations: int
    converged: bool


def smooth(
    estimate: Estimate,
    odometry: Odometry,
    observations: Observations,
    associations: npt.NDArray[np.int64],
    config: SmoothingConfig,
) -> Estimate:
    """The estimate with its path and map moved to where all data together want them.

    associations : (m,), per observation the id of its landmark in the estimate's map, or -1 where
    the filter did not use it. Path stamps, first pose, landmark ids and how each landmark entered
    the map stay; covariances of path and map are marginals of the smoother, between scans
    interpolated. Deterministic. Raises `SlamError` when the parts do not belong together or no
    solution can be found.
    """
    problem = problem_of(estimate, odometry, observations, associations, config)
    solution = minimised(problem.poses, problem.landmarks, problem.factors, config)
    normal = kernels.linearise(solution.poses, solution.landmarks, problem.factors)
    pose_covariances, landmark_covariances = _marginals(normal, problem)
    path, path_covariances = path_between(problem, solution.poses, pose_covariances)
    landmarks = LandmarkMap(problem.landmark_ids, solution.landmarks, landmark_covariances)
    assert estimate.map is not None
    return replace(
        estimate,
        path=path,
        map=_with_histories(estimate.map, landmarks),
        path_covariances=path_covariances,
        provenance={**estimate.provenance, "smoothing": _told(problem, solution, config)},
    )


def _told(problem: Problem, solution: Solution, config: SmoothingConfig) -> dict[str, object]:
    return {
        "config": asdict(config),
        "iterations": solution.iterations,
        "converged": solution.converged,
        "cost_before": kernels.cost(problem.poses, problem.landmarks, problem.factors),
        "cost_after": solution.cost,
        "observations_used": int(problem.factors.node.size),
        "observations_left_out": problem.left_out,
    }


def minimised(
    poses: Floats, landmarks: Floats, factors: kernels.Factors, config: SmoothingConfig
) -> Solution:
    """Where poses (K + 1, 3) and landmarks (n, 2) contradict the factors least, from these on.

    Levenberg-Marquardt: damping falls with every step that lowers the cost, and rises else.
    """
    cost, damping = kernels.cost(poses, landmarks, factors), _FIRST_DAMPING
    for iteration in range(1, config.max_iterations + 1):
        step = _step(kernels.linearise(poses, landmarks, factors), factors, damping)
        if step is None:
            damping *= 10.0
            continue
        moved, placed = poses + step[0], landmarks + step[1]
        moved[:, 2] = wrap(moved[:, 2])
        found = kernels.cost(moved, placed, factors)
        # A step that is short only because it was damped is no sign of rest.
        longest = max(np.abs(step[0]).max(), np.abs(step[1]).max())
        settled = longest < config.tolerance and damping <= _SETTLED_DAMPING
        if found <= cost:
            poses, landmarks, cost = moved, placed, found
            damping = max(0.1 * damping, _LEAST_DAMPING)
        else:
            damping *= 10.0
        if settled:
            return Solution(poses, landmarks, cost, iteration, True)
    return Solution(poses, landmarks, cost, config.max_iterations, False)


def _step(
    normal: kernels.Normal, factors: kernels.Factors, damping: float
) -> tuple[Floats, Floats] | None:
    """The step of all poses (K + 1, 3) and landmarks (n, 2); None if it is not defined."""
    diagonal, below, positive = chain.factor_chain(normal, damping)
    if not positive:
        return None
    S, right = chain.schur(diagonal, below, normal, factors, damping)
    try:
        landmarks = np.linalg.solve(_both_halves(S), right).astype(np.float64)
    except np.linalg.LinAlgError:
        return None
    poses = normal.pose_right[:, :, None] - chain.mixed_product(normal, factors, landmarks[:, None])
    chain.solve_chain(diagonal, below, poses)
    return poses[:, :, 0], landmarks.reshape(-1, 2)


def _marginals(normal: kernels.Normal, problem: Problem) -> tuple[Floats, Floats]:
    """Covariances of the poses (K + 1, 3, 3) and landmarks (n, 2, 2) at the solution.

    With root root^T = S^-1 a pose has its block of T^-1 plus that of (T^-1 B root)(...)^T, B being
    the part between poses and landmarks; columns of it are taken in turn to bound the memory.
    """
    diagonal, below, positive = chain.factor_chain(normal, 0.0)
    S, _ = chain.schur(diagonal, below, normal, problem.factors, 0.0)
    try:
        root = np.linalg.inv(np.linalg.cholesky(_both_halves(S))).T
    except np.linalg.LinAlgError as err:
        raise SlamError(_undetermined(problem)) from err
    if not positive:
        raise SlamError(_undetermined(problem))
    n = problem.landmark_ids.size
    rows = root.reshape(n, 2, 2 * n)
    poses = chain.chain_covariances(diagonal, below)
    for first in range(0, 2 * n, _COLUMNS_AT_ONCE):
        columns = np.ascontiguousarray(root[:, first : first + _COLUMNS_AT_ONCE])
        spread = chain.mixed_product(normal, problem.factors, columns)
        chain.solve_chain(diagonal, below, spread)
        poses += spread @ spread.transpose(0, 2, 1)
    poses[0] = 0.0
    return poses, rows @ rows.transpose(0, 2, 1)


def _both_halves(S: Floats) -> Floats:
    whole: Floats = np.tril(S) + np.tril(S, -1).T
    return whole


def _undetermined(problem: Problem) -> str:
    return (
        f"{problem.factors.node.size} observations do not determine {problem.landmark_ids.size} "
        f"landmarks and {problem.node_ns.size} poses; are the noise parameters extreme?"
    )


def _with_histories(estimated: EstimatedMap, landmarks: LandmarkMap) -> EstimatedMap:
    """The landmarks in the order of the filter's map, with what that tells of each.

    Those that no observation belongs to are left out: nothing would move them with the others.
    """
    kept = np.isin(estimated.landmarks.ids, landmarks.ids)
    ids = estimated.landmarks.ids[kept]
    order = np.argsort(landmarks.ids)[np.searchsorted(np.sort(landmarks.ids), ids)]
    assert landmarks.covariances is not None
    return EstimatedMap(
        LandmarkMap(ids, landmarks.positions[order], landmarks.covariances[order]),
        t_added_ns=_rows(estimated.t_added_ns, kept),
        added_from=_rows(estimated.added_from, kept),
        range_added_m=_rows(estimated.range_added_m, kept),
        n_seen=_rows(estimated.n_seen, kept),
        t_first_ns=_rows(estimated.t_first_ns, kept),
    )


def _rows(
    column: npt.NDArray[_Number] | None, kept: npt.NDArray[np.bool_]
) -> npt.NDArray[_Number] | None:
    return None if column is None else column[kept]
