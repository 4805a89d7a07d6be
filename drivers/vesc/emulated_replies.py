"""What an emulated VESC answers, as payloads; which fields a firmware sends is a table here."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import fields

from drivers.vesc.firmware import Firmware
from drivers.vesc.layout import DEGREES, Field
from drivers.vesc.setup_values import SETUP_GROUPS, STANDARD_GRAVITY_M_S2, VescImu
from drivers.vesc.values import OLD_FIELDS, VALUE_GROUPS, VescValues

ERPM_PER_M_S = 4614.0

_GROUPS_SINCE = {
    (3, 7): 16,
    (3, 34): 17,
    (3, 40): 18,
    (3, 48): 19,
    (3, 60): 21,
    (5, 3): 22,
}
"""How many groups of fields a GET_VALUES reply holds, by firmware."""


def encode_version(firmware: Firmware) -> bytes:
    """The FW_VERSION reply, as long as in that firmware."""
    payload = bytes((0, firmware.major, firmware.minor))
    if firmware.version >= (3, 40):
        payload += firmware.hardware.encode("ascii") + b"\0" + bytes.fromhex(firmware.uuid)
    if firmware.version >= (3, 67):
        payload += bytes((bool(firmware.paired),))
    if firmware.version >= (5, 0):
        payload += bytes((firmware.beta or 0,))
    if firmware.version >= (6, 0):  # hardware type, custom configurations, flags, name, CRC
        payload += bytes((0, 0, 0, 0, 0)) + b"VESC\0" + bytes(4)
    return payload


def encode_values(values: VescValues, firmware: Firmware) -> bytes:
    """The GET_VALUES reply."""
    if firmware.is_old:
        return b"\x04" + _packed(OLD_FIELDS, values)
    count = max(count for since, count in _GROUPS_SINCE.items() if firmware.version >= since)
    return b"\x04" + _packed(_chosen(VALUE_GROUPS, (1 << count) - 1), values)


def encode_selected(values: VescValues, mask: int) -> bytes:
    """The GET_VALUES_SELECTIVE reply."""
    return b"\x32" + mask.to_bytes(4, "big") + _packed(_chosen(VALUE_GROUPS, mask), values)


def encode_setup(values: VescValues, mask: int | None) -> bytes:
    """The GET_VALUES_SETUP reply or, with a mask, its selective form; speed as F1/10 cars have."""
    known = {field.name: getattr(values, field.name) for field in fields(values)}
    known["speed_m_s"] = values.erpm / ERPM_PER_M_S
    for name, counter in (("distance_m", "tachometer"), ("distance_abs_m", "tachometer_abs")):
        known[name] = (known[counter] or 0) * 10.0 / ERPM_PER_M_S
    start = b"\x2f" if mask is None else b"\x33" + mask.to_bytes(4, "big")
    chosen = _chosen(SETUP_GROUPS, (1 << len(SETUP_GROUPS)) - 1 if mask is None else mask)
    return start + b"".join(_number(field, known.get(field.name)) for field in chosen)


def encode_imu(imu: VescImu, mask: int) -> bytes:
    """The GET_IMU_DATA reply, in g and deg/s."""
    numbers = [getattr(imu, field.name) for field in fields(imu)]
    sent = (
        numbers[:3]
        + [number / STANDARD_GRAVITY_M_S2 for number in numbers[3:6]]
        + [number / DEGREES for number in numbers[6:9]]
        + numbers[9:16]
    )
    chosen = [number for bit, number in enumerate(sent) if mask >> bit & 1]
    floats = struct.pack(f">{len(chosen)}f", *chosen)
    return b"\x41" + mask.to_bytes(2, "big") + floats + bytes((imu.controller_id or 0,))


def _chosen(groups: Sequence[tuple[Field, ...]], mask: int) -> list[Field]:
    return [field for bit, group in enumerate(groups) if mask >> bit & 1 for field in group]


def _packed(chosen: Sequence[Field], values: VescValues) -> bytes:
    return b"".join(_number(field, getattr(values, field.name)) for field in chosen)


def _number(field: Field, value: float | int | None) -> bytes:
    """One field as sent; what is not known is sent as zero."""
    known = value is not None and not math.isnan(value)
    scaled = round(value * (field.divisor or 1.0)) if value is not None and known else 0
    return struct.pack(">" + field.code, scaled)
