"""What a smoother remembers: every motion and every sighting, and where the car was at each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.config import ObservationNoise
from slam.motion import propagate
from slam.smoothing.kernels import Factors
from slam.smoothing.problem import LOSSES, motion_information, sight_information

Names = npt.NDArray[np.int64]


class History:
    """Poses, the first of them the start, and the motion from each to the next.

    A pose is kept for every scan that has seen a landmark; motions without one are added up.
    """

    def __init__(self, motion_noise: Floats) -> None:
        self._noise = motion_noise
        self._moved, self._spread = np.zeros(3), np.zeros((3, 3))
        self._motions: list[Floats] = []
        self._spreads: list[Floats] = []
        self._poses: list[Floats] = [np.zeros(3)]
        self._node: list[Names] = []
        self._name: list[Names] = []
        self._range_m: list[Floats] = []
        self._bearing_rad: list[Floats] = []

    @property
    def poses(self) -> Floats:
        """(K + 1, 3)."""
        return np.array(self._poses)

    def drive(self, increments: Floats, dt_s: Floats) -> None:
        """The car moved by increments (k, 3) over dt_s (k,)."""
        k = len(increments)
        propagate(
            self._moved, self._spread, increments, dt_s, self._noise,
            np.empty((k, 3)), np.empty((k, 3, 3)),
        )  # fmt: skip

    def see(self, pose: Floats, names: Names, range_m: Floats, bearing_rad: Floats) -> bool:
        """Take the sightings (m,) of the landmarks so called, -1 of none; whether there was one.

        pose : where the car is believed to be.
        """
        used = names >= 0
        if not used.any():
            return False
        self._motions.append(self._moved.copy())
        self._spreads.append(self._spread.copy())
        self._moved[:], self._spread[:] = 0.0, 0.0
        self._poses.append(pose)
        self._node.append(np.full(int(used.sum()), len(self._motions), dtype=np.int64))
        self._name.append(names[used])
        self._range_m.append(range_m[used])
        self._bearing_rad.append(bearing_rad[used])
        return True

    def correct(self, poses: Floats) -> None:
        """Believe that the car was at these poses (K + 1, 3)."""
        self._poses = list(poses)

    def factors(
        self, alive: Names, noise: ObservationNoise, loss: str, loss_scale: float
    ) -> tuple[Factors, Names]:
        """What is known, and the landmarks (n,) in the order of their slots, that of appearance.

        alive : the landmarks that have not been given up; sightings of others are forgotten.
        """
        name = np.concatenate(self._name)
        kept = np.isin(name, alive)
        name, range_m = name[kept], np.concatenate(self._range_m)[kept]
        found, first, slot = np.unique(name, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.empty(order.size, dtype=np.int64)
        rank[order] = np.arange(order.size)
        factors = Factors(
            np.array(self._motions),
            motion_information(np.array(self._spreads)),
            np.concatenate(self._node)[kept],
            rank[slot.reshape(-1)],
            range_m,
            np.concatenate(self._bearing_rad)[kept],
            sight_information(range_m, noise),
            LOSSES[loss],
            loss_scale,
        )
        return factors, found[order]
