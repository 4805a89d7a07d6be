"""One-to-one assignment of least cost between two sets of points.

A cut-off makes the problem sparse: only near points can meet. The solver works on those pairs
alone, exactly, in plain Python: a map of 20 landmarks is done long before scipy were imported.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
import numpy.typing as npt

from geometry import Floats

Rows = npt.NDArray[np.int64]

ROUNDING_M = 1e-9
"""Points at the cut-off are within it: a rigid motion must not undo that by rounding."""

DENSE_LIMIT = 1_000_000
"""Entries of the largest distance table; larger maps are searched with scipy's KD-tree."""

PLAIN_LIMIT = 64 * 64
"""Near pairs, beyond which a table that is mostly near is left to scipy's dense solver."""

_TIE = 1e-9
"""Share of the cost of skipping within which two matchings count as equal."""


@dataclass(frozen=True, eq=False)
class NearPairs:
    """All pairs of points within the cut-off, ordered by row and column.

    rows, columns : (k,) which point of the first and of the second set; distance_m : (k,).
    """

    rows: Rows
    columns: Rows
    distance_m: Floats

    def __len__(self) -> int:
        return int(self.rows.size)

    def selected(self, which: Rows) -> NearPairs:
        """The pairs `which` (j,)."""
        return NearPairs(self.rows[which], self.columns[which], self.distance_m[which])


def squared_distances(first: Floats, second: Floats) -> Floats:
    """(n, m) square metres between points (n, d) and (m, d)."""
    squares: Floats = np.zeros((first.shape[0], second.shape[0]))
    for axis in range(first.shape[1]):
        squares += np.subtract.outer(first[:, axis], second[:, axis]) ** 2
    return squares


def near_pairs(first: Floats, second: Floats, cutoff_m: float) -> NearPairs:
    """Every pair of points (n, d), (m, d) at most `cutoff_m` apart."""
    reach = cutoff_m + ROUNDING_M
    if first.shape[0] * second.shape[0] > DENSE_LIMIT:
        from scipy.spatial import KDTree

        found = KDTree(first).sparse_distance_matrix(KDTree(second), reach, output_type="ndarray")
        found = found[np.lexsort((found["j"], found["i"]))]
        return NearPairs(found["i"], found["j"], found["v"])
    squares = squared_distances(first, second).ravel()
    hits = np.flatnonzero(squares <= reach**2)
    rows, columns = np.divmod(hits, max(second.shape[0], 1))
    return NearPairs(rows, columns, np.sqrt(squares[hits]))


def cheapest_matching(near: NearPairs, cost: Floats, skipping: float) -> NearPairs:
    """The one-to-one subset with the least sum of `cost` (k,) plus `skipping` per row left out.

    Costs are at least 0 and at most `skipping`, which may be infinite if every row can be served.
    Of two subsets that cost the same the one with more pairs is taken, then the lower columns.
    """
    if len(near) > PLAIN_LIMIT and _mostly_near(near):
        return near.selected(_dense(near, cost, skipping))
    matching = _Matching(near, cost, skipping)
    for row in sorted(set(near.rows.tolist())):
        matching.place(row)
    return near.selected(np.array(sorted(matching.pair_of_row.values()), dtype=np.int64))


def least_total_distance(first: Floats, second: Floats) -> NearPairs:
    """Points (n, d), (m, d) paired without a cut-off: every point of the smaller set."""
    if first.shape[0] > second.shape[0]:
        turned = least_total_distance(second, first)
        order = np.argsort(turned.columns)
        return NearPairs(turned.columns, turned.rows, turned.distance_m).selected(order)
    squares = squared_distances(first, second)
    rows, columns = np.indices(squares.shape).reshape(2, -1)
    every = NearPairs(rows, columns, np.sqrt(squares.ravel()))
    return cheapest_matching(every, every.distance_m, np.inf)


