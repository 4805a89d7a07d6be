"""What is known about the markers beforehand, and what is said about them in a frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from geometry import Floats, RingShape


@dataclass(frozen=True)
class Marker:
    """A ring with a name.

    height_m : of its plane above the floor. place_m : x, y where it stands, None for one that
    moves. Cones and corners stand; the rings of the car move.
    """

    name: str
    height_m: float
    place_m: tuple[float, float] | None = None
    shape: RingShape = field(default_factory=RingShape)

    @property
    def moves(self) -> bool:
        """Whether it has no place of its own."""
        return self.place_m is None


class State(IntEnum):
    """What a frame says about a marker."""

    SEEN = 0
    PARTLY = 1
    """Seen, with something in the way of it; its covariance says how well."""
    LOST = 2
    """Not seen, or not known which one was seen. No position is given."""


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """All markers in one frame, in the order in which the tracker was told of them.

    t_ns : middle of the exposure. states : (n,) of `State`. centres_px : (n, 2) images of the
    centres of the rings (not of their ellipses). xy_m : (n, 2) in the world. covariance_m2 :
    (n, 2, 2) from the image alone, the calibration's part not included. inliers, scatter_px,
    contrast : (n,) share of lines that agree, their scatter, grey levels. NaN where lost.
    """

    t_ns: int
    states: npt.NDArray[np.int8]
    centres_px: Floats
    xy_m: Floats
    covariance_m2: Floats
    inliers: Floats
    scatter_px: Floats
    contrast: Floats

    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """Which markers have a position, (n,)."""
        seen: npt.NDArray[np.bool_] = self.states != State.LOST
        return seen
