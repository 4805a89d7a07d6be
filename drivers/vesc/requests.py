"""Questions to a VESC: all that a logger may send, and none of it changes anything.

A `ReadRequest` has an id of `ReadId` or does not come into being.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from drivers.errors import DeviceFaultError
from drivers.vesc.firmware import FW_VERSION, Firmware
from drivers.vesc.framing import encode_frame


class ReadId(IntEnum):
    """Packet ids that ask; each is the same in every firmware that has it (reference B.3)."""

    FW_VERSION = FW_VERSION
    VALUES = 4
    SETUP = 47
    VALUES_SELECTIVE = 50
    SETUP_SELECTIVE = 51
    IMU = 65


_MASK_BYTES = {ReadId.VALUES_SELECTIVE: 4, ReadId.SETUP_SELECTIVE: 4, ReadId.IMU: 2}
_SINCE = {
    ReadId.SETUP: (3, 48),
    ReadId.VALUES_SELECTIVE: (3, 48),
    ReadId.SETUP_SELECTIVE: (3, 48),
    ReadId.IMU: (3, 52),
}

ODOMETRY_MASK = 0x0000E180
"""ERPM, input voltage, both tachometers, fault: 25 bytes instead of 79 on the line."""


@dataclass(frozen=True)
class ReadRequest:
    """A question; `mask` selects fields where the question takes one.

    Raises `ValueError` for a mask that is missing, too much, or too wide.
    """

    id: ReadId
    mask: int | None = None

    def __post_init__(self) -> None:
        """Check that it is one of the questions there are."""
        size = _MASK_BYTES.get(ReadId(self.id), 0)
        if (self.mask is None) != (size == 0):
            raise ValueError(f"{self.id.name} takes {'a' if size else 'no'} mask")
        if self.mask is not None and not 0 < self.mask < 1 << 8 * size:
            raise ValueError(f"the mask of {self.id.name} has {size} bytes, not {self.mask:#x}")

    @property
    def frame(self) -> bytes:
        """The bytes on the line."""
        mask = b"" if self.mask is None else self.mask.to_bytes(_MASK_BYTES[self.id], "big")
        return encode_frame(bytes((self.id,)) + mask)

    def check(self, firmware: Firmware) -> None:
        """Raise `DeviceFaultError` if this firmware does not know the question."""
        since = _SINCE.get(self.id, (0, 0))
        if firmware.version < since:
            raise DeviceFaultError(
                f"VESC firmware {firmware} does not answer {self.id.name} (from "
                f"{since[0]}.{since[1]:02d}); ask for all values, or update the firmware"
            )


ASK_VERSION = ReadRequest(ReadId.FW_VERSION)
ASK_VALUES = ReadRequest(ReadId.VALUES)
ASK_SETUP = ReadRequest(ReadId.SETUP)
