"""The fit of one known marker: how far it is from where it was expected, from both of its edges.

Offsets come as (n, K, 2), outer and inner edge. Unknowns: shift in x and y (both edges), growth of
each edge, and two terms of flattening that scale with the edge. On a whole marker the shift is
orthogonal to the rest; on a partly covered one weak priors keep the rest from running away. The
fit itself is `tracking.kernels.fit_rings`; here is what it needs, and what its columns are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from geometry import Floats
from tracking.profiles import harmonics

SHIFT = slice(0, 2)
CONTRAST = 5
"""Columns of fits (n, 10)."""


@dataclass(frozen=True, eq=False)
class Design:
    """The model of K lines across two edges, outer edge first.

    model : (2 K, 6) offsets per unknown; inverse : (2 K, 6) its weighted least squares inverse,
    transposed; products : (2 K, 36) of the unknowns of a line; weights : (2 K,). The inner edge is
    shorter by the ratio of diameters and sampled as often, so each of its lines says less.
    """

    model: Floats
    inverse: Floats
    products: Floats
    weights: Floats


@lru_cache(maxsize=8)
def fit_design(lines: int, ratio: float) -> Design:
    """The design for K lines and this ratio of diameters."""
    base = harmonics(lines)
    zero, one = np.zeros(lines), np.ones(lines)
    outer = np.column_stack([base[:, :2], one, zero, base[:, 3:]])
    inner = np.column_stack([base[:, :2], zero, one, ratio * base[:, 3:]])
    model = np.stack([outer, inner], axis=1).reshape(2 * lines, 6)
    weights = np.tile([1.0, ratio], lines)
    normal = model.T @ (weights[:, None] * model)
    inverse = np.linalg.solve(normal, model.T * weights)
    products = (model[:, :, None] * model[:, None, :]).reshape(-1, 36)
    return Design(model, np.ascontiguousarray(inverse.T), products, weights)
