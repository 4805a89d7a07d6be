"""Commands to a VESC: what moves the motor and the servo, encoded for its firmware.

None of them is answered. Every one but the servo's feeds the VESC's own watchdog. (reference B.3,
B.4, B.9)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from drivers.errors import DeviceFaultError
from drivers.vesc.firmware import Firmware
from drivers.vesc.framing import encode_frame

Kind = Literal["duty", "current", "brake", "handbrake", "rpm", "servo", "alive"]

_SAME_IDS: dict[Kind, int] = {"duty": 5, "current": 6, "brake": 7, "rpm": 8}
_SCALES: dict[Kind, float] = {
    "duty": 1e5,
    "current": 1e3,
    "brake": 1e3,
    "handbrake": 1e3,
    "rpm": 1.0,
    "servo": 1e3,
}


@dataclass(frozen=True)
class Command:
    """One command as bytes on the line; make it with `encode_command`."""

    kind: Kind
    value: float
    frame: bytes


def encode_command(firmware: Firmware, kind: Kind, value: float = 0.0) -> Command:
    """The command for this very firmware.

    value : duty -1 to 1, currents in A, rpm in ERPM (electrical, mechanical times pole pairs),
    servo 0 to 1; `alive` has none.
    Raises `DeviceFaultError` where the firmware has no such command or is unknown, and `ValueError`
    for a value that is no number or does not fit.
    """
    number = _packet_id(firmware, kind)
    if kind == "alive":
        return Command(kind, value, encode_frame(bytes((number,))))
    if not math.isfinite(value):
        raise ValueError(f"{kind} {value} is no number")
    # The nearest step: truncated as in the firmware, a duty of 0.00007 would become 0.00006.
    scaled, size = round(value * _SCALES[kind]), 2 if kind == "servo" else 4
    try:
        data = scaled.to_bytes(size, "big", signed=True)
    except OverflowError as err:
        raise ValueError(f"{kind} {value} does not fit in {size} bytes") from err
    return Command(kind, value, encode_frame(bytes((number,)) + data))


def _packet_id(firmware: Firmware, kind: Kind) -> int:
    if kind in _SAME_IDS:
        return _SAME_IDS[kind]
    ids = firmware.command_ids()
    moved: dict[Kind, int | None]
    moved = {"servo": ids.servo, "alive": ids.alive, "handbrake": ids.handbrake}
    number = moved[kind]
    if number is None:
        raise DeviceFaultError(
            f"VESC firmware {firmware} has no {kind} (there, its id starts a detection that turns "
            "the motor); use brake, or update to 3.07 or later"
        )
    return number
