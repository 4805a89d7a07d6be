"""How the fields of a VESC's replies lie behind one another: names, types and scales.

Three replies are built alike: fields in a fixed order, all of them or those of a mask, numbers
scaled to integers, big endian. A `Layout` is one such selection, ready to decode.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from drivers.errors import ProtocolError

Number: TypeAlias = Any
"""int or float, as the table of fields says for each; no type can."""

DEGREES = math.pi / 180.0
PER_HOUR = 1.0 / 3600.0


class Field(NamedTuple):
    """A number in a reply: code as in `struct`; the integer divided by `divisor` is SI.

    divisor : None for what is an integer by nature; padding has no name.
    """

    name: str
    code: str
    divisor: float | None


@dataclass(frozen=True)
class Layout:
    """Fields that follow one another without a gap."""

    fields: tuple[Field, ...]
    packing: struct.Struct
    divisors: tuple[float | None, ...]
    names: tuple[str, ...]

    @property
    def size(self) -> int:
        """Bytes that the fields take."""
        return self.packing.size

    def numbers(self, payload: bytes, start: int) -> list[Number]:
        """The fields' values in SI, in their order."""
        raw: tuple[int, ...] = self.packing.unpack_from(payload, start)
        return [
            number if divisor is None else number / divisor
            for number, divisor in zip(raw, self.divisors, strict=True)
        ]

    def named(self, payload: bytes, start: int) -> dict[str, Number]:
        """The same by name."""
        return dict(zip(self.names, self.numbers(payload, start), strict=True))


def layout_of(fields: Sequence[Field]) -> Layout:
    """The layout of these fields in this order."""
    return Layout(
        tuple(fields),
        struct.Struct(">" + "".join(field.code for field in fields)),
        tuple(field.divisor for field in fields),
        tuple(field.name for field in fields),
    )


def masked(groups: Sequence[tuple[Field, ...]], mask: int) -> Layout:
    """The layout of the groups whose bit is set. Raises `ProtocolError` for bits of no group."""
    if not 0 <= mask < 1 << len(groups):
        raise ProtocolError(
            f"a VESC selected unknown fields: mask {mask:#x}, of which {len(groups)} bits are known"
        )
    return layout_of(
        [field for bit, group in enumerate(groups) if mask >> bit & 1 for field in group]
    )


def fitting(groups: Sequence[tuple[Field, ...]], size: int) -> Layout | None:
    """The layout of the first groups that fill `size` bytes; all groups may be followed by more.

    None if no number of groups does.
    """
    for count in range(1, len(groups) + 1):
        layout = masked(groups, (1 << count) - 1)
        if layout.size == size or (count == len(groups) and layout.size < size):
            return layout
    return None
