"""Names of the fault codes that a VESC reports (vedderb/bldc `datatypes.h`; reference B.8)."""

from __future__ import annotations

FAULT_NAMES = (
    "none",
    "over-voltage",
    "under-voltage",
    "gate driver",
    "absolute over-current",
    "over-temperature of the FETs",
    "over-temperature of the motor",
    "gate driver over-voltage",
    "gate driver under-voltage",
    "under-voltage of the processor",
    "booted from the watchdog",
    "encoder SPI",
    "encoder sin/cos amplitude too low",
    "encoder sin/cos amplitude too high",
    "flash corruption",
    "high offset of current sensor 1",
    "high offset of current sensor 2",
    "high offset of current sensor 3",
    "unbalanced currents",
    "brake",
    "resolver loss of tracking",
    "resolver degradation of signal",
    "resolver loss of signal",
    "app configuration corrupt",
    "motor configuration corrupt",
    "encoder without magnet",
    "encoder magnet too strong",
    "phase filter",
    "encoder",
    "low-voltage output",
    "encoder slip",
    "overspeed",
    "underspeed",
    "absolute overspeed",
)
"""By code; 0 to 6 exist in every firmware."""


def fault_name(code: int) -> str:
    """What a fault code says; a number without a name is told as it is."""
    return FAULT_NAMES[code] if 0 <= code < len(FAULT_NAMES) else f"fault {code}"
