"""What hypothesis may throw at planar geometry."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from geometry import Floats, Trajectory

COORDINATES_M = st.floats(-1e3, 1e3)
HEADINGS_RAD = st.floats(-math.pi, math.pi, exclude_min=True)

poses: st.SearchStrategy[Floats] = st.tuples(COORDINATES_M, COORDINATES_M, HEADINGS_RAD).map(
    np.array
)
points: st.SearchStrategy[Floats] = hnp.arrays(
    np.float64, st.tuples(st.integers(0, 8), st.just(2)), elements=COORDINATES_M
)


@st.composite
def trajectories(draw: st.DrawFn, min_size: int = 1) -> Trajectory:
    """Paths of a few poses whose stamps are as large as today's and unevenly spaced."""
    periods_ns = draw(st.lists(st.integers(1, 10**10), min_size=min_size, max_size=12))
    rows = [draw(poses) for _ in periods_ns]
    return Trajectory.from_poses(1_800_000_000 * 10**9 + np.cumsum(periods_ns), np.array(rows))
