"""Lidar revolutions as `sensor_msgs/PointCloud2`: every beam with the time it was shot.

A `LaserScan` says only when its first beam was shot and takes the rest for evenly spaced; a motor
that does not turn evenly, and a beam left out, are lost in it. This layout keeps both.
"""

from __future__ import annotations

import struct

import numpy as np

from capture.cdr import HEADER, Fields, blocks
from capture.errors import LogError
from capture.log_reader import RawMessages
from capture.messages import header, serialised, typestore
from capture.stamps import NS_PER_S
from capture.streams import Scans
from capture.topics import POINTS_TYPE
from geometry import Floats, Stamps

_FLOAT32, _UINT32 = 7, 6  # sensor_msgs/PointField
_NUMBERS = ("x", "y", "z", "intensity", "range", "angle")
POINT = np.dtype([*((name, "<f4") for name in _NUMBERS), ("t", "<u4")])
"""One beam: metres, radians, `t` nanoseconds after the stamp."""
_KINDS = {**dict.fromkeys(_NUMBERS, _FLOAT32), "t": _UINT32}
MAX_OFFSET_NS = 2**32 - 1


def _fields_as_cdr() -> bytes:
    """The array of `PointField` as it stands in every message of this layout."""
    text = struct.pack("<I", len(_KINDS))
    for number, (name, kind) in enumerate(_KINDS.items()):
        text += b"\0" * (-len(text) % 4)
        text += struct.pack("<I", len(name) + 1) + name.encode() + b"\0"
        text += b"\0" * (-len(text) % 4)
        text += struct.pack("<IB3xI", 4 * number, kind, 1)
    return text


_FIELDS = np.frombuffer(_fields_as_cdr(), np.uint8)
_CLOUD: Fields = (
    *HEADER,
    ("height", "u4"),
    ("width", "u4"),
    ("fields", f"{_FIELDS.size}u1"),
    ("is_bigendian", "u1"),
    ("point_step", "u4"),
    ("row_step", "u4"),
    ("data", "u1[]"),
    ("is_dense", "u1"),
)


def point_cloud_message(
    stamp_ns: int,
    beam_t_ns: Stamps,
    range_m: Floats,
    bearing_rad: Floats,
    intensity: Floats,
    frame_id: str = "lidar",
) -> bytes:
    """One revolution, columns (n,) in the frame of the lidar, as CDR; numbers become float32.

    A beam without echo has range NaN and then no x, y either. Raises `ValueError` where a beam was
    shot before the stamp or more than 4.29 s after it.
    """
    offset_ns = beam_t_ns - stamp_ns
    if offset_ns.size and not 0 <= offset_ns.min() <= offset_ns.max() <= MAX_OFFSET_NS:
        raise ValueError(
            f"beams from {offset_ns.min()} to {offset_ns.max()} ns after the stamp; expected 0 to "
            f"{MAX_OFFSET_NS}: the stamp is that of the first beam"
        )
    points = np.zeros(range_m.size, POINT)
    points["x"], points["y"] = range_m * np.cos(bearing_rad), range_m * np.sin(bearing_rad)
    points["intensity"], points["range"], points["angle"] = intensity, range_m, bearing_rad
    points["t"] = offset_ns
    types = typestore().types
    field = types["sensor_msgs/msg/PointField"]
    message = types[POINTS_TYPE](
        header=header(stamp_ns, frame_id),
        height=1,
        width=points.size,
        fields=[
            field(name=name, offset=4 * number, datatype=kind, count=1)
            for number, (name, kind) in enumerate(_KINDS.items())
        ],
        is_bigendian=False,
        point_step=POINT.itemsize,
        row_step=points.nbytes,
        data=points.view(np.uint8).reshape(-1),
        is_dense=bool(np.isfinite(range_m).all()),
    )
    return serialised(message, POINTS_TYPE)


def point_cloud_columns(raw: RawMessages) -> Scans:
    """Revolutions of a topic of this layout, in order of their stamps, of equal ones the first.

    Raises `LogError` for clouds of another layout.
    """
    rows = _rows(raw)
    stamps = np.array(
        [int(row["sec"]) * NS_PER_S + int(row["nanosec"]) for row in rows], dtype=np.int64
    )
    stamps = np.where(stamps == 0, raw.log_t_ns, stamps)
    t_ns, first = np.unique(stamps, return_index=True)
    clouds = [rows[at]["data"].tobytes() for at in first.tolist()]
    sizes = np.array([len(cloud) // POINT.itemsize for cloud in clouds], dtype=np.int64)
    points = np.frombuffer(b"".join(clouds), POINT)
    columns = {name: points[name].astype(np.float64) for name in ("range", "angle", "intensity")}
    return Scans(
        t_ns,
        np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        np.repeat(t_ns, sizes) + points["t"],
        columns["range"],
        columns["angle"],
        columns["intensity"],
    )


def _rows(raw: RawMessages) -> list[np.void]:
    """One structured scalar per message, all sure to be of this layout."""
    try:
        rows = [row for block in blocks(raw.messages, _CLOUD) for row in block]
    except ValueError as err:
        raise _other_layout(raw.topic) from err
    for row in rows:
        beams = int(row["width"]) * int(row["height"])
        if (
            not np.array_equal(row["fields"], _FIELDS)
            or row["is_bigendian"]
            or row["point_step"] != POINT.itemsize
            or row["data"].size != beams * POINT.itemsize
        ):
            raise _other_layout(raw.topic)
    return rows


def _other_layout(topic: str) -> LogError:
    return LogError(
        f"topic {topic}: not every cloud has the fields {', '.join(_KINDS)} as trackside records "
        "them (docs/formats.md); leave it out with trackside import bag --topic points=none, then "
        "the LaserScan is taken"
    )
