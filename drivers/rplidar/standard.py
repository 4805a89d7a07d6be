"""Standard nodes (answer type 0x81): five bytes a beam, no sync word, no checksum.

A node is known only by three bits: S and its inverse in byte 0, C in byte 1. Once the decoder
stands on the nodes it takes each that has them right, unless its angle is more than `JUMP_Q6` from
the one before: two beams in a row cannot be (the optics move an angle by 8 degrees at most), but
one window of random bytes in four has the bits right. Where it fell off, it looks for the first
byte from which `SURE` nodes in a row agree with each other, or `SURE_IN_STEP` where that is a whole
number of nodes ahead. Source: reference/protocols.md A.6, A.10.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.beams import TURN_Q6, Beams, Newest, joined

NODE_BYTES = 5
JUMP_Q6 = 45 * 64
STEP_Q6 = 15 * 64
SURE = 16
SURE_IN_STEP = 4
WINDOW_BYTES = 4096
_WORD = np.dtype("<u2")
# numpy's own scalars: with Python's each operation on a short array takes a quarter longer.
_ONE, _JUMP, _TWO_JUMPS = np.uint16(1), np.uint16(JUMP_Q6), np.uint16(2 * JUMP_Q6)
_S, _QUALITY_SHIFT = np.uint8(1), np.uint8(2)
_RIGHT = 0x0102
"""Bits of the first two bytes plus one that are set just when S, its inverse and C are right."""


class StandardDecoder:
    """Bytes of standard nodes in, beams out."""

    packet_bytes = NODE_BYTES
    packet_samples = 1

    def __init__(self) -> None:
        self.newest: Newest | None = None
        self.bad_frames = self.bad_bytes = self.lost_samples = 0
        self._tail = b""
        self._locked = True  # the stream begins with a node, right behind its descriptor
        self._skipped = 0
        self._next_index = 0
        self._epoch = 0
        self._last_q6: int | None = None

    def feed(self, data: bytes) -> Beams:
        """The beams that these bytes complete."""
        return self._decode(self._tail + data, at_end=False)

    def flush(self) -> Beams:
        """The nodes at the end of a file for which too few followed to be certain."""
        return self._decode(self._tail, at_end=True)

    def break_count(self) -> None:
        """Begin a new epoch: the caller knows that bytes are missing."""
        self._epoch += 1
        self._last_q6 = None

    def _decode(self, buffer: bytes, *, at_end: bool) -> Beams:
        pieces: list[Beams] = []
        at, self.newest = 0, None
        while True:
            if not self._locked:
                found, self._locked = _search(buffer, at, self._skipped, at_end)
                self._skipped += found - at
                self.bad_bytes += found - at
                at = found
                if not self._locked:
                    break
                self._settle(buffer, at)
            nodes = (len(buffer) - at) // NODE_BYTES
            good = self._take(buffer, at, nodes, pieces)
            at += good * NODE_BYTES
            if good:
                bytes_after = len(buffer) - at
                self.newest = Newest(self._next_index - 1, self._epoch, bytes_after)
            if good == nodes:
                break
            self._locked, self._skipped = False, 0
            self.bad_frames += 1
        self._tail = buffer[at:]
        return joined(pieces)

    def _settle(self, buffer: bytes, at: int) -> None:
        """Account for what lies between the last good node and the one at `at`."""
        nodes, rest = divmod(self._skipped, NODE_BYTES)
        self.lost_samples += nodes + (rest > 0)
        self._next_index += nodes + (rest > 0)
        angle = _angle(buffer, at)
        if rest or (self._last_q6 is not None and _is_jump(angle - self._last_q6)):
            self._epoch += 1  # bytes are missing, and nobody counted them
        self._last_q6 = angle

    def _take(self, buffer: bytes, at: int, nodes: int, pieces: list[Beams]) -> int:
        """Append the beams from `at` up to the first bad node; how many they are."""
        if nodes == 0:
            return 0
        words = np.ndarray((nodes,), _WORD, buffer, at, (NODE_BYTES,))
        angles = np.ndarray((nodes,), _WORD, buffer, at + 1, (NODE_BYTES,)) >> _ONE
        bits = words + _ONE
        if int(np.bitwise_and.reduce(bits)) & _RIGHT != _RIGHT or angles.max() >= TURN_Q6:
            wrong = (bits & _RIGHT != _RIGHT) | (angles >= TURN_Q6)
            angles = angles[: int(wrong.argmax())]
        good = self._before_jump(angles)
        if good:
            pieces.append(self._beams(buffer, at, angles[:good]))
        return good

    def _before_jump(self, angles: NDArray[np.uint16]) -> int:
        """How many nodes come before the first that is too far from the one before it."""
        if len(angles) == 0 or (
            self._last_q6 is not None and _is_jump(int(angles[0]) - self._last_q6)
        ):
            return 0
        steps = angles[1:] - angles[:-1]  # modulo 2^16: what passes zero is looked at below
        for place in (steps + _JUMP > _TWO_JUMPS).nonzero()[0].tolist():
            if _is_jump(int(angles[place + 1]) - int(angles[place])):
                return int(place) + 1
        return len(angles)

    def _beams(self, buffer: bytes, at: int, angles: NDArray[np.uint16]) -> Beams:
        count = len(angles)
        flags = np.ndarray((count,), np.uint8, buffer, at, (NODE_BYTES,))
        distances = np.ndarray((count,), _WORD, buffer, at + 3, (NODE_BYTES,))
        first, self._next_index = self._next_index, self._next_index + count
        self._last_q6 = int(angles[-1])
        epochs = np.empty(count, np.int64)
        epochs.fill(self._epoch)  # a third of the time of np.full
        return Beams(
            np.arange(first, first + count),
            epochs,
            angles.astype(np.int32),
            distances.astype(np.int32),
            flags >> _QUALITY_SHIFT,
            (flags & _S).view(np.bool_),
        )


def _angle(buffer: bytes, at: int) -> int:
    return (buffer[at + 1] >> 1) | (buffer[at + 2] << 7)


def _is_jump(step_q6: int) -> bool:
    return JUMP_Q6 < step_q6 % TURN_Q6 < TURN_Q6 - JUMP_Q6


def _search(buffer: bytes, at: int, skipped: int, at_end: bool) -> tuple[int, bool]:
    """The first place from `at` on that is not refuted, and whether it is certain.

    skipped : bytes between the last good node and `at`, which tell the places that are in step;
    at_end : nothing will follow, so a place needs only not to be refuted.
    """
    while True:
        window = np.frombuffer(buffer, np.uint8, min(WINDOW_BYTES, len(buffer) - at), at)
        in_step = (np.arange(len(window)) + skipped) % NODE_BYTES == 0
        alive = np.where(in_step, _agree(window, SURE_IN_STEP), _agree(window, SURE))
        first = int(alive.argmax()) if alive.any() else len(window)
        nodes = (len(window) - first) // NODE_BYTES
        needed = SURE_IN_STEP if (skipped + first) % NODE_BYTES == 0 else SURE
        at, skipped = at + first, skipped + first
        if nodes >= needed:
            return at, True
        if first == 0 or len(window) < WINDOW_BYTES:
            return at, at_end and nodes > 0


def _agree(window: NDArray[np.uint8], count: int) -> NDArray[np.bool_]:
    """For each byte, whether the `count` nodes from there on, as far as they are there, agree."""
    size = len(window)
    room = size + NODE_BYTES * count
    plausible = np.ones(room, np.bool_)
    linked = np.ones(room, np.bool_)
    complete = max(size - NODE_BYTES + 1, 0)
    low = window[:complete].astype(np.int32)
    middle = window[1 : complete + 1].astype(np.int32)
    angle = (middle >> 1) | (window[2 : complete + 2].astype(np.int32) << 7)
    plausible[:complete] = ((low ^ low >> 1) & middle & 1 == 1) & (angle < TURN_Q6)
    steps = (angle[NODE_BYTES:] - angle[:-NODE_BYTES]) % TURN_Q6
    twice = (low[NODE_BYTES:] & low[:-NODE_BYTES] & 1) == 1
    pairs = max(complete - NODE_BYTES, 0)
    linked[:pairs] = ((steps <= STEP_Q6) | (steps >= TURN_Q6 - STEP_Q6)) & ~twice
    agreeing = plausible[:size].copy()
    for node in range(1, count):
        place = NODE_BYTES * node
        agreeing &= plausible[place : place + size]
        agreeing &= linked[place - NODE_BYTES : place - NODE_BYTES + size]
    return agreeing
