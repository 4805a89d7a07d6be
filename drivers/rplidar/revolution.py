"""Whole turns of the lidar, cut from the stream of beams at its start flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.beams import (
    HALF_TURN_Q6,
    TURN_Q6,
    Beams,
    bearing_rad,
    device_ns,
    joined,
    range_m,
)

LONGEST_TURN_S = 5.0
"""No lidar turns slower: longer without a start flag is no turn, and must not fill the memory."""


@dataclass(frozen=True, eq=False)
class Revolution:
    """One turn in the order of measurement; all arrays have one length, whatever a turn holds.

    device_ns : int64, when each beam was measured, on the lidar's sample clock; range_m : NaN where
    no echo came back; bearing_rad : frame `lidar` (x along the lidar's zero, away from its cable,
    y left), counter-clockwise in (-pi, pi], so mostly falling, for the lidar turns clockwise;
    quality : uint8, 0 to 63 (capsules have none: 47 with an echo, else 0);
    epoch : that of the `Tick`s which belong to these times.
    """

    device_ns: NDArray[np.int64]
    range_m: NDArray[np.float64]
    bearing_rad: NDArray[np.float64]
    quality: NDArray[np.uint8]
    epoch: int = 0

    def __len__(self) -> int:
        return len(self.device_ns)

    @property
    def period_s(self) -> float:
        """How long the turn took: its first beam to its last, and one beam more."""
        steps = len(self) - 1
        if steps < 1:
            return float("nan")
        return float(self.device_ns[-1] - self.device_ns[0]) * 1e-9 * (steps + 1) / steps


class RevolutionSplitter:
    """Beams in, whole turns out. What came before the first start flag of an epoch is dropped.

    us_q8 : the sample period in 1/256 us. torn : pieces that were dropped since they are no single
    turn: a start flag was lost on the way, or came from damaged bytes.
    """

    def __init__(self, us_q8: int, *, first_epoch: int = 0) -> None:
        self.torn = 0
        self._us_q8, self._first_epoch = us_q8, first_epoch
        self._pieces: list[Beams] = []
        self._begun = False
        self._epoch = 0

    def feed(self, beams: Beams) -> tuple[Revolution, ...]:
        """The turns that these beams complete."""
        if len(beams) == 0:
            return ()
        turns: list[Revolution] = []
        changed = np.diff(beams.epoch, prepend=self._epoch) != 0
        begin = 0
        for end in np.flatnonzero(beams.start | changed).tolist():
            self._keep(beams.cut(begin, end))
            if not changed[end] and self._begun:
                turns += self._finished()
            self._pieces, self._begun = [], bool(beams.start[end])
            begin = end
        self._keep(beams.cut(begin, len(beams)))
        if self._pieces and self._span_s() > LONGEST_TURN_S:
            self.torn += 1
            self._pieces, self._begun = [], False
        self._epoch = int(beams.epoch[-1])
        return tuple(turns)

    def _keep(self, beams: Beams) -> None:
        if self._begun and len(beams):
            self._pieces.append(beams)

    def _span_s(self) -> float:
        samples = int(self._pieces[-1].index[-1] - self._pieces[0].index[0])
        return samples * self._us_q8 / 256e6

    def _finished(self) -> list[Revolution]:
        beams = joined(self._pieces)
        steps = (np.diff(beams.angle_q6) + HALF_TURN_Q6) % TURN_Q6 - HALF_TURN_Q6
        if not TURN_Q6 < 2 * int(steps.sum()) < 3 * TURN_Q6:
            self.torn += 1
            return []
        return [
            Revolution(
                device_ns(beams.index, self._us_q8),
                range_m(beams.distance_q2),
                bearing_rad(beams.angle_q6),
                beams.quality,
                self._first_epoch + int(beams.epoch[0]),
            )
        ]
