"""A map of point landmarks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from geometry.angles import Floats
from geometry.errors import LandmarkMapError
from geometry.se2 import rotate_covariance, transform_points
from geometry.trajectory import frozen


@dataclass(frozen=True, eq=False)
class LandmarkMap:
    """Landmarks by id.

    ids : (n,) int64, each once; positions : (n, 2) metres;
    covariances : (n, 2, 2) square metres, or None where nothing is claimed. n = 0 is a map, too.
    Raises `LandmarkMapError` when that does not hold.
    """

    ids: npt.NDArray[np.int64]
    positions: Floats
    covariances: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", frozen(self.ids, np.int64))
        positions = frozen(np.asarray(self.positions, dtype=np.float64).reshape(-1, 2), np.float64)
        object.__setattr__(self, "positions", positions)
        if self.covariances is not None:
            object.__setattr__(self, "covariances", frozen(self.covariances, np.float64))
        self._check()

    def _check(self) -> None:
        n = self.ids.size
        if self.positions.shape != (n, 2):
            raise LandmarkMapError(f"{self.positions.shape[0]} positions for {n} ids")
        values, counts = np.unique(self.ids, return_counts=True)
        if np.any(counts > 1):
            twice = ", ".join(str(i) for i in values[counts > 1][:5])
            raise LandmarkMapError(f"landmark ids must be unique; more than once: {twice}")
        bad = np.flatnonzero(~np.isfinite(self.positions).all(axis=1))
        if bad.size:
            raise LandmarkMapError(f"the position of landmark {self.ids[bad[0]]} is not finite")
        if self.covariances is not None:
            if self.covariances.shape != (n, 2, 2):
                raise LandmarkMapError(
                    f"covariances have shape {self.covariances.shape}, expected ({n}, 2, 2)"
                )
            self._check_covariances(self.covariances)

    def _check_covariances(self, covariances: Floats) -> None:
        symmetric = np.isclose(covariances[:, 0, 1], covariances[:, 1, 0], rtol=1e-6, atol=1e-12)
        trace = covariances[:, 0, 0] + covariances[:, 1, 1]
        determinant = (
            covariances[:, 0, 0] * covariances[:, 1, 1]
            - covariances[:, 0, 1] * covariances[:, 1, 0]
        )
        # "not (>=)" catches NaN as well; a rank-one covariance may round to just below zero.
        bad = np.flatnonzero(~(symmetric & (trace >= 0) & (determinant >= -1e-9 * trace**2)))
        if bad.size:
            raise LandmarkMapError(
                f"the covariance of landmark {self.ids[bad[0]]} is not a covariance matrix: "
                f"{covariances[bad[0]].tolist()}"
            )

    def __len__(self) -> int:
        return int(self.ids.size)

    def transformed(self, pose_a_b: Floats) -> LandmarkMap:
        """The map, given in b, expressed in a; covariances turn with it."""
        covariances = self.covariances
        if covariances is not None:
            covariances = rotate_covariance(float(pose_a_b[2]), covariances)
        return LandmarkMap(self.ids, transform_points(pose_a_b, self.positions), covariances)
