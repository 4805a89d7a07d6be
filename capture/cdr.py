"""Columns out of CDR messages, and messages out of columns, without an object per message.

ROS 2 serialises as OMG CDR (DDS-RTPS 2.3, chapter 10, XCDR1): four bytes of encapsulation, then
the fields in order, each aligned to its own size. Messages of one topic nearly always have one
layout, as their strings and arrays keep their length; numpy then reads them all as one table.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

Block = npt.NDArray[np.void]
"""A structured array, one row per message, one column per field of the message."""

Fields = Sequence[tuple[str, str]]
"""Names and types: `f8`, `36f8` (array of fixed length), `f4[]` (of its own length), `string`."""

HEADER: Fields = (("sec", "i4"), ("nanosec", "u4"), ("frame_id", "string"))

ODOMETRY: Fields = (
    *HEADER,
    ("child_frame_id", "string"),
    ("position", "3f8"),
    ("orientation", "4f8"),
    ("pose_covariance", "36f8"),
    ("linear", "3f8"),
    ("angular", "3f8"),
    ("twist_covariance", "36f8"),
)
IMU: Fields = (
    *HEADER,
    ("orientation", "4f8"),
    ("orientation_covariance", "9f8"),
    ("angular_velocity", "3f8"),
    ("angular_velocity_covariance", "9f8"),
    ("linear_acceleration", "3f8"),
    ("linear_acceleration_covariance", "9f8"),
)
MAGNETIC_FIELD: Fields = (*HEADER, ("magnetic_field", "3f8"), ("covariance", "9f8"))
LASER_SCAN: Fields = (
    *HEADER,
    *((f"angle_{name}", "f4") for name in ("min", "max", "increment")),
    ("time_increment", "f4"),
    ("scan_time", "f4"),
    ("range_min", "f4"),
    ("range_max", "f4"),
    ("ranges", "f4[]"),
    ("intensities", "f4[]"),
)
RANGE_BEARING_ARRAY: Fields = (
    *HEADER,
    ("landmark_id", "i4[]"),
    ("range_m", "f8[]"),
    ("bearing_rad", "f8[]"),
)
ACKERMANN_DRIVE: Fields = (
    *HEADER,
    *((name, "f4") for name in ("steering_angle", "steering_angle_velocity", "speed")),
    *((name, "f4") for name in ("acceleration", "jerk")),
)
VESC_STATE: Fields = (
    *HEADER,
    *((name, "f8") for name in ("temp_fet", "temp_motor", "current_motor", "current_input")),
    *((name, "f8") for name in ("avg_id", "avg_iq", "duty_cycle", "speed", "voltage_input")),
    *((name, "f8") for name in ("charge_drawn", "charge_regen", "energy_drawn", "energy_regen")),
    *((name, "i4") for name in ("displacement", "distance_traveled", "fault_code")),
)

_ENCAPSULATION = 4
_BLOCK = 4096


def blocks(messages: Sequence[bytes], fields: Fields) -> Iterator[Block]:
    """Runs of consecutive messages of one layout, each as a structured array.

    Raises `ValueError` when a message is too short for its fields.
    """
    start = 0
    while start < len(messages):
        layout, counts = _layout(messages[start], fields)
        stop = start + 1
        while stop < min(len(messages), start + _BLOCK) and len(messages[stop]) == layout.itemsize:
            stop += 1
        block = np.frombuffer(b"".join(messages[start:stop]), layout)
        same = np.all([block[count] == block[count][0] for count in counts], axis=0)
        changed = np.flatnonzero(~np.atleast_1d(same))
        run = int(changed[0]) if changed.size else stop - start
        yield block[:run]
        start += run


def filled(template: bytes, fields: Fields, columns: Mapping[str, npt.ArrayLike]) -> list[bytes]:
    """Messages like `template` with the values of `columns`, (n, ...) each, put in."""
    n = len(np.asarray(next(iter(columns.values()))))
    layout, _ = _layout(template, fields)
    block = np.frombuffer(bytearray(template) * n, layout)
    for name, values in columns.items():
        block[name] = values
    data, size = block.tobytes(), layout.itemsize
    return [data[start : start + size] for start in range(0, n * size, size)]


def _layout(message: bytes, fields: Fields) -> tuple[np.dtype[np.void], list[str]]:
    """The place of each field in `message`, and the names of the columns that hold lengths."""
    if len(message) <= _ENCAPSULATION or message[0] != 0 or message[1] > 1:
        raise ValueError("no plain CDR message")
    endian = "<" if message[1] else ">"
    places: dict[str, tuple[np.dtype[np.generic], int]] = {}
    counts = []
    at = _ENCAPSULATION
    for name, kind in fields:
        length: tuple[int, ...] = (int(kind[:-2]),) if kind[:-2].isdecimal() else ()
        if kind == "string" or kind.endswith("[]"):
            at = _aligned(at, 4)
            length = _unpacked(endian + "I", message, at)
            places[f"#{name}"] = np.dtype(endian + "u4"), at
            counts.append(f"#{name}")
            at += 4
        if kind == "string":
            at += length[0]
            continue
        item = np.dtype((endian + kind.removesuffix("[]")[-2:], length))
        if item.itemsize:
            at = _aligned(at, item.base.itemsize)
        places[name] = item, at
        at += item.itemsize
    if at > len(message):
        raise ValueError(f"a message of {len(message)} bytes ends within its fields")
    layout = {
        "names": list(places),
        "formats": [item for item, _ in places.values()],
        "offsets": [offset for _, offset in places.values()],
        "itemsize": len(message),
    }
    return np.dtype(layout), counts  # type: ignore[call-overload]  # numpy's stub wants literals


def _unpacked(code: str, message: bytes, at: int) -> tuple[int, ...]:
    try:
        return struct.unpack_from(code, message, at)
    except struct.error as err:
        raise ValueError(f"a message of {len(message)} bytes ends within its fields") from err


def _aligned(at: int, size: int) -> int:
    """The next place that is a multiple of `size` after the encapsulation."""
    return at + (_ENCAPSULATION - at) % size
