"""Which estimated landmark is taken for which true one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from geometry import Floats
from scoring.assignment import (
    ROUNDING_M,
    NearPairs,
    cheapest_matching,
    least_total_distance,
    near_pairs,
)


def pair_landmarks(truth: Floats, estimate: Floats, rule: str, cutoff_m: float) -> NearPairs:
    """Pairs of true (n, 2) and estimated (m, 2) positions, one to one, ordered by row of truth.

    A pair is at most `cutoff_m` apart, the cut-off included. Rules:
    saturated: least sum of min(distance, cut-off), the OSPA cost (Schuhmacher et al. 2008);
    max-pairs: as many pairs as there can be, then the least sum of their distances;
    assign-then-cut: least sum of all distances, as if there were no cut-off, then cut;
    greedy: the nearest pair first. Ties go to more pairs, then to the lower row.
    """
    if rule == "assign-then-cut":
        every = least_total_distance(truth, estimate)
        return every.selected(np.flatnonzero(every.distance_m <= cutoff_m + ROUNDING_M))
    near = near_pairs(truth, estimate, cutoff_m)
    if rule == "greedy":
        return near.selected(_greedy(near))
    # Leaving one pair out costs more than any rearrangement of the others can save.
    skipping = cutoff_m if rule == "saturated" else cutoff_m * (len(truth) + 1)
    return cheapest_matching(near, np.minimum(near.distance_m, cutoff_m), skipping)


def _greedy(near: NearPairs) -> npt.NDArray[np.int64]:
    taken_rows: set[int] = set()
    taken_columns: set[int] = set()
    chosen: list[int] = []
    for index in np.argsort(near.distance_m, kind="stable").tolist():
        row, column = int(near.rows[index]), int(near.columns[index])
        if row not in taken_rows and column not in taken_columns:
            taken_rows.add(row)
            taken_columns.add(column)
            chosen.append(index)
    return np.array(sorted(chosen), dtype=np.int64)
