"""Where the sensor looks, learnt from the landmarks that are believed.

A lidar sees all around, a camera sees a sector, and nobody tells which it is. For each direction it
is counted how often a believed landmark in sure reach was seen there and how often it was not. What
is believed has the benefit of the doubt: absence where nothing was ever seen takes nothing from it.
"""

from __future__ import annotations

import math

import numpy as np

from geometry import Floats
from slam.kernels import kernel, wrapped

SECTORS = 24


def new_eye() -> Floats:
    """(SECTORS, 2): how often something was seen, and how often not, in each direction."""
    return np.zeros((SECTORS, 2))


@kernel
def note(eye: Floats, bearing_rad: float, seen: bool) -> None:
    """Count, in place, that a believed landmark in sure reach was seen there, or was not."""
    eye[_sector(bearing_rad), 0 if seen else 1] += 1.0


@kernel
def share(eye: Floats, bearing_rad: float, believed: bool) -> float:
    """What share of the landmarks in this direction is seen, in doubt for the one in question."""
    sector = _sector(bearing_rad)
    seen, missed = eye[sector, 0], eye[sector, 1]
    doubt = 0.0 if believed else 1.0
    found: float = (seen + doubt) / (seen + missed + 1.0)
    return found


@kernel
def _sector(bearing_rad: float) -> int:
    turned = wrapped(bearing_rad) / math.tau + 0.5
    return min(max(int(turned * SECTORS), 0), SECTORS - 1)
