"""What GET_VALUES and GET_VALUES_SELECTIVE answer, in seven layouts, as one value in SI units.

Firmware appended fields over the years, once it replaced the first ones: the length of the reply,
checked against the version, tells which are there. (vedderb/bldc `commands.c`; reference B.6, B.7)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from drivers.errors import ProtocolError
from drivers.vesc.firmware import Firmware
from drivers.vesc.layout import DEGREES, PER_HOUR, Field, Layout, layout_of, masked
from drivers.vesc.requests import ReadId

NAN = math.nan


@dataclass(frozen=True)
class VescValues:
    """The state of a VESC at `t_ns`; NaN or None where its firmware or the mask leaves a field out.

    t_ns : monotonic, ours: a VESC has no clock; uncertainty_ns : the true moment is at most so far
    from it. duty -1 to 1; erpm : electrical turns a minute, signed; tachometer : six counts per
    electrical turn, signed, i32 that wraps; tachometer_abs counts up in both directions. The
    average currents are of the time since anybody's last request. Temperature inputs with nothing
    connected read nonsense (-94.8): no error. mosfet_4 to 6 and board are of firmware to 3.00.
    """

    t_ns: int
    uncertainty_ns: int
    fet_celsius: float = NAN
    motor_celsius: float = NAN
    motor_current_a: float = NAN
    input_current_a: float = NAN
    d_current_a: float = NAN
    q_current_a: float = NAN
    duty: float = NAN
    erpm: float = NAN
    input_voltage_v: float = NAN
    charge_drawn_coulomb: float = NAN
    charge_regained_coulomb: float = NAN
    energy_drawn_joule: float = NAN
    energy_regained_joule: float = NAN
    tachometer: int | None = None
    tachometer_abs: int | None = None
    fault: int | None = None
    position_rad: float = NAN
    controller_id: int | None = None
    mosfet_1_celsius: float = NAN
    mosfet_2_celsius: float = NAN
    mosfet_3_celsius: float = NAN
    d_voltage_v: float = NAN
    q_voltage_v: float = NAN
    status: int | None = None
    mosfet_4_celsius: float = NAN
    mosfet_5_celsius: float = NAN
    mosfet_6_celsius: float = NAN
    board_celsius: float = NAN

    @property
    def timed_out(self) -> bool | None:
        """Whether the VESC's watchdog has stopped the motor; None where it does not tell."""
        return None if self.status is None else bool(self.status & 1)

    @property
    def kill_switch(self) -> bool | None:
        """Whether the kill switch is active; None where the VESC does not tell."""
        return None if self.status is None else bool(self.status & 2)


def _celsius(name: str) -> Field:
    return Field(f"{name}_celsius", "h", 10.0)


_CURRENTS = (Field("motor_current_a", "i", 100.0), Field("input_current_a", "i", 100.0))
_DRIVE = (
    Field("duty", "h", 1000.0),
    Field("erpm", "i", 1.0),
    Field("input_voltage_v", "h", 10.0),
    Field("charge_drawn_coulomb", "i", 1e4 * PER_HOUR),
    Field("charge_regained_coulomb", "i", 1e4 * PER_HOUR),
    Field("energy_drawn_joule", "i", 1e4 * PER_HOUR),
    Field("energy_regained_joule", "i", 1e4 * PER_HOUR),
    Field("tachometer", "i", None),
    Field("tachometer_abs", "i", None),
    Field("fault", "B", None),
)
VALUE_GROUPS: tuple[tuple[Field, ...], ...] = (
    (_celsius("fet"),),
    (_celsius("motor"),),
    *((field,) for field in _CURRENTS),
    (Field("d_current_a", "i", 100.0),),
    (Field("q_current_a", "i", 100.0),),
    *((field,) for field in _DRIVE),
    (Field("position_rad", "i", 1e6 / DEGREES),),
    (Field("controller_id", "B", None),),
    tuple(_celsius(f"mosfet_{number}") for number in (1, 2, 3)),
    (Field("d_voltage_v", "i", 1e3),),
    (Field("q_voltage_v", "i", 1e3),),
    (Field("status", "B", None),),
)
"""Since 3.07, in the order of the mask's bits and of the whole reply."""

OLD_FIELDS = (
    *(_celsius(f"mosfet_{number}") for number in range(1, 7)),
    _celsius("board"),
    *_CURRENTS,
    *_DRIVE,
)
"""To 3.00."""

_OLD = layout_of(OLD_FIELDS)
_NEW = {
    1 + layout.size: layout
    for bits in (16, 17, 18, 19, 21, 22)
    for layout in [masked(VALUE_GROUPS, (1 << bits) - 1)]
}
OLD_BYTES, LONGEST_BYTES = 1 + _OLD.size, max(_NEW)
_SELECTED_START = 5


def decode_values(
    payload: bytes, firmware: Firmware, t_ns: int = 0, uncertainty_ns: int = 0
) -> VescValues:
    """The state in a reply to GET_VALUES or GET_VALUES_SELECTIVE.

    Raises `ProtocolError` for lengths that this firmware never sends, and for other replies.
    """
    layout, start = _layout_in(payload, firmware)
    if layout is None:
        raise ProtocolError(
            f"{len(payload)} bytes are no state of a VESC with firmware {firmware} (expected "
            f"{layout_lengths(firmware)}): {payload.hex(' ')}"
        )
    if start == 1 and not firmware.is_old:  # the order of VescValues, and three times as fast
        return VescValues(t_ns, uncertainty_ns, *layout.numbers(payload, start))
    return VescValues(t_ns, uncertainty_ns, **layout.named(payload, start))


def layout_lengths(firmware: Firmware) -> str:
    """The lengths that a GET_VALUES reply of this firmware may have, for people."""
    if firmware.is_old:
        return f"{OLD_BYTES} bytes"
    return ", ".join(str(size) for size in sorted(_NEW)) + " bytes or more"


def _layout_in(payload: bytes, firmware: Firmware) -> tuple[Layout | None, int]:
    """The layout of a reply and where it begins; None if it is no such reply."""
    number = payload[0] if payload else -1
    if number == ReadId.VALUES:
        if firmware.is_old:
            return (_OLD if len(payload) == OLD_BYTES else None), 1
        return _NEW.get(min(len(payload), LONGEST_BYTES)), 1
    if number == ReadId.VALUES_SELECTIVE and len(payload) >= _SELECTED_START:
        layout = selected(int.from_bytes(payload[1:_SELECTED_START], "big"))
        if len(payload) == _SELECTED_START + layout.size:
            return layout, _SELECTED_START
    return None, 1


@lru_cache(maxsize=8)
def selected(mask: int) -> Layout:
    """The layout of a selective reply behind its mask."""
    return masked(VALUE_GROUPS, mask)
