"""Set distances and rates of an aligned map against the true one.

All three set distances charge the same matrix of distances d_ij between n true and m estimated
landmarks, cut off at c, in the order p; they differ in what a missing landmark costs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry import Floats, LandmarkMap
from scoring.assignment import NearPairs, cheapest_matching, near_pairs
from scoring.options import ScoreOptions
from scoring.path_metrics import consistency, normalised_squares

MAP_METRICS = (
    "ospa",
    "cola",
    "gospa",
    "gospa_localisation",
    "gospa_missed",
    "gospa_false",
    "precision",
    "recall",
    "f1",
    "missed_share",
    "map_rmse",
    "map_nees",
    "map_nees_within",
)


@dataclass(frozen=True)
class Gospa:
    """GOSPA in metres and the three sums it is the p-th root of, in metres to the power p."""

    distance: float
    localisation: float
    missed: float
    false: float


def ospa(truth: Floats, estimate: Floats, cutoff_m: float, order: float) -> float:
    """OSPA in metres: the mean cost over the larger set; 0 for two empty sets.

    ((min sum min(d, c)^p + c^p (n - m)) / n)^(1/p), n the larger count.
    Schuhmacher, Vo, Vo, IEEE Trans. Signal Processing 56 (2008), Eq. 3.
    """
    larger = max(len(truth), len(estimate))
    if larger == 0:
        return 0.0
    mean = _saturated_sum(truth, estimate, cutoff_m, order) / larger
    return math.pow(mean, 1.0 / order)


def cola(truth: Floats, estimate: Floats, cutoff_m: float, order: float) -> float:
    """COLA: the same cost, neither divided nor in metres but in missing landmarks.

    (1/c) (min sum min(d, c)^p + c^p |n - m|)^(1/p). Barrios, Adams, Leung, Inostroza, Naqvi,
    Orchard, "Metrics for evaluating feature-based mapping performance", IEEE T-RO 33 (2017).
    """
    return math.pow(_saturated_sum(truth, estimate, cutoff_m, order), 1.0 / order) / cutoff_m


def _saturated_sum(truth: Floats, estimate: Floats, cutoff_m: float, order: float) -> float:
    """The least sum of min(d, c)^p plus c^p |n - m|: what is not paired costs c^p once."""
    pairs = _cheapest(truth, estimate, cutoff_m, order)
    unpaired = max(len(truth), len(estimate)) - len(pairs)
    return float(_powers(pairs, cutoff_m, order).sum()) + math.pow(cutoff_m, order) * unpaired


def gospa(truth: Floats, estimate: Floats, cutoff_m: float, order: float) -> Gospa:
    """GOSPA with alpha = 2: a missed and a false landmark cost c^p / 2 each.

    Rahmathullah, Garcia-Fernandez, Svensson, FUSION 2017, Eq. 1 and Prop. 1.
    """
    pairs = _cheapest(truth, estimate, cutoff_m, order)
    each = math.pow(cutoff_m, order) / 2.0
    localisation = float(_powers(pairs, cutoff_m, order).sum())
    missed = each * (len(truth) - len(pairs))
    false = each * (len(estimate) - len(pairs))
    distance = math.pow(localisation + missed + false, 1.0 / order)
    return Gospa(distance, localisation, missed, false)


def _cheapest(truth: Floats, estimate: Floats, cutoff_m: float, order: float) -> NearPairs:
    near = near_pairs(truth, estimate, cutoff_m)
    return cheapest_matching(near, _powers(near, cutoff_m, order), math.pow(cutoff_m, order))


def _powers(near: NearPairs, cutoff_m: float, order: float) -> Floats:
    powers: Floats = np.minimum(near.distance_m, cutoff_m) ** order
    return powers


def map_metrics(
    truth: LandmarkMap, estimate: LandmarkMap, pairs: NearPairs, options: ScoreOptions
) -> dict[str, float | None]:
    """All of `MAP_METRICS`; a rate over nothing is None.

    `precision`, `recall`, `f1`, `missed_share` (missed per true landmark), `map_rmse` and the NEES
    follow the pairs of the score, the set distances their own least cost.
    """
    n, m, q = len(truth), len(estimate), len(pairs)
    true_xy, xy, order = truth.positions, estimate.positions, options.metric_order
    parts = gospa(true_xy, xy, options.gospa_cutoff, order)
    squares = pairs.distance_m**2
    return {
        "ospa": ospa(true_xy, xy, options.ospa_cutoff, order),
        "cola": cola(true_xy, xy, options.ospa_cutoff, order),
        "gospa": parts.distance,
        "gospa_localisation": parts.localisation,
        "gospa_missed": parts.missed,
        "gospa_false": parts.false,
        "precision": q / m if m else None,
        "recall": q / n if n else None,
        "f1": 2 * q / (n + m) if n + m else None,
        "missed_share": (n - q) / n if n else None,
        "map_rmse": float(np.sqrt(squares.mean())) if q else None,
        **_map_consistency(truth, estimate, pairs),
    }


def _map_consistency(
    truth: LandmarkMap, estimate: LandmarkMap, pairs: NearPairs
) -> dict[str, float | None]:
    if estimate.covariances is None:
        return consistency("map", np.zeros(0), 2)
    errors = estimate.positions[pairs.columns] - truth.positions[pairs.rows]
    nees = normalised_squares(errors, estimate.covariances[pairs.columns])
    return consistency("map", nees, 2)
