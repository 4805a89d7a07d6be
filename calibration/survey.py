"""What a person measured on the floor: which rings stand where, and how far apart they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from capture import read_configuration
from geometry import RingShape

CORNERS = (1, 2, 3, 4)
Place = Literal["bottom-left", "bottom-right", "top-left", "top-right"]


@dataclass(frozen=True, kw_only=True)
class FloorMarker:
    """A ring on the floor or above it.

    corner : 1 to 4, counter-clockwise seen from above, or None. near_px, near_m : about where it is
    in the picture or in the world, where its place among the others does not say which it is.
    """

    name: str
    height_m: float = 0.0
    corner: int | None = field(default=None, metadata={"min": 1, "max": 4})
    near_px: tuple[float, ...] | None = None
    near_m: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for key, place in (("near_px", self.near_px), ("near_m", self.near_m)):
            if place is not None and len(place) != 2:
                raise ValueError(f"{key} of {self.name} must be two numbers, got {list(place)}")
        if self.corner is None and self.near_px is None and self.near_m is None:
            raise ValueError(
                f"{self.name} is no corner: give near_m or near_px: nobody knows which ring it is"
            )


@dataclass(frozen=True, kw_only=True)
class MeasuredLength:
    """The straight line between the middles of two rings, by tape or laser."""

    between: tuple[str, ...]
    length_m: float = field(metadata={"min": 0.001})
    sigma_m: float = field(default=0.001, metadata={"min": 0.00001})

    def __post_init__(self) -> None:
        if len(set(self.between)) != 2:
            raise ValueError(f"a length is between two markers, got {list(self.between)}")


@dataclass(frozen=True, kw_only=True)
class Floor:
    """The content of `floor.yaml`.

    first_corner : where corner 1 is in the picture; only needed when no corner has near_px.
    Raises `ValueError` for what cannot fix a frame.
    """

    format: int = 1
    ring: RingShape = field(default_factory=RingShape)
    first_corner: Place = "bottom-left"
    markers: tuple[FloorMarker, ...]
    lengths: tuple[MeasuredLength, ...]

    def __post_init__(self) -> None:
        names = [marker.name for marker in self.markers]
        if len(set(names)) != len(names):
            raise ValueError(f"each marker needs a name of its own, got {names}")
        corners = sorted(m.corner for m in self.markers if m.corner is not None)
        if corners != [*CORNERS]:
            raise ValueError(
                f"the frame needs the corners 1, 2, 3, 4, each once; got {corners or 'none'}: "
                "three points fix no perspective"
            )
        for length in self.lengths:
            unknown = [name for name in length.between if name not in names]
            if unknown:
                raise ValueError(f"a length names {unknown[0]}, which is no marker of {names}")
        known = {marker.name for marker in self.corner_markers}
        if sum(set(length.between) <= known for length in self.lengths) < 4:
            raise ValueError(
                "at least four lengths between the corners must be measured, best all six: four "
                "sides and both diagonals; a square is never assumed"
            )

    @property
    def corner_markers(self) -> tuple[FloorMarker, ...]:
        """Corners 1, 2, 3, 4."""
        corners = [marker for marker in self.markers if marker.corner is not None]
        return tuple(sorted(corners, key=lambda marker: marker.corner or 0))

    @property
    def others(self) -> tuple[FloorMarker, ...]:
        """All markers that are no corners."""
        return tuple(marker for marker in self.markers if marker.corner is None)

    @property
    def ordered(self) -> tuple[FloorMarker, ...]:
        """Corners 1 to 4, then the others."""
        return (*self.corner_markers, *self.others)


def read_floor(file: Path) -> Floor:
    """The floor of a file; raises `ConfigurationError` with every fault and its place."""
    return read_configuration(Floor, file)
