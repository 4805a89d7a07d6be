"""What EKF-SLAM with first-estimate Jacobians and UKF-SLAM share, and each of the two."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam import ekf_kernels
from slam.association import nearest_compatible, squared_distances
from slam.config import PRESETS, EkfConfig
from slam.ekf import EkfSlam
from slam.gaussian import kernels, sights
from slam.interface import Algorithm, UpdateReport
from slam.landmarks import Slots

GAUSSIAN_ASSOCIATIONS = ("known", "nearest")


class GaussianSlam(EkfSlam, ABC):
    """EKF-SLAM in all but how it linearises: subclasses say what a sight is.

    names : (m,) after an update, the landmark that each of its observations went into, -1 none.
    """

    names: npt.NDArray[np.int64] = np.empty(0, dtype=np.int64)
    _by_sigma = False

    @abstractmethod
    def _sights(self) -> Floats:
        """(n, 11), see `slam.gaussian.sights`."""

    def _corrected(self, before: Floats) -> None:
        """Called when an update has moved the state from `before` (3 + 2n,)."""

    def _entered(self, slots: Slots) -> None:
        """Called when these slots hold a landmark they did not hold before."""

    def _update_named(
        self, t_ns: int, ids: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        seen = self._sights()
        due = sights.expectations(self._P, seen)
        slots = ekf_kernels.named_slots(self._records, self._n, ids)
        return self._absorb(t_ns, slots, seen, due, ids, range_m, bearing_rad)

    def _update_unnamed(
        self, t_ns: int, ids: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        config, seen = self.config, self._sights()
        due = sights.expectations(self._P, seen)
        distances = squared_distances(due, range_m, bearing_rad, self._noise)
        slots = nearest_compatible(distances, config.accept_gate, config.spawn_gate)
        report = self._absorb(t_ns, slots, seen, due, ids, range_m, bearing_rad, self._next_id)
        self._next_id += report.added
        removed = self._give_up(slots, due, distances, range_m, bearing_rad)
        return dataclasses.replace(report, removed=removed) if removed else report

    def _absorb(
        self, t_ns: int, slots: Slots, seen: Floats, due: Floats, ids: npt.NDArray[np.int64],
        range_m: Floats, bearing_rad: Floats, next_id: int = 0,
    ) -> UpdateReport:  # fmt: skip
        """Take one scan; `slots` becomes what each observation went to."""
        before = self._x[: 3 + 2 * self._n].copy()
        matched, against, invalid = kernels.take(
            self._x, self._P, self._records, self._n, slots, seen, due, range_m, bearing_rad,
            self._noise, self._limits,
        )  # fmt: skip
        self._corrected(before)
        heading = float(self._x[2])
        places = sights.placings(heading, range_m, bearing_rad, self._noise, self._by_sigma)
        added, over_limit, entered = kernels.enter(
            self._x, self._P, self._records, self._n, slots, against, ids, range_m, places, t_ns,
            self._limits, next_id,
        )  # fmt: skip
        self._entered(entered)
        counts = matched, added, against.size, invalid, over_limit
        report = self._report(counts, slots.size)
        called = self._records["landmark_id"][np.maximum(slots, 0)]
        self.names = np.where(slots >= 0, called, -1)
        return report


class FejSlam(GaussianSlam):
    """EKF-SLAM with first-estimate Jacobians.

    An EKF that linearises the same landmark and pose at ever new estimates believes to learn its
    heading in the map from nothing but that. Here derivatives are those at the first estimate of
    each: of a pose the predicted one, of a landmark where it entered the map (Huang, Mourikis,
    Roumeliotis, IJRR 29, 2010). In doing so, turning and moving car and map together changes no
    expected observation, so that no observation seems to tell of it.

    P is kept as that of errors about the estimate: after an update the error of the place is
    told anew, for the pose it now has, which is what the next prediction would else have to do.
    """

    def __init__(self, config: EkfConfig, association: str, capacity: int = 32) -> None:
        super().__init__(config, association, capacity)
        self._first = self._x.copy()

    def _sights(self) -> Floats:
        return sights.first_estimate_sights(self._x, self._first, self._n)

    def _corrected(self, before: Floats) -> None:
        east, north = float(self._x[0] - before[0]), float(self._x[1] - before[1])
        kernels.carry(self._P, 3 + 2 * self._n, -north, east)

    def _entered(self, slots: Slots) -> None:
        for axis in range(2):
            self._first[3 + axis + 2 * slots] = self._x[3 + axis + 2 * slots]

    def _remove(self, slot: int) -> None:
        last = 3 + 2 * (self._n - 1)
        self._first[3 + 2 * slot : 5 + 2 * slot] = self._first[last : last + 2]
        super()._remove(slot)

    def _grow(self, needed: int) -> None:
        super()._grow(needed)
        first = np.zeros(self._x.size)
        first[: self._first.size] = self._first
        self._first = first


class UkfSlam(GaussianSlam):
    """UKF-SLAM: sigma points instead of derivatives, with n + kappa = 3.

    Points are laid over what the equations bend: where a landmark is from the car when it is seen,
    range and bearing when it is new. All else is linear, where points over the whole state do the
    same; so an update costs what that of the EKF costs, and no square root of P. Turns are taken
    from the middle point and wrapped.

    Errors are told as the invariant EKF tells them, so that doubt in the heading turns the car and
    all that it has mapped together (Barrau, Bonnabel, arXiv 1510.06263, 2015; with sigma points:
    Brossard, Barrau, Bonnabel, ICRA 2020). Then driving is linear, too, and the heading is not
    learnt from observations that cannot tell it; points over x, y and heading learn it like an EKF.
    """

    _by_sigma = True

    def _sights(self) -> Floats:
        return sights.sigma_sights(self._x, self._P, self._n)

    def _corrected(self, before: Floats) -> None:
        kernels.retell(self._P, 3 + 2 * self._n, self._x, before)


FEJ = Algorithm(PRESETS, GAUSSIAN_ASSOCIATIONS, lambda config, words, _: FejSlam(config, words))
UKF = Algorithm(PRESETS, GAUSSIAN_ASSOCIATIONS, lambda config, words, _: UkfSlam(config, words))
