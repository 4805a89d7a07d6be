"""The device's side of the scan answers: beams to nodes and capsules, for the emulator.

All take distances in 1/4 mm (0: no echo) and angles in 1/64 degree clockwise, as `beams` has them.
Source: reference/protocols.md A.6-A.9, read backwards.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.beams import TURN_Q6
from drivers.rplidar.ultra import CABINS, NO_ECHO, SCALE, scale_decode

Ints = NDArray[np.int64]


def encode_nodes(
    angle_q6: Ints, distance_q2: Ints, quality: Ints, start: NDArray[np.bool_]
) -> bytes:
    """Standard nodes, five bytes each."""
    nodes = np.empty((len(angle_q6), 5), np.uint8)
    angle = (angle_q6 % TURN_Q6) << 1 | 1
    nodes[:, 0] = quality << 2 | np.where(start, 1, 2)
    nodes[:, 1], nodes[:, 2] = angle & 0xFF, angle >> 8
    nodes[:, 3], nodes[:, 4] = distance_q2 & 0xFF, distance_q2 >> 8
    return nodes.tobytes()


def encode_legacy(start_q6: int, restart: bool, distance_q2: Ints, back_q3: Ints) -> bytes:
    """A legacy capsule of 32 beams; `back_q3`: by how many 1/8 degrees each angle is moved back."""
    words = (distance_q2 >> 2) << 2 | back_q3 >> 4
    cabins = np.empty((16, 5), np.uint8)
    cabins[:, 0], cabins[:, 1] = words[0::2] & 0xFF, words[0::2] >> 8
    cabins[:, 2], cabins[:, 3] = words[1::2] & 0xFF, words[1::2] >> 8
    cabins[:, 4] = back_q3[0::2] & 0x0F | (back_q3[1::2] & 0x0F) << 4
    return _capsule(start_q6, restart, cabins.tobytes())


def encode_dense(start_q6: int, restart: bool, distance_q2: Ints) -> bytes:
    """A dense capsule of 40 beams."""
    return _capsule(start_q6, restart, (distance_q2 >> 2).astype("<u2").tobytes())


def encode_ultra(start_q6: int, restart: bool, distance_q2: Ints) -> bytes:
    """An ultra capsule of 96 beams; `distance_q2` has one more, the first of the next capsule.

    A beam that its prediction cannot reach is sent as one without echo.
    """
    distance_mm = distance_q2 >> 2
    code = np.array([_scale_encode(mm) for mm in distance_mm[::3].tolist()])
    scale = np.array([scale_decode(int(one)) for one in code])
    major, shift = scale[:-1].T
    next_major, next_shift = scale[1:].T
    base = np.where(major == 0, next_major, major)
    base_shift = np.where(major == 0, next_shift, shift)
    predict_1 = _predict(distance_mm[1:-1:3], base, base_shift)
    predict_2 = _predict(distance_mm[2:-1:3], next_major, next_shift)
    words = code[:CABINS] | (predict_1 & 0x3FF) << 12 | (predict_2 & 0x3FF) << 22
    return _capsule(start_q6, restart, words.astype("<u4").tobytes())


def _scale_encode(distance_mm: int) -> int:
    """The code of the scale at or below a distance."""
    first, base, shift = next(part for part in SCALE if distance_mm >= part[1])
    return min(first + (distance_mm - base >> shift), 0xFFF)


def _predict(distance_mm: Ints, base_mm: Ints, shift: Ints) -> Ints:
    steps = distance_mm - base_mm >> shift
    reachable = (distance_mm > 0) & (steps > NO_ECHO[0]) & (steps < NO_ECHO[1])
    # A prediction that would decode to nothing is nothing.
    reachable &= base_mm + (steps << shift) > 0
    return np.where(reachable, steps, NO_ECHO[0])


def _capsule(start_q6: int, restart: bool, cabins: bytes) -> bytes:
    body = (start_q6 | restart << 15).to_bytes(2, "little") + cabins
    check = int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))
    return bytes((0xA0 | check & 0x0F, 0x50 | check >> 4)) + body
