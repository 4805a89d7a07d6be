"""Dense capsules (answer type 0x85): 84 bytes, 40 distances in millimetres, angles as they are.

Not offered by an A2M8; S1, A3 and newer A models do. Source: reference/protocols.md A.9.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.rplidar.capsules import HEADER_BYTES, Bytes2, CapsuleDecoder, Ints


class DenseDecoder(CapsuleDecoder):
    """Bytes of dense capsules in, beams out."""

    packet_bytes = 84
    packet_samples = 40

    def _cabins(
        self,
        capsules: Bytes2,
        following: Bytes2,  # noqa: ARG002  the base's signature
        adjacent: NDArray[np.bool_],  # noqa: ARG002
    ) -> tuple[Ints, None]:
        cabins = capsules[:, HEADER_BYTES:].astype(np.int32)
        return (cabins[:, 0::2] | cabins[:, 1::2] << 8) << 2, None
