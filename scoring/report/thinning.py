"""Fewer points for the same picture."""

from __future__ import annotations

import heapq

import numpy as np
import numpy.typing as npt

from geometry import Floats, Stamps

Rows = npt.NDArray[np.int64]

PATH_LIMIT = 2000
SERIES_BUCKETS = 300

GAP = 10.0
"""A step longer than so many usual ones is a gap: no line is drawn across."""


def thin_path(points: Floats, limit: int = PATH_LIMIT) -> Rows:
    """Rows of a polyline (n, 2), at most `limit`, that draw it to within 1/2000 of its extent.

    Ramer-Douglas-Peucker (Douglas & Peucker, Cartographica 10, 1973), the farthest point of the
    whole line first, so that a line too wild for the limit loses its smallest turns.
    """
    last = points.shape[0] - 1
    tolerance = float(np.ptp(points, axis=0).max()) / 2000.0
    kept = {0, last}
    spans = [_farthest(points, 0, last)]
    while spans and len(kept) < limit:
        farness, first, middle, end = heapq.heappop(spans)
        if -farness <= tolerance:
            break
        kept.add(middle)
        heapq.heappush(spans, _farthest(points, first, middle))
        heapq.heappush(spans, _farthest(points, middle, end))
    return np.array(sorted(kept), dtype=np.int64)


def _farthest(points: Floats, first: int, last: int) -> tuple[float, int, int, int]:
    """The inner point farthest from the chord: a heap entry, its distance negative."""
    if last - first < 2:
        return 0.0, first, first, last
    distance = _distance_to_chord(points[first + 1 : last], points[first], points[last])
    inner = int(np.argmax(distance))
    return -float(distance[inner]), first, first + 1 + inner, last


def _distance_to_chord(points: Floats, start: Floats, end: Floats) -> Floats:
    """(n,): distance to the segment, so that a path that turns back keeps its turning point."""
    chord = end - start
    square = float(chord @ chord)
    along = (points - start) @ chord / square if square > 0 else np.zeros(points.shape[0])
    nearest = start + np.clip(along, 0.0, 1.0)[:, None] * chord
    distance: Floats = np.linalg.norm(points - nearest, axis=1)
    return distance


def thin_series(t_s: Floats, values: Floats, buckets: int = SERIES_BUCKETS) -> Rows:
    """Rows of a time series (n,) that draw it: first, last, least and greatest of each bucket.

    M4 of Jugel et al., "M4: a visualization-oriented time series data aggregation", PVLDB 7 (2014):
    exact when a bucket is no wider than a pixel.
    """
    if t_s.size <= 4 * buckets:
        return np.arange(t_s.size)
    edges = np.linspace(t_s[0], t_s[-1], buckets + 1)[1:-1]
    starts = np.unique(np.concatenate([[0], np.searchsorted(t_s, edges)]))
    starts = starts[starts < t_s.size]
    rows: list[int] = []
    for first, end in zip(starts, [*starts[1:], t_s.size], strict=True):
        part = values[first:end]
        rows += [first, first + int(part.argmin()), first + int(part.argmax()), end - 1]
    return np.unique(np.array(rows, dtype=np.int64))


def with_gaps(t_ns: Stamps, rows: Rows, columns: Floats) -> Floats:
    """The `columns` (n, k) at `rows`, with a row of NaN wherever the stamps (n,) leave a gap."""
    if rows.size < 2:
        return columns[rows]
    steps = np.diff(t_ns)
    gaps_before = np.concatenate([[0], np.cumsum(steps > GAP * np.median(steps))])
    breaks = np.flatnonzero(np.diff(gaps_before[rows])) + 1
    return np.insert(columns[rows], breaks, np.nan, axis=0)
