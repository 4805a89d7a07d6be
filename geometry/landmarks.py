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
        positions = frozen(self.positions, np.float64)
        # An empty list has no second axis, but is a fine list of no positions.
        positions = positions if positions.size else positions.reshape(0, 2)
        object.__setattr__(self, "positions", positions)
        if self.covariances is not None:
            object.__setattr__(self, "covariances", frozen(self.covariances, np.float64))
        self._check()

    def _check(self) -> None:
        n = self.ids.size
        if self.ids.shape != (n,) or self.positions.shape != (n, 2):
            raise LandmarkMapError(
                f"ids have shape {self.ids.shape} and positions {self.positions.shape}, "
                "expected (n,) and (n, 2)"
            )
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
        finite = np.isfinite(covariances)
        values = np.where(finite, covariances, 0.0)
        size = np.abs(values).max(axis=(1, 2))
        skew = np.abs(values[:, 0, 1] - values[:, 1, 0])
        # A rank-one covariance may round to just below zero.
        negative = np.linalg.eigvalsh(values)[:, 0] < -1e-9 * size
        bad = np.flatnonzero(~finite.all(axis=(1, 2)) | (skew > 1e-6 * size) | negative)
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
