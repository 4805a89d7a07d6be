"""Legacy capsules (answer type 0x82, "express"): 84 bytes, 16 cabins of two beams.

The correction of each angle is an *unsigned* number of 1/8 degrees: the manual's "top digit is the
sign" is wrong by 8 to 12 degrees (proof: reference/protocols.md A.7).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.capsules import HEADER_BYTES, Bytes2, CapsuleDecoder, Ints

CABINS, CABIN_BYTES = 16, 5


class LegacyDecoder(CapsuleDecoder):
    """Bytes of legacy capsules in, beams out."""

    packet_bytes = 84
    packet_samples = 2 * CABINS

    def _cabins(
        self,
        capsules: Bytes2,
        following: Bytes2,  # noqa: ARG002  the base's signature
        adjacent: NDArray[np.bool_],  # noqa: ARG002
    ) -> tuple[Ints, Ints]:
        cabins = capsules[:, HEADER_BYTES:].astype(np.int32).reshape(-1, CABINS, CABIN_BYTES)
        words = cabins[:, :, 0:4:2] | cabins[:, :, 1:4:2] << 8
        offsets = np.stack([cabins[:, :, 4] & 0x0F, cabins[:, :, 4] >> 4], axis=2)
        back_q3 = (offsets | (words & 3) << 4).reshape(-1, self.packet_samples)
        # A word is millimetres << 2 with two bits of the angle below: without them it is 1/4 mm.
        return words & ~3, back_q3 << 13
