"""Capsules: what legacy, ultra and dense answers have in common.

Two bytes with a sync nibble each and the checksum (exclusive or of all that follows), the start
angle with the S bit, then cabins. The beams of a capsule get their angles only when the next has
come: they divide the angle between the two start angles evenly. So a lost capsule shows as an angle
that is a whole multiple too large; its beams are counted as lost, and the capsule before it is
finished at the running rate. Source: reference/protocols.md A.7-A.10 (SDK 2.1.0, bit for bit).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.beams import NO_BEAMS, TURN_Q6, Beams, Newest

HEADER_BYTES = 4
SDK_QUALITY = 47
TURN_Q16 = 360 << 16
RATE_CAPSULES = 9
RATE_KNOWN = 3
_SYNC_MASK, _SYNC = 0xF0F0, 0x50A0

Bytes2 = NDArray[np.uint8]
Ints = NDArray[np.int32]


@dataclass
class _Pairs:
    """Capsules that can be finished, and by what."""

    position: list[int] = field(default_factory=list)
    start_q6: list[int] = field(default_factory=list)
    advance_q6: list[int] = field(default_factory=list)
    index: list[int] = field(default_factory=list)
    epoch: list[int] = field(default_factory=list)
    adjacent: list[bool] = field(default_factory=list)
    turn_starts: list[tuple[int, int]] = field(default_factory=list)


class CapsuleDecoder(ABC):
    """Bytes of capsules in, beams out; what is in the cabins is the subclass's to say."""

    packet_bytes: int
    packet_samples: int

    def __init__(self) -> None:
        self.newest: Newest | None = None
        self.bad_frames = self.bad_bytes = self.lost_samples = 0
        self._tail = b""
        self._searching = False
        self._missed = 0  # bad capsules in place since the last good one
        self._last: bytes | None = None
        self._last_q6 = self._index = self._epoch = 0
        self._advances: deque[int] = deque(maxlen=RATE_CAPSULES)
        self._turn_is_due = False
        self._places = np.arange(self.packet_samples, dtype=np.int32)

    @abstractmethod
    def _cabins(
        self, capsules: Bytes2, following: Bytes2, adjacent: NDArray[np.bool_]
    ) -> tuple[Ints, Ints | None]:
        """Distances in 1/4 mm, and by how many 1/65536 degree the optics move each angle back.

        capsules, following : one in each row; adjacent : whether the one follows the other at once.
        """

    def feed(self, data: bytes) -> Beams:
        """The beams of all capsules but the last of those that are now complete."""
        capsules, words, missed = self._split(self._tail + data)
        if not words:
            self.newest = None
            return NO_BEAMS
        first = self._last is None
        if self._last is not None:
            capsules.insert(0, self._last)
        pairs = _Pairs()
        for at, (word, gap) in enumerate(zip(words, missed, strict=True)):
            self._follow(pairs, at - first, word, gap)
        self._last = capsules[-1]
        newest = self._index + self.packet_samples - 1
        self.newest = Newest(newest, self._epoch, len(self._tail))
        return self._finish(pairs, capsules) if pairs.position else NO_BEAMS

    def flush(self) -> Beams:
        """Nothing: the last capsule of a stream has no angles."""
        return NO_BEAMS

    def _split(self, buffer: bytes) -> tuple[list[bytes], list[int], list[int]]:
        """Good capsules, their start words, and how many bad ones stood in place before each."""
        size, at = self.packet_bytes, 0
        capsules: list[bytes] = []
        words: list[int] = []
        missed: list[int] = []
        while True:
            count = 0 if self._searching else (len(buffer) - at) // size
            for word in self._headers(buffer, at, count):
                if word is None:
                    break
                capsules.append(buffer[at : at + size])
                words.append(word)
                missed.append(self._missed)
                self._missed = 0
                at += size
                count -= 1
            if count == 0 and not self._searching:
                break
            skip, found = self._resume(buffer, at)
            at += skip
            if not found:
                break
        self._tail = buffer[at:]
        return capsules, words, missed

    def _headers(self, buffer: bytes, at: int, count: int) -> list[int | None]:
        """Of each capsule the word with its start angle and S bit; None for one that is bad."""
        size = self.packet_bytes
        if count == 0:
            return []
        quads = np.frombuffer(buffer, "<u4", count * size // 4, at).reshape(count, size // 4)
        folded = np.bitwise_xor.reduce(quads, axis=1).tolist()
        result: list[int | None] = []
        for head, fold in zip(quads[:, 0].tolist(), folded, strict=True):
            fold ^= fold >> 16
            check = (fold ^ fold >> 8 ^ head ^ head >> 8) & 0xFF
            good = head & _SYNC_MASK == _SYNC and check == (head & 0x0F | head >> 4 & 0xF0)
            result.append(head >> 16 if good and head >> 16 & 0x7FFF < TURN_Q6 else None)
        return result

    def _resume(self, buffer: bytes, at: int) -> tuple[int, bool]:
        """Bytes to skip to the next good capsule, and whether it is there; else as far as is known.

        A capsule that is damaged in place has a good one right behind it. Otherwise bytes are
        missing: the next is where its sync, its checksum, and the sync of the one after it are.
        """
        size = self.packet_bytes
        if not self._searching:
            if len(buffer) - at < 2 * size:
                return 0, False
            self.bad_frames += 1
            if self._headers(buffer, at + size, 1) != [None]:
                self.bad_bytes += size
                self._missed += 1
                return size, True
            self._searching = True
        window = np.frombuffer(buffer, np.uint8, -1, at)
        synced = (window[:-1] & 0xF0 == 0xA0) & (window[1:] & 0xF0 == 0x50)
        for skip in synced.nonzero()[0].tolist():
            if len(window) - skip < size + 2:
                self.bad_bytes += skip
                return skip, False
            if synced[skip + size] and self._headers(buffer, at + skip, 1) != [None]:
                self.bad_bytes += skip
                self._searching = False
                return skip, True
        kept = 1 if len(window) else 0
        self.bad_bytes += len(window) - kept
        return len(window) - kept, False

    def _follow(self, pairs: _Pairs, position: int, word: int, gap: int) -> None:
        """Take a capsule's start word; `position` is that of the capsule before it, if there is."""
        start_q6, restarted = word & 0x7FFF, word >> 15
        if position >= 0 and restarted:
            # The device began anew: the capsule before it cannot be finished.
            self._begin_epoch()
        elif position >= 0:
            self._pair(pairs, position, start_q6, gap)
        self._last_q6 = start_q6

    def break_count(self) -> None:
        """Begin a new epoch: the caller knows that more is missing than angles can tell."""
        if self._last is not None:
            self._last = None
            self._begin_epoch()

    def _begin_epoch(self) -> None:
        """Give up the last capsule, which nothing can finish."""
        self._epoch += 1
        self._advances.clear()
        self._turn_is_due = False
        self._index += self.packet_samples
        self.lost_samples += self.packet_samples

    def _pair(self, pairs: _Pairs, position: int, start_q6: int, gap: int) -> None:
        samples, last_q6 = self.packet_samples, self._last_q6
        turned_q6 = (start_q6 - last_q6) % TURN_Q6
        lost, advance_q6 = self._lost(turned_q6, gap)
        row = len(pairs.position)
        pairs.position.append(position)
        pairs.start_q6.append(last_q6)
        pairs.advance_q6.append(advance_q6)
        pairs.index.append(self._index)
        pairs.epoch.append(self._epoch)
        pairs.adjacent.append(lost == 0)
        if self._turn_is_due:
            pairs.turn_starts.append((row, 0))
        if last_q6 + advance_q6 >= TURN_Q6:
            # The last beam before zero. Slamtec's SDK tests (angle + step) mod 360 < step, which is
            # the same but misses the turn where its rounded steps end just short of a zero.
            step_q16 = (advance_q6 << 10) // samples
            place = -(((last_q6 << 10) - TURN_Q16) // step_q16) - 1
            pairs.turn_starts.append((row, min(place, samples - 1)))
        self._turn_is_due = lost > 0 and last_q6 + advance_q6 < TURN_Q6 <= last_q6 + turned_q6
        self._advances.append(turned_q6)
        self._index += samples * (1 + lost)
        self.lost_samples += samples * lost

    def _lost(self, turned_q6: int, gap: int) -> tuple[int, int]:
        """Capsules missing within an angle, and the angle of the one that is there."""
        if len(self._advances) < RATE_KNOWN:
            return gap, turned_q6 // (gap + 1)
        rate_q6 = sorted(self._advances)[len(self._advances) // 2]
        if (gap == 0 and 2 * turned_q6 <= 3 * rate_q6) or rate_q6 == 0:
            return 0, turned_q6
        return max(round(turned_q6 / rate_q6) - 1, gap), rate_q6

    def _finish(self, pairs: _Pairs, capsules: list[bytes]) -> Beams:
        block = np.frombuffer(b"".join(capsules), np.uint8).reshape(-1, self.packet_bytes)
        before, after = block[:-1], block[1:]
        if len(pairs.position) < len(before):
            before, after = before[pairs.position], after[pairs.position]
        start, advance = np.array([pairs.start_q6, pairs.advance_q6], np.int32)[:, :, np.newaxis]
        angle = (start << 10) + (advance << 10) // self.packet_samples * self._places
        distance, back = self._cabins(before, after, np.array(pairs.adjacent))
        if back is not None:
            angle -= back
        angle >>= 10
        angle %= TURN_Q6
        starts = np.zeros(angle.shape, np.bool_)
        for turn in pairs.turn_starts:
            starts[turn] = True
        distance = distance.reshape(-1)
        index = np.array(pairs.index, np.int64)[:, np.newaxis] + self._places
        return Beams(
            index.reshape(-1),
            np.repeat(pairs.epoch, self.packet_samples),
            angle.reshape(-1),
            distance,
            (distance > 0) * np.uint8(SDK_QUALITY),
            starts.reshape(-1),
        )
