"""Hard and soft iron of a compass: the ellipsoid on which its readings lie becomes a sphere.

The quadric (b - c)^T M (b - c) = 1 is linear in nine coefficients (Gietzelt et al. 2013; least
squares on scaled coordinates). A car that only turns on the floor shows an ellipse of x and y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import Floats

LEAST_ROWS = 50
SECTORS, LEAST_SECTORS = 12, 10
FLAT = 0.25
"""The third axis was turned, too, when it spans this share of the largest."""
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """corrected = soft_iron @ (measured - hard_iron_t), of the axes x, y or x, y, z.

    field_t : size of the corrected field; left_out : rows that were no readings; rms_t : of its
    size. soft_iron (k, k) is symmetric with determinant 1; sigma_t (k,) of hard_iron_t.
    """

    hard_iron_t: Floats
    soft_iron: Floats
    field_t: float
    rms_t: float
    sigma_t: Floats
    left_out: int


def fit_ellipsoid(field_t: Floats) -> Ellipsoid | str:
    """The ellipsoid of readings (n, 3), the ellipse of x and y if z was not turned; or why not."""
    rows = field_t[np.isfinite(field_t).all(axis=1)]
    if len(rows) < LEAST_ROWS:
        return f"{len(rows)} readings of the compass, expected {LEAST_ROWS}"
    low, high = np.percentile(rows, [3, 97], axis=0)
    middle, span = 0.5 * (low + high), high - low
    axes = 3 if span[2] > FLAT * span.max() else 2
    away = rows - middle
    sector = np.floor((np.arctan2(away[:, 1], away[:, 0]) / np.pi + 1.0) * SECTORS / 2.0)
    seen = np.unique(sector.astype(np.int64) % SECTORS).size
    if seen < LEAST_SECTORS or not span[:2].min() > 0.2 * span[:2].max():
        return (
            f"the compass saw {seen} of {SECTORS} directions: turn the car twice right round, then "
            "nose up and on its side, too"
        )
    return _fitted(rows[:, :axes], middle[:axes])


def _fitted(rows: Floats, middle: Floats) -> Ellipsoid | str:
    scale = float(np.abs(rows - middle).max())
    points, kept = (rows - middle) / scale, np.ones(len(rows), bool)
    for _ in range(_ROUNDS):
        solved = _quadric(points[kept])
        if solved is None:
            return "the readings of the compass lie on no ellipsoid: magnets or currents near it"
        centre, root = solved
        size = np.linalg.norm((points - centre) @ root, axis=1)
        off = size - 1.0
        spread = 1.4826 * float(np.median(np.abs(off[kept]))) + 1e-9
        kept = np.abs(off) < 6.0 * spread
    k = rows.shape[1]
    length = float(np.linalg.det(root)) ** (1.0 / k)
    rms = float(np.sqrt(np.mean(off[kept] ** 2)))
    field = scale / length
    sigma = np.full(k, rms * field * np.sqrt(k / max(np.count_nonzero(kept) / 10.0, 1.0)))
    return Ellipsoid(
        middle + scale * centre,
        root / length,
        field,
        rms * field,
        sigma,
        int(np.count_nonzero(~kept)),
    )


def _quadric(points: Floats) -> tuple[Floats, Floats] | None:
    """Centre (k,) and symmetric root (k, k) of the shape; None where it is no ellipsoid."""
    k = points.shape[1]
    pairs = [(i, j) for i in range(k) for j in range(i, k)]
    columns = [points[:, i] * points[:, j] * (1.0 if i == j else 2.0) for i, j in pairs]
    design = np.stack([*columns, *(2.0 * points.T)], axis=1)
    solution = np.linalg.lstsq(design, np.ones(len(points)), rcond=None)[0]
    shape = np.zeros((k, k))
    for value, (i, j) in zip(solution, pairs, strict=False):
        shape[i, j] = shape[j, i] = value
    if np.linalg.eigvalsh(shape)[0] <= 0:
        return None
    centre = -np.linalg.solve(shape, solution[len(pairs) :])
    size = 1.0 + float(centre @ shape @ centre)
    values, vectors = np.linalg.eigh(shape / size)
    return centre, vectors @ np.diag(np.sqrt(values)) @ vectors.T
