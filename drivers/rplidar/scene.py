"""What the emulated lidar measures: its turning head, and beams at their own times."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.beams import TURN_Q6, bearing_rad
from drivers.rplidar.encoding import encode_dense, encode_legacy, encode_nodes, encode_ultra
from drivers.rplidar.protocol import ANSWER_BYTES, Answer, ScanMode
from drivers.rplidar.ultra import FAR_MM, OPTICS_Q16

Source: TypeAlias = Callable[[NDArray[np.int64], NDArray[np.float64]], NDArray[np.float64]]
"""Times in ns and bearings counter-clockwise in rad -> ranges in m, NaN where nothing is."""

STEADY = 0.05
SAMPLES = {Answer.STANDARD: 1, Answer.LEGACY: 32, Answer.ULTRA: 96, Answer.DENSE: 40}
NODES_AHEAD = 32
_LONGEST_Q2 = 0xFFFC


def room(width_m: float = 6.0, depth_m: float = 4.0) -> Source:
    """A rectangular room around the lidar, which stands in its middle; `width_m` along x."""

    def ranges(_: NDArray[np.int64], bearing: NDArray[np.float64]) -> NDArray[np.float64]:
        across = 2.0 * np.abs(np.cos(bearing)) / width_m
        along = 2.0 * np.abs(np.sin(bearing)) / depth_m
        nearest: NDArray[np.float64] = 1.0 / np.maximum(across, along)
        return nearest

    return ranges


class Rotor:
    """The head of the lidar: it follows what drives it in about two seconds."""

    def __init__(self, spin_up_s: float = 2.0) -> None:
        self._lag_s = spin_up_s / math.log(1.0 / STEADY)
        # Since when (s), turns by then, Hz then, Hz it strives for: one row for each change.
        self._rows = [(0.0, 0.0, 0.0, 0.0)]

    @property
    def target_hz(self) -> float:
        """Where the head is driven to; 0 when the motor is off."""
        return self._rows[-1][3]

    def drive(self, hz: float, now_ns: int) -> None:
        """Strive for another speed from now on."""
        if hz == self.target_hz:
            return
        now = np.array([now_ns])
        row = (now_ns * 1e-9, float(self.turns(now)[0]), float(self.speed_hz(now)[0]), hz)
        self._rows = [*self._rows[-7:], row]

    def jump(self, hz: float, now_ns: int) -> None:
        """Turn at that speed at once, as after a knock."""
        turns = float(self.turns(np.array([now_ns]))[0])
        self._rows = [*self._rows[-7:], (now_ns * 1e-9, turns, hz, hz)]

    def turns(self, t_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Turns since ever, clockwise, not below what they were before."""
        after_s, turns, hz, target_hz = self._at(t_ns)
        shed = -np.expm1(-after_s / self._lag_s)
        passed: NDArray[np.float64] = (
            turns + target_hz * after_s + (hz - target_hz) * self._lag_s * shed
        )
        return passed

    def speed_hz(self, t_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Turns a second at each time."""
        after_s, _, hz, target_hz = self._at(t_ns)
        speed: NDArray[np.float64] = target_hz + (hz - target_hz) * np.exp(-after_s / self._lag_s)
        return speed

    def steady_ns(self, now_ns: int) -> int | None:
        """From when on the speed is within five per cent; None while the motor is off."""
        since_s, _, hz, target_hz = self._rows[-1]
        if target_hz <= 0.0:
            return None
        off = abs(hz - target_hz) / (STEADY * target_hz)
        return max(now_ns, round((since_s + self._lag_s * math.log(max(off, 1.0))) * 1e9))

    def _at(self, t_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], ...]:
        since, turns, hz, target_hz = np.array(self._rows).T
        t_s = t_ns * 1e-9
        row = np.maximum(np.searchsorted(since, t_s, side="right") - 1, 0)
        return t_s - since[row], turns[row], hz[row], target_hz[row]


class Stream(Protocol):
    """Measurement packets, each with the time at which it is ready to leave the device."""

    def ready_ns(self) -> int | None:
        """When the next packet is ready; None: there is no more."""

    def take(self, *, restart: bool) -> bytes:
        """That packet; `restart` sets the S bit of a capsule."""


class Scan:
    """A scan of a source, from `begin_ns` on; ppm : by how much the sample clock is slow."""

    def __init__(
        self, mode: ScanMode, rotor: Rotor, source: Source, begin_ns: int, *, ppm: float = 0.0
    ) -> None:
        self.mode = mode
        self._rotor, self._source, self._begin_ns = rotor, source, begin_ns
        self._period_ns = mode.us_q8 * 1000.0 / 256.0 * (1.0 + ppm * 1e-6)
        self._samples = SAMPLES[Answer(mode.answer)]
        self._packets = 0
        self._nodes = b""

    def true_ns(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """When a sample was measured; `index` counts all since the scan began."""
        since_ns: NDArray[np.int64] = np.rint(index * self._period_ns).astype(np.int64)
        return self._begin_ns + since_ns

    def ready_ns(self) -> int:
        """One and a half sample periods after the last sample of the packet (SDK's own model)."""
        last = (self._packets + 1) * self._samples - 1
        return self._begin_ns + round((last + 1.5) * self._period_ns)

    def take(self, *, restart: bool) -> bytes:
        """The next packet."""
        first = self._packets * self._samples
        self._packets += 1
        if self.mode.answer == Answer.STANDARD:
            return self._take_node(first)
        extra = int(self.mode.answer == Answer.ULTRA)
        nominal, back_q16, distance_q2 = self._look(first, self._samples + extra)
        start_q6 = int(nominal[0] * TURN_Q6) % TURN_Q6
        if self.mode.answer == Answer.ULTRA:
            return encode_ultra(start_q6, restart, distance_q2)
        if self.mode.answer == Answer.DENSE:
            return encode_dense(start_q6, restart, distance_q2)
        return encode_legacy(start_q6, restart, distance_q2, (back_q16 + 4096) >> 13)

    def _take_node(self, index: int) -> bytes:
        """A node of those that were made together, for speed."""
        size = ANSWER_BYTES[Answer.STANDARD]
        if not self._nodes:
            nominal, back_q16, distance_q2 = self._look(index - 1, NODES_AHEAD + 1)
            start = np.diff(np.floor(nominal)) > 0
            angle_q6 = (nominal * (TURN_Q6 << 10)).astype(np.int64) - back_q16 >> 10
            quality = np.where(distance_q2 > 0, 47, 0)
            self._nodes = encode_nodes(angle_q6[1:], distance_q2[1:], quality[1:], start)
        node, self._nodes = self._nodes[:size], self._nodes[size:]
        return node

    def _look(
        self, first: int, count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Turns before the optics, by how much the optics move each angle back, and distances.

        How far the optics move a beam depends on what it hits, which depends on where it goes: two
        rounds settle that.
        """
        t_ns = self.true_ns(np.arange(first, first + count))
        nominal = self._rotor.turns(t_ns)
        angle_q16 = (nominal % 1.0 * (TURN_Q6 << 10)).astype(np.int64)
        dense = self.mode.answer == Answer.DENSE
        back_q16 = np.full(count, 0 if dense else OPTICS_Q16[-1], np.int64)
        distance_q2 = self._measure(t_ns, angle_q16 - back_q16)
        for _ in range(0 if dense else 2):
            back_q16 = OPTICS_Q16[np.minimum(distance_q2 >> 2, FAR_MM)].astype(np.int64)
            distance_q2 = self._measure(t_ns, angle_q16 - back_q16)
        return nominal, back_q16, distance_q2

    def _measure(self, t_ns: NDArray[np.int64], angle_q16: NDArray[np.int64]) -> NDArray[np.int64]:
        angle_q6 = (angle_q16 >> 10).astype(np.int32) % TURN_Q6
        range_m = self._source(t_ns, bearing_rad(angle_q6))
        seen = np.isfinite(range_m) & (range_m > 0.0) & (range_m <= self.mode.max_distance_m)
        distance_q2 = np.rint(np.where(seen, range_m, 0.0) * 4000.0).astype(np.int64)
        return np.where(distance_q2 <= _LONGEST_Q2, distance_q2, 0)
