"""Block Cholesky of the pose chain, and what is solved with it.

The pose part T of the normal equations is block tridiagonal: one pass factors it, and one pass
eliminates it from the equations of the landmarks (Schur complement, a small dense matrix). In
bundle adjustment it is the points that are eliminated (Triggs et al., Bundle Adjustment - A Modern
Synthesis, 2000, section 6); here the points are few and the poses thousands. Memory does not grow
with poses times landmarks.
"""

from __future__ import annotations

import math

import numpy as np

from geometry import Floats
from slam.kernels import kernel
from slam.smoothing.kernels import Factors, Normal


@kernel
def factor_chain(normal: Normal, damping: float) -> tuple[Floats, Floats, bool]:
    """Cholesky factor L of T with `damping` added to its diagonal; False if there is none.

    Gives its diagonal blocks (K + 1, 3, 3), lower triangles, and those below, (k, k - 1).
    """
    diagonal, below = normal.diagonal.copy(), normal.below.copy()
    for k in range(diagonal.shape[0]):
        block, low = diagonal[k], below[k]
        for r in range(3):
            block[r, r] += damping
        if k > 0:
            before = diagonal[k - 1]
            for r in range(3):
                for c in range(3):
                    for s in range(c):
                        low[r, c] -= low[r, s] * before[c, s]
                    low[r, c] /= before[c, c]
            for r in range(3):
                for c in range(r + 1):
                    block[r, c] -= (
                        low[r, 0] * low[c, 0] + low[r, 1] * low[c, 1] + low[r, 2] * low[c, 2]
                    )
        for c in range(3):
            for s in range(c):
                for r in range(c, 3):
                    block[r, c] -= block[r, s] * block[c, s]
            if not block[c, c] > 0.0:
                return diagonal, below, False
            scale = 1.0 / math.sqrt(block[c, c])
            for r in range(c, 3):
                block[r, c] *= scale
    return diagonal, below, True


@kernel
def forward_step(low: Floats, below: Floats, before: Floats, row: Floats, width: int) -> None:
    """Make `row` low^-1 (row - below before); all (3, >= width)."""
    for r in range(3):
        b0, b1, b2, scale = below[r, 0], below[r, 1], below[r, 2], 1.0 / low[r, r]
        for c in range(width):
            row[r, c] -= b0 * before[0, c] + b1 * before[1, c] + b2 * before[2, c]
        for s in range(r):
            factor = low[r, s]
            for c in range(width):
                row[r, c] -= factor * row[s, c]
        for c in range(width):
            row[r, c] *= scale


@kernel
def schur(
    diagonal: Floats, below: Floats, normal: Normal, factors: Factors, damping: float
) -> tuple[Floats, Floats]:
    """Equations of the landmarks alone: S (2n, 2n), lower half, and right side (2n,).

    Landmarks are in the order of their first sighting, so that a pose concerns no column behind
    the last landmark that was seen before it.
    """
    n = normal.landmark.shape[0]
    S, right = np.zeros((2 * n, 2 * n)), normal.landmark_right.copy().reshape(2 * n)
    for i in range(n):
        S[2 * i, 2 * i] = normal.landmark[i, 0, 0] + damping
        S[2 * i + 1, 2 * i] = normal.landmark[i, 1, 0]
        S[2 * i + 1, 2 * i + 1] = normal.landmark[i, 1, 1] + damping
    row, before = np.zeros((3, 2 * n)), np.zeros((3, 2 * n))
    side, side_before = np.zeros((3, 1)), np.zeros((3, 1))
    width, at = 0, 0
    for k in range(diagonal.shape[0]):
        for r in range(3):
            for c in range(width):
                row[r, c] = 0.0
            side[r, 0] = normal.pose_right[k, r]
        while at < factors.node.size and factors.node[at] == k:
            column = 2 * factors.slot[at]
            width = max(width, column + 2)
            for r in range(3):
                row[r, column] += normal.mixed[at, r, 0]
                row[r, column + 1] += normal.mixed[at, r, 1]
            at += 1
        forward_step(diagonal[k], below[k], before, row, width)
        forward_step(diagonal[k], below[k], side_before, side, 1)
        subtract_rows(S, right, row, side, width)
        row, before, side, side_before = before, row, side_before, side
    return S, right


