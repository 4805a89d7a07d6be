"""A smoother with the interface of a filter: a filter runs ahead, the whole past is solved anew."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.errors import SlamError
from slam.gaussian.filter import GAUSSIAN_ASSOCIATIONS, UkfSlam
from slam.interface import Algorithm, UpdateReport
from slam.smoother.config import SMOOTHER_PRESETS, SmootherConfig
from slam.smoother.history import History
from slam.smoothing import chain
from slam.smoothing.kernels import Factors, Normal, linearise
from slam.smoothing.smoother import minimised

_COLUMNS_AT_ONCE = 64


class SmootherSlam(UkfSlam):
    """All poses and landmarks that fit all data best, solved whenever enough has come since.

    In between UKF-SLAM, the most consistent of the filters (benchmarks/algorithms.py), goes on from
    the last solution: it associates, places new landmarks, gives up others, and tells the pose. A
    solution becomes its state, with the covariance of the last pose and all landmarks; so what has
    been linearised badly is linearised again. What was once associated stays so, but a robust loss
    lets go of what does not fit (Dellaert and Kaess, IJRR 25, 2006, for the whole;
    `slam.smoothing` for the solution).
    """

    def __init__(self, config: SmootherConfig, association: str) -> None:
        super().__init__(config, association)
        self._smoothing = config.smoothing()
        self._every, self._growth = config.solve_every, config.solve_growth
        self._history = History(self._motion_noise)
        self._scans, self._solved_at = 0, 0

    def predict(self, increments: Floats, dt_s: Floats) -> tuple[Floats, Floats]:
        """Move by increments (k, 3) over dt_s (k,): poses (k, 3), covariances (k, 3, 3)."""
        self._history.drive(increments, dt_s)
        return super().predict(increments, dt_s)

    def update(
        self, t_ns: int, landmark_id: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        """Take one scan's observations (m,), and solve all if it is time.

        Raises `SlamError` when a covariance has broken down numerically.
        """
        report = super().update(t_ns, landmark_id, range_m, bearing_rad)
        m = self.names.size
        if self._history.see(self.pose, self.names, range_m[:m], bearing_rad[:m]):
            self._scans += 1
            since = self._scans - self._solved_at
            if since >= max(self._every, self._growth * self._solved_at):
                self._solve()
                self._solved_at = self._scans
        return report

    def _solve(self) -> None:
        """Make the solution over everything the state."""
        config, names = self._smoothing, self._records["landmark_id"][: self._n]
        factors, order = self._history.factors(
            names, config.observation, config.loss, config.loss_scale
        )
        if order.size == 0:
            return
        slots = np.argsort(names)[np.searchsorted(np.sort(names), order)]
        columns = (3 + 2 * slots[:, None] + np.arange(2)).ravel()
        solution = minimised(self._history.poses, self._x[columns].reshape(-1, 2), factors, config)
        self._history.correct(solution.poses)
        P = joint_covariance(linearise(solution.poses, solution.landmarks, factors), factors)
        state = np.concatenate([[0, 1, 2], columns])
        self._x[state] = np.concatenate([solution.poses[-1], solution.landmarks.ravel()])
        self._P[np.ix_(state, state)] = P


def joint_covariance(normal: Normal, factors: Factors) -> Floats:
    """(3 + 2n, 3 + 2n): of the last pose and all landmarks, given the normal equations.

    With S^-1 that of the landmarks, and X (`rows`) the rows of T^-1 B of the last pose, B being the
    part between poses and landmarks: the pose has its block of T^-1, plus X S^-1 X^T. Raises
    `SlamError` when the equations do not determine them.
    """
    diagonal, below, positive = chain.factor_chain(normal, 0.0)
    lower, _ = chain.schur(diagonal, below, normal, factors, 0.0)
    n = lower.shape[0]
    rows = np.empty((3, n))
    for first in range(0, n, _COLUMNS_AT_ONCE):
        some = slice(first, first + _COLUMNS_AT_ONCE)
        columns = np.ascontiguousarray(np.eye(n)[:, some])
        solved = chain.mixed_product(normal, factors, columns)
        chain.solve_chain(diagonal, below, solved)
        rows[:, some] = solved[-1]
    try:
        root = np.linalg.inv(np.linalg.cholesky(lower + np.tril(lower, -1).T))
    except np.linalg.LinAlgError as err:
        raise SlamError(_undetermined(normal)) from err
    if not positive:
        raise SlamError(_undetermined(normal))
    of_pose = np.linalg.inv(np.tril(diagonal[-1]))
    spread = root @ rows.T
    P = np.empty((3 + n, 3 + n))
    P[:3, :3] = of_pose.T @ of_pose + spread.T @ spread
    P[3:, 3:] = root.T @ root
    P[3:, :3] = -root.T @ spread
    P[:3, 3:] = P[3:, :3].T
    return P


def _undetermined(normal: Normal) -> str:
    return (
        f"the observations do not determine {normal.landmark.shape[0]} landmarks and "
        f"{normal.diagonal.shape[0]} poses; are the noise parameters extreme?"
    )


SMOOTHER = Algorithm(
    SMOOTHER_PRESETS, GAUSSIAN_ASSOCIATIONS, lambda config, words, _: SmootherSlam(config, words)
)
