"""What every SLAM algorithm offers, so that `slam.run` and live use need not know which it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from capture import EstimatedMap
from geometry import Floats
from slam.config import MotionNoise, ObservationNoise


@dataclass(frozen=True)
class UpdateReport:
    """What became of the observations of one scan.

    invalid : no finite bearing, or no finite range above zero; over_limit : the scan or the map was
    full; removed : landmarks given up; cut_short : 1 where a search ended at its limit.
    """

    matched: int = 0
    added: int = 0
    ignored: int = 0
    rejected: int = 0
    invalid: int = 0
    over_limit: int = 0
    removed: int = 0
    cut_short: int = 0

    def __add__(self, other: UpdateReport) -> UpdateReport:
        return UpdateReport(
            self.matched + other.matched,
            self.added + other.added,
            self.ignored + other.ignored,
            self.rejected + other.rejected,
            self.invalid + other.invalid,
            self.over_limit + other.over_limit,
            self.removed + other.removed,
            self.cut_short + other.cut_short,
        )


class Slam(Protocol):
    """A filter over the pose of the car and the landmarks, both in the frame `map`."""

    def predict(self, increments: Floats, dt_s: Floats) -> tuple[Floats, Floats]:
        """Move by odometry increments (k, 3), each `pose_before_after`, taken over dt_s (k,).

        Gives the poses (k, 3) after each and their covariances (k, 3, 3).
        """

    def update(
        self, t_ns: int, landmark_id: npt.NDArray[np.int64], range_m: Floats, bearing_rad: Floats
    ) -> UpdateReport:
        """Take the observations of one scan, each (m,); id -1 where the sensor does not know."""

    @property
    def pose(self) -> Floats:
        """(3,): x, y, heading of the car."""

    @property
    def pose_covariance(self) -> Floats:
        """(3, 3)."""

    def estimated_map(self) -> EstimatedMap:
        """The landmarks as they stand now."""


class Configuration(Protocol):
    """What the configurations of all algorithms have: frozen dataclasses with at least these."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # as typeshed has it for any dataclass

    @property
    def motion(self) -> MotionNoise:
        """How wrong an odometry increment can be."""

    @property
    def observation(self) -> ObservationNoise:
        """How wrong a sighting can be."""

    @property
    def accept_gate(self) -> float:
        """Squared Mahalanobis distance up to which a sighting may be of a landmark."""

    @property
    def spawn_gate(self) -> float:
        """Squared Mahalanobis distance beyond which a sighting is of a new landmark."""

    @property
    def path_period_s(self) -> float:
        """How often the path holds a pose between scans; 0 keeps every odometry sample."""


_Config = TypeVar("_Config", bound=Configuration)


@dataclass(frozen=True)
class Algorithm(Generic[_Config]):
    """How an algorithm is configured and made.

    presets : configurations by name; associations : the rules it knows, "known" first, then the one
    to take where the sensor does not name its landmarks; make : from configuration, association
    and seed.
    """

    presets: Mapping[str, _Config]
    associations: tuple[str, ...]
    make: Callable[[_Config, str, int], Slam]