@kernel
def subtract_rows(S: Floats, right: Floats, row: Floats, side: Floats, width: int) -> None:
    """S -= row^T row on the lower half, right -= row^T side; row (3, width), side (3, 1)."""
    row0, row1, row2 = row[0], row[1], row[2]
    for i in range(width):
        f0, f1, f2, out = row0[i], row1[i], row2[i], S[i]
        for j in range(i + 1):
            out[j] -= f0 * row0[j] + f1 * row1[j] + f2 * row2[j]
        right[i] -= f0 * side[0, 0] + f1 * side[1, 0] + f2 * side[2, 0]


@kernel
def solve_chain(diagonal: Floats, below: Floats, right: Floats) -> None:
    """Make `right` (K + 1, 3, w) T^-1 right."""
    nodes, width = right.shape[0], right.shape[2]
    nothing = np.zeros((3, width))
    for k in range(nodes):
        forward_step(diagonal[k], below[k], right[k - 1] if k > 0 else nothing, right[k], width)
    for k in range(nodes - 1, -1, -1):
        low = diagonal[k]
        for r in range(2, -1, -1):
            if k + 1 < nodes:
                after, under = right[k + 1], below[k + 1]
                for c in range(width):
                    right[k, r, c] -= (
                        under[0, r] * after[0, c]
                        + under[1, r] * after[1, c]
                        + under[2, r] * after[2, c]
                    )
            for s in range(r + 1, 3):
                for c in range(width):
                    right[k, r, c] -= low[s, r] * right[k, s, c]
            for c in range(width):
                right[k, r, c] /= low[r, r]


@kernel
def mixed_product(normal: Normal, factors: Factors, columns: Floats) -> Floats:
    """(K + 1, 3, w): the equations' part between poses and landmarks times columns (2n, w)."""
    width = columns.shape[1]
    product = np.zeros((normal.diagonal.shape[0], 3, width))
    for i in range(factors.node.size):
        k, j = factors.node[i], 2 * factors.slot[i]
        for r in range(3):
            from_x, from_y = normal.mixed[i, r, 0], normal.mixed[i, r, 1]
            for c in range(width):
                product[k, r, c] += from_x * columns[j, c] + from_y * columns[j + 1, c]
    return product


@kernel
def invert_triangle(low: Floats, inverse: Floats) -> None:
    """Fill the lower half of `inverse` (3, 3) with that of a lower triangle."""
    for c in range(3):
        for r in range(c, 3):
            value = 1.0 if r == c else 0.0
            for s in range(c, r):
                value -= low[r, s] * inverse[s, c]
            inverse[r, c] = value / low[r, r]


@kernel
def chain_covariances(diagonal: Floats, below: Floats) -> Floats:
    """(K + 1, 3, 3): diagonal blocks of T^-1, by recursion from the last pose to the first.

    Takahashi, Fagan, Chin (1973): with I = L_kk^-1 and F = L_k+1,k I the block k is
    I^T I + F^T (block k + 1) F.
    """
    nodes = diagonal.shape[0]
    found = np.zeros((nodes, 3, 3))
    inverse, F, turned = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(nodes - 1, -1, -1):
        invert_triangle(diagonal[k], inverse)
        for r in range(3):
            for c in range(3):
                found[k, r, c] = (
                    inverse[0, r] * inverse[0, c]
                    + inverse[1, r] * inverse[1, c]
                    + inverse[2, r] * inverse[2, c]
                )
        if k + 1 == nodes:
            continue
        under, after = below[k + 1], found[k + 1]
        for r in range(3):
            for c in range(3):
                F[r, c] = (
                    under[r, 0] * inverse[0, c]
                    + under[r, 1] * inverse[1, c]
                    + under[r, 2] * inverse[2, c]
                )
        for r in range(3):
            for c in range(3):
                turned[r, c] = after[r, 0] * F[0, c] + after[r, 1] * F[1, c] + after[r, 2] * F[2, c]
        for r in range(3):
            for c in range(3):
                found[k, r, c] += (
                    F[0, r] * turned[0, c] + F[1, r] * turned[1, c] + F[2, r] * turned[2, c]
                )
    return found
