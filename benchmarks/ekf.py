"""Time of one EKF-SLAM update with 8 observations, on one core, against the textbook's form.

    uv run python benchmarks/ekf.py

Prints medians over many updates. "textbook" is Thrun, Burgard, Fox 2005, table 10.1 line by line in
numpy: one observation after the other, with the full matrix product per observation.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from dialogue import Table
from geometry import Floats, wrap
from slam.config import PRESETS
from slam.ekf import EkfSlam

OBSERVATIONS = 8
LIMITS_MS = {10: 0.010, 50: 0.04, 200: 0.25, 1000: 5.0}
CONFIG = PRESETS["robust"]


def main() -> None:
    """Print the table."""
    rows = [_row(n, limit) for n, limit in LIMITS_MS.items()]
    columns = (
        "landmarks", "known ids [ms]", "nearest [ms]", "jcbb [ms]", "p99 [ms]", "limit [ms]",
        "limit / known", "textbook [ms]", "textbook / known",
    )  # fmt: skip
    print(Table(columns, tuple(rows), f"EKF-SLAM update, {OBSERVATIONS} observations").render("md"))


def _row(n: int, limit_ms: float) -> tuple[float | int, ...]:
    repeats = 2000 if n <= 200 else 100
    known = _times_ms(_update(n, "known"), repeats)
    nearest = _times_ms(_update(n, "nearest"), repeats)
    joint = _times_ms(_update(n, "jcbb"), repeats)
    textbook = float(np.median(_times_ms(_textbook_update(n), 20 if n <= 200 else 3)))
    median = float(np.median(known))
    return (
        n, median, float(np.median(nearest)), float(np.median(joint)),
        float(np.percentile(known, 99)), limit_ms, limit_ms / median, textbook, textbook / median,
    )  # fmt: skip


def _times_ms(action: Callable[[], object], repeats: int) -> Floats:
    for _ in range(3):
        action()
    times = np.empty(repeats)
    for i in range(repeats):
        start = time.perf_counter()
        action()
        times[i] = time.perf_counter() - start
    return times * 1e3


def _field(n: int) -> tuple[Floats, Floats]:
    """Range and bearing of n landmarks on a square grid, 1.5 m apart, around the car."""
    side = int(np.ceil(np.sqrt(n)))
    x, y = np.stack(np.divmod(np.arange(n), side)) - 0.5 * side + 0.13
    return 1.5 * np.hypot(x, y), np.arctan2(y, x)


def _seen(n: int) -> npt.NDArray[np.int64]:
    """The landmarks nearest to the car."""
    return np.argsort(_field(n)[0])[:OBSERVATIONS].astype(np.int64)


def _update(n: int, association: str) -> Callable[[], object]:
    slam = EkfSlam(CONFIG, "known", capacity=n)
    ranges, bearings = _field(n)
    ids = np.arange(n)
    slam.predict(np.array([[0.01, 0.0, 0.01]]), np.array([0.1]))
    for i in range(n):
        slam.update(0, ids[i : i + 1], ranges[i : i + 1] + 1e-3, bearings[i : i + 1])
    slam.association = association
    seen = _seen(n)
    chosen = ids[seen], ranges[seen], bearings[seen]
    if slam.update(1, *chosen).matched != OBSERVATIONS:
        raise SystemExit(f"only some of {OBSERVATIONS} observations were matched: not a measure")
    return lambda: slam.update(1, *chosen)


def _textbook_update(n: int) -> Callable[[], object]:
    size = 3 + 2 * n
    state = {"x": np.zeros(size), "P": np.eye(size) * 0.01}
    ranges, bearings = _field(n)
    state["x"][3::2], state["x"][4::2] = ranges * np.cos(bearings), ranges * np.sin(bearings)
    R = np.diag([0.04**2, np.radians(1.0) ** 2])
    seen = _seen(n)

    def update() -> None:
        x, P = state["x"], state["P"]
        for i in seen:
            dx, dy = x[3 + 2 * i] - x[0], x[4 + 2 * i] - x[1]
            q = dx * dx + dy * dy
            r = np.sqrt(q)
            selector = np.zeros((5, size))
            selector[:3, :3] = np.eye(3)
            selector[3:, 3 + 2 * i : 5 + 2 * i] = np.eye(2)
            low = np.array([[-r * dx, -r * dy, 0, r * dx, r * dy], [dy, -dx, -q, -dy, dx]]) / q
            H = low @ selector
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            nu = np.array([ranges[i] - r, float(wrap(bearings[i] - np.arctan2(dy, dx) + x[2]))])
            x = x + K @ nu
            P = (np.eye(size) - K @ H) @ P
        state["x"], state["P"] = x, P

    return update


if __name__ == "__main__":
    main()
