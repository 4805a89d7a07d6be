"""One scan, the rules and the working memory, as the inner loops of FastSLAM take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import kernel

NEW = -1
IGNORED = -2
REJECTED = -3
REFUSED = -4
Decisions = npt.NDArray[np.int32]


class Scan(NamedTuple):
    """One scan as the kernels take it, each (m,).

    cos, sin : of the bearing; var_along, var_across : m2, along the line of sight and across it;
    log_peak : log density per m and rad of an exact hit on a landmark known exactly; likely :
    squared distance, plus log(det S / det R), up to which a landmark is likelier than a new one;
    widest : squared distance that matters at all; gain : what a sighting is worth as evidence, from
    `slam.landmarks.gain` for a log-likelihood of 0.
    """

    cos: Floats
    sin: Floats
    range_m: Floats
    var_along: Floats
    var_across: Floats
    log_peak: Floats
    likely: Floats
    widest: Floats
    gain: Floats


class Rules(NamedTuple):
    """The thresholds of `FastSlamConfig`, and how far to look for landmarks.

    landmarks : from `slam.landmarks.rules_array`; eye, next_eye : from `slam.eyesight.new_eye`, as
    known before the scan and as learnt from it; observer : the particle whose landmarks teach it.
    """

    accept: float
    spawn: float
    innovation: float
    tail: float
    log_new: float
    reach_m: float
    landmarks: Floats
    eye: Floats
    next_eye: Floats
    observer: int
    max_landmarks: int


class Scratch(NamedTuple):
    """Working memory for one particle, so that the loop over particles allocates nothing.

    place : (m, 5) where the particle sees each observation, x, y and covariance xx, xy, yy;
    near : (K,) landmarks within reach; x, y, trace : (K,) where they are and how certain;
    square_m2 : (K,) how far from the car; busy : (K,) seen in this scan; possible : (K,) those of
    `near` that one observation may be of; pair_observation, pair_landmark, pair_distance,
    pair_ratio : (m K,) what may belong together.
    """

    place: Floats
    near: npt.NDArray[np.int64]
    x: Floats
    y: Floats
    trace: Floats
    square_m2: Floats
    busy: npt.NDArray[np.bool_]
    possible: npt.NDArray[np.int64]
    pair_observation: npt.NDArray[np.int64]
    pair_landmark: npt.NDArray[np.int64]
    pair_distance: Floats
    pair_ratio: Floats


def new_scratch(observations: int, landmarks: int) -> Scratch:
    """Room for particles of up to `landmarks` landmarks and scans of up to `observations`."""
    m, k = observations * landmarks, landmarks
    return Scratch(
        place=np.empty((observations, 5)),
        near=np.empty(k, np.int64),
        x=np.empty(k),
        y=np.empty(k),
        trace=np.empty(k),
        square_m2=np.empty(k),
        busy=np.empty(k, np.bool_),
        possible=np.empty(k, np.int64),
        pair_observation=np.empty(m, np.int64),
        pair_landmark=np.empty(m, np.int64),
        pair_distance=np.empty(m),
        pair_ratio=np.empty(m),
    )


@kernel
def squared_distance(dx: float, dy: float, xx: float, xy: float, yy: float) -> tuple[float, float]:
    """Squared Mahalanobis distance of (dx, dy) under the covariance, and its determinant."""
    determinant = xx * yy - xy * xy
    return (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / determinant, determinant
