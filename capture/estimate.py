"""What algorithms give and what scoring takes: a path, a map, and how they were made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from geometry import Floats, LandmarkMap, Stamps, Trajectory

NO_STAMP = np.iinfo(np.int64).min


@dataclass(frozen=True, eq=False)
class EstimatedMap:
    """Landmarks of an estimate and how each entered the map; all columns in the order of the ids.

    t_added_ns : (n,) when the landmark that survived entered the map;
    added_from : (n, 2) where the car then stood, in the frame of the estimate;
    range_added_m : (n,) how far the landmark was then estimated to be;
    n_seen : (n,) observations that went into it;
    t_first_ns : (n,) when any landmark first stood at this place (before deletions).
    None where the estimate does not say; a single unknown value is `NO_STAMP` or NaN.
    """

    landmarks: LandmarkMap
    t_added_ns: Stamps | None = None
    added_from: Floats | None = None
    range_added_m: Floats | None = None
    n_seen: npt.NDArray[np.int64] | None = None
    t_first_ns: Stamps | None = None

    def __len__(self) -> int:
        return len(self.landmarks)


@dataclass(frozen=True, eq=False)
class Estimate:
    """What one algorithm made of one session, in its own frame `map`.

    path_covariances : (n, 3, 3) of x, y, heading at each pose, or None;
    provenance : every choice that made it (algorithm, preset, configuration, seed, version).
    """

    name: str
    path: Trajectory
    map: EstimatedMap | None = None
    path_covariances: Floats | None = None
    provenance: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Where the car and the landmarks really were, in the frame `world`.

    path_covariances : (n, 3, 3) of x, y, heading at each pose, or None where nothing is claimed;
    bridged : (n,) poses that were not measured but bridged over, or None where that is not told.
    """

    path: Trajectory
    landmarks: LandmarkMap | None = None
    provenance: Mapping[str, object] = field(default_factory=dict)
    path_covariances: Floats | None = None
    bridged: npt.NDArray[np.bool_] | None = None
