"""Ultra capsules (answer type 0x84; Boost, Sensitivity, Stability): 132 bytes, 32 cabins of 3.

A cabin holds one distance on a scale that grows coarser with distance, and two predictions: how far
the second beam is from this distance and the third from that of the next cabin. How far the optics
move an angle follows from the distance. Source: reference/protocols.md A.8 (SDK 2.1.0, bit for
bit).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.capsules import HEADER_BYTES, Bytes2, CapsuleDecoder, Ints

CABINS = 32
SCALE = ((3328, 16384, 4), (1792, 4096, 3), (1280, 2048, 2), (512, 512, 1), (0, 0, 0))
"""Of each part of the scale: first code, its millimetres, and the shift of what lies above it."""
NO_ECHO = (-512, 511)
"""Predictions that say that a beam came back with nothing."""
FAR_MM = 98361 // 4 + 1
"""From here on the optics' correction does not change."""


def scale_decode(code: int) -> tuple[int, int]:
    """Millimetres and shift of a 12-bit code."""
    first, base, shift = next(part for part in SCALE if code >= part[0])
    return base + (code - first << shift), shift


def optics_q16(distance_mm: int) -> int:
    """How far the optics move an angle back, in 1/65536 degree, in the SDK's own arithmetic."""
    distance_q2 = 4 * distance_mm
    if distance_q2 < 200:
        off = int(7.5 * math.pi * 65536 / 180)
    else:
        near = 98361 // distance_q2
        off = int(8 * math.pi * 65536 / 180) - (near << 6) - near**3 // 98304
    return int(off * 180 / 3.14159265)


_MM, _SHIFT = np.array([scale_decode(code) for code in range(4096)], np.int32).T.copy()
OPTICS_Q16 = np.array([optics_q16(mm) for mm in range(FAR_MM + 1)], np.int32)
"""`optics_q16` of each millimetre; its last value holds for all distances beyond."""


class UltraDecoder(CapsuleDecoder):
    """Bytes of ultra capsules in, beams out."""

    packet_bytes = 132
    packet_samples = 3 * CABINS

    def _cabins(
        self, capsules: Bytes2, following: Bytes2, adjacent: NDArray[np.bool_]
    ) -> tuple[Ints, Ints]:
        words = np.empty((len(capsules), CABINS + 1), "<i4")
        words[:, :-1] = capsules[:, HEADER_BYTES:].view("<i4")
        words[:, -1:] = following[:, HEADER_BYTES : HEADER_BYTES + 4].view("<i4")
        code = words & 0xFFF
        mm, shift = _MM.take(code), _SHIFT.take(code)
        major, shift_1, next_major, shift_2 = mm[:, :-1], shift[:, :-1], mm[:, 1:], shift[:, 1:]
        empty = major == 0
        predict_1, predict_2 = words[:, :-1] << 10 >> 22, words[:, :-1] >> 22
        base_1, shift_1 = np.where(empty, (next_major, shift_2), (major, shift_1))
        beams = np.empty((len(capsules), CABINS, 3), np.int32)
        beams[:, :, 0] = major
        beams[:, :, 1] = _predicted(base_1, predict_1, shift_1)
        beams[:, :, 2] = _predicted(next_major, predict_2, shift_2)
        if not adjacent.all():
            # What the last cabin's predictions start from was lost with the next capsule.
            beams[~adjacent, -1, 1] *= ~empty[~adjacent, -1]
            beams[~adjacent, -1, 2] = 0
        distance_mm = beams.reshape(-1, self.packet_samples)
        return distance_mm << 2, OPTICS_Q16.take(distance_mm, mode="clip")


def _predicted(base_mm: Ints, predict: Ints, shift: Ints) -> Ints:
    """Base and prediction; 0 where there was no echo, or where damaged numbers fall below it."""
    # -512 and 511 are the ends of ten signed bits: one test finds both.
    some = (predict + 512) % 1023 != 0
    mm: Ints = np.maximum(base_mm + (predict << shift), 0) * some
    return mm