def _mostly_near(near: NearPairs) -> bool:
    return len(near) > np.unique(near.rows).size * np.unique(near.columns).size // 8


def _dense(near: NearPairs, cost: Floats, skipping: float) -> Rows:
    """Indices of the chosen pairs, solved as a full table in which a far pair costs `skipping`."""
    from scipy.optimize import linear_sum_assignment

    row_ids, rows = np.unique(near.rows, return_inverse=True)
    column_ids, columns = np.unique(near.columns, return_inverse=True)
    table = np.full((row_ids.size, column_ids.size), skipping * (1.0 + _TIE))
    which = np.full(table.shape, -1)
    table[rows, columns] = cost
    which[rows, columns] = np.arange(cost.size)
    picked = which[linear_sum_assignment(table)]
    return np.sort(picked[picked >= 0])


class _Matching:
    """A matching that is cheapest for the rows placed so far, with the prices that prove it.

    Each row in turn finds the shortest path of reduced costs to a column that is free, or to a row
    that is better left out: Jonker, Volgenant, Computing 38 (1987); Crouse, IEEE TAES 52 (2016),
    section II, here with a heap over the sparse pairs.
    """

    def __init__(self, near: NearPairs, cost: Floats, skipping: float) -> None:
        self._rows, self._columns = near.rows.tolist(), near.columns.tolist()
        self._cost, self._skipping = cost.tolist(), skipping * (1.0 + _TIE)
        self._pairs_of: dict[int, list[int]] = defaultdict(list)
        for pair, row in enumerate(self._rows):
            self._pairs_of[row].append(pair)
        self.pair_of_row: dict[int, int] = {}
        self._pair_of_column: dict[int, int] = {}
        self._row_price: dict[int, float] = defaultdict(float)
        self._column_price: dict[int, float] = defaultdict(float)

    def place(self, start: int) -> None:
        """Let one more row take part."""
        settled: dict[int, float] = {}
        shortest: dict[int, float] = {}
        into: dict[int, int] = {}
        frontier: list[tuple[float, int]] = []
        row, length = start, 0.0
        leaving, leaving_length = start, math.inf
        while True:
            if length + self._skipping - self._row_price[row] < leaving_length:
                leaving, leaving_length = row, length + self._skipping - self._row_price[row]
            for pair in self._pairs_of[row]:
                column = self._columns[pair]
                through = length + self._cost[pair] - self._row_price[row]
                through -= self._column_price[column]
                if column not in settled and through < shortest.get(column, math.inf):
                    shortest[column], into[column] = through, pair
                    heappush(frontier, (through, column))
            while frontier and frontier[0][1] in settled:
                heappop(frontier)
            if not frontier or frontier[0][0] > leaving_length:
                self._reprice(start, settled, leaving_length)
                self._leave_out(start, leaving, into)
                return
            length, column = heappop(frontier)
            if column not in self._pair_of_column:
                self._reprice(start, settled, length)
                self._augment(start, column, into)
                return
            settled[column] = length
            row = self._rows[self._pair_of_column[column]]

    def _reprice(self, start: int, settled: dict[int, float], reached: float) -> None:
        self._row_price[start] += reached
        for column, length in settled.items():
            self._row_price[self._rows[self._pair_of_column[column]]] += reached - length
            self._column_price[column] -= reached - length

    def _leave_out(self, start: int, leaving: int, into: dict[int, int]) -> None:
        if leaving != start:
            column = self._columns[self.pair_of_row.pop(leaving)]
            self._augment(start, column, into)

    def _augment(self, start: int, column: int, into: dict[int, int]) -> None:
        """Turn the path that ends in `column` over: each of its rows takes its next column."""
        while True:
            pair = into[column]
            row = self._rows[pair]
            given_up = self.pair_of_row.get(row)
            self.pair_of_row[row] = self._pair_of_column[column] = pair
            if row == start or given_up is None:
                return
            column = self._columns[given_up]
