"""Whose sightings are whose on a path that is known, and what each landmark is worth.

The log-likelihood of everything that was seen and not seen, against all of it being clutter: a
sighting of a landmark counts `log(P g / ((1 - P) clutter))`, g being its density with Cauchy tails,
and a landmark in the sensor's field counts `log(1 - P)` for every scan (Reid's hypotheses, IEEE
T-AC 24, 1979, with the path in hand).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from geometry import Floats
from slam.kernels import kernel, wrapped
from slam.observation import expected, variances

Ints = npt.NDArray[np.int64]


@kernel
def worths(
    poses: Floats, landmarks: Floats, range_m: Floats, bearing_rad: Floats, noise: Floats,
    log_odds: float, scale: float,
) -> Floats:  # fmt: skip
    """(m, n): what each observation, from its pose (m, 3), is worth as one of each landmark.

    log_odds : log(P / ((1 - P) clutter)); scale : sigmas from which on tails are Cauchy's.
    """
    worth = np.empty((range_m.size, landmarks.shape[0]))
    limit = scale * scale
    for i in range(range_m.size):
        var_r, var_b = variances(range_m[i], noise)
        peak = log_odds - math.log(math.tau) - 0.5 * math.log(var_r * var_b)
        for j in range(landmarks.shape[0]):
            due_m, due_rad, _, _ = expected(poses[i], landmarks[j, 0], landmarks[j, 1])
            turn = wrapped(bearing_rad[i] - due_rad)
            squared = (range_m[i] - due_m) ** 2 / var_r + turn * turn / var_b
            worth[i, j] = peak - 0.5 * limit * math.log1p(squared / limit)
    return worth


@kernel
def assign(worth: Floats, start: int, end: int, without: int, slots: Ints) -> float:
    """Fill slots[start:end] of one scan, the worthiest pair first, -1 for clutter; the sum.

    No landmark is seen twice, and `without` not at all.
    """
    total = 0.0
    for i in range(start, end):
        slots[i] = -1
    for _ in range(start, end):
        best, best_i, best_j = 0.0, -1, -1
        for i in range(start, end):
            if slots[i] >= 0:
                continue
            for j in range(worth.shape[1]):
                if j == without or not worth[i, j] > best:
                    continue
                taken = False
                for other in range(start, end):
                    taken = taken or slots[other] == j
                if not taken:
                    best, best_i, best_j = worth[i, j], i, j
        if best_i < 0:
            break
        slots[best_i] = best_j
        total += best
    return total


@kernel
def assign_all(worth: Floats, starts: Ints) -> Ints:
    """(m,): the landmark of each observation or -1; starts (s + 1,) of the scans."""
    slots = np.empty(worth.shape[0], dtype=np.int64)
    for s in range(starts.size - 1):
        assign(worth, starts[s], starts[s + 1], -1, slots)
    return slots


@kernel
def needs(worth: Floats, starts: Ints, slots: Ints) -> Floats:
    """(n,): by how much the sightings would be worth less if a landmark were not there."""
    need = np.zeros(worth.shape[1])
    trial = slots.copy()
    for s in range(starts.size - 1):
        start, end = starts[s], starts[s + 1]
        now = 0.0
        for i in range(start, end):
            if slots[i] >= 0:
                now += worth[i, slots[i]]
        for i in range(start, end):
            if slots[i] >= 0:
                need[slots[i]] += now - assign(worth, start, end, slots[i], trial)
    return need


@kernel
def in_field(
    poses: Floats, landmarks: Floats, nearest_m: float, farthest_m: float, half_angle_rad: float
) -> Ints:
    """(n,): in how many of the scans, at poses (s, 3), each landmark stands in the field."""
    count = np.zeros(landmarks.shape[0], dtype=np.int64)
    for s in range(poses.shape[0]):
        for j in range(landmarks.shape[0]):
            range_m, bearing_rad, _, _ = expected(poses[s], landmarks[j, 0], landmarks[j, 1])
            count[j] += nearest_m <= range_m <= farthest_m and abs(bearing_rad) <= half_angle_rad
    return count


@kernel
def seen_together(slots: Ints, starts: Ints, n: int) -> Ints:
    """(n, n): in how many scans two landmarks were both seen."""
    together = np.zeros((n, n), dtype=np.int64)
    for s in range(starts.size - 1):
        for i in range(starts[s], starts[s + 1]):
            for k in range(starts[s], i):
                if slots[i] >= 0 and slots[k] >= 0:
                    together[slots[i], slots[k]] += 1
                    together[slots[k], slots[i]] += 1
    return together


@kernel
def gatherings(
    poses: Floats, range_m: Floats, bearing_rad: Floats, noise: Floats, gate: float, least: int
) -> Floats:
    """(k, 2): where at least so many of these sightings, from poses (m, 3), agree on a place.

    The most numerous first; a sighting counts for one place only.
    """
    m = range_m.size
    places, free = np.empty((m, 2)), np.ones(m, dtype=np.bool_)
    agree = np.zeros((m, m), dtype=np.bool_)
    for j in range(m):
        direction = poses[j, 2] + bearing_rad[j]
        places[j, 0] = poses[j, 0] + range_m[j] * math.cos(direction)
        places[j, 1] = poses[j, 1] + range_m[j] * math.sin(direction)
    for i in range(m):
        var_r, var_b = variances(range_m[i], noise)
        for j in range(m):
            due_m, due_rad, _, _ = expected(poses[i], places[j, 0], places[j, 1])
            turn = wrapped(bearing_rad[i] - due_rad)
            agree[j, i] = (range_m[i] - due_m) ** 2 / var_r + turn * turn / var_b < gate
    found, count = np.empty((m, 2)), 0
    while True:
        best, best_j = 0, -1
        for j in range(m):
            votes = np.sum(agree[j] & free) if free[j] else 0
            if votes > best:
                best, best_j = votes, j
        if best < least:
            return found[:count]
        members = np.flatnonzero(agree[best_j] & free)
        found[count, 0] = np.median(places[members, 0])
        found[count, 1] = np.median(places[members, 1])
        count += 1
        free[members] = False
        free[best_j] = False
