"""Beams as the decoders give them, and their one way into our angles.

Numbers are the device's own (angles in 1/64 degree clockwise, distances in 1/4 mm), so that
decoding is exact and can be compared with Slamtec's to the bit; `bearing_rad` and `range_m` make SI
of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

TURN_Q6 = 360 * 64
HALF_TURN_Q6 = 180 * 64


@dataclass(frozen=True, eq=False)
class Beams:
    """Beams in the order in which they were measured; all arrays have one length.

    index : int64, counts the device's samples including those that were lost, never goes back;
    epoch : int64, counts the places where the number of lost samples is unknown: times by `index`
    may be compared within one epoch only;
    angle_q6 : int32 in [0, 23040), 1/64 degree clockwise from the lidar's zero;
    distance_q2 : int32, 1/4 mm, 0 where no echo came back;
    quality : uint8, 0 to 63 (capsules have none: 47 with an echo, else 0, as Slamtec's SDK);
    start : bool, the first beam of a turn.
    """

    index: NDArray[np.int64]
    epoch: NDArray[np.int64]
    angle_q6: NDArray[np.int32]
    distance_q2: NDArray[np.int32]
    quality: NDArray[np.uint8]
    start: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.index)

    def cut(self, begin: int, end: int) -> Beams:
        """Those from `begin` on, before `end`."""
        part = slice(begin, end)
        return Beams(
            self.index[part],
            self.epoch[part],
            self.angle_q6[part],
            self.distance_q2[part],
            self.quality[part],
            self.start[part],
        )


NO_BEAMS = Beams(
    np.empty(0, np.int64),
    np.empty(0, np.int64),
    np.empty(0, np.int32),
    np.empty(0, np.int32),
    np.empty(0, np.uint8),
    np.empty(0, np.bool_),
)


def joined(pieces: list[Beams]) -> Beams:
    """Pieces one after the other."""
    if not pieces:
        return NO_BEAMS
    if len(pieces) == 1:
        return pieces[0]
    return Beams(
        np.concatenate([piece.index for piece in pieces]),
        np.concatenate([piece.epoch for piece in pieces]),
        np.concatenate([piece.angle_q6 for piece in pieces]),
        np.concatenate([piece.distance_q2 for piece in pieces]),
        np.concatenate([piece.quality for piece in pieces]),
        np.concatenate([piece.start for piece in pieces]),
    )


@dataclass(frozen=True)
class Newest:
    """The last sample of the last complete packet, decoded already or not.

    bytes_after : how many bytes came after that packet in the same feed.
    """

    index: int
    epoch: int
    bytes_after: int


class Decoder(Protocol):
    """One type of scan answer: bytes cut anywhere in, beams out; takes any bytes, never raises.

    newest : what the last feed completed, None if nothing; bad_frames, bad_bytes, lost_samples : as
    in `drivers.Counters`.
    """

    packet_bytes: int
    packet_samples: int
    newest: Newest | None
    bad_frames: int
    bad_bytes: int
    lost_samples: int

    def feed(self, data: bytes) -> Beams:
        """The beams that these bytes complete."""

    def flush(self) -> Beams:
        """What the end of the stream makes certain; for files."""

    def break_count(self) -> None:
        """Begin a new epoch: more is missing than the bytes themselves can tell."""


def bearing_rad(angle_q6: NDArray[np.int32]) -> NDArray[np.float64]:
    """Bearing in the frame `lidar`, counter-clockwise in (-pi, pi], of the device's angles.

    The device turns clockwise as seen from above and its zero points away from the cable; x of
    `lidar` lies along that zero, y to the left (manual fig. 4-7; reference/protocols.md A.11).
    The only place where the sense of rotation changes.
    """
    turned = np.where(angle_q6 >= HALF_TURN_Q6, TURN_Q6 - angle_q6, -angle_q6)
    return turned * (np.pi / HALF_TURN_Q6)


def range_m(distance_q2: NDArray[np.int32]) -> NDArray[np.float64]:
    """Distance in metres; NaN where no echo came back."""
    return np.where(distance_q2 > 0, distance_q2 * 0.00025, np.nan)


def device_ns(index: NDArray[np.int64], us_q8: int) -> NDArray[np.int64]:
    """Time on the device's sample clock; `us_q8` is the sample period in 1/256 us."""
    ns: NDArray[np.int64] = index * (us_q8 * 125) // 32
    return ns
