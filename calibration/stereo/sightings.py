"""A board in both eyes of side-by-side pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from calibration.board import Board, BoardSighting
from calibration.camera import Sightings
from calibration.errors import CalibrationError
from calibration.pictures import Picture, Skipped, decoded, pictures_of
from capture import Session
from capture.session_info import FILE_NAME
from drivers.camera import split_stereo


@dataclass(frozen=True, eq=False)
class PairSighting:
    """A board in one picture: the points (n, 3) that both eyes see, and their pixels (n, 2)."""

    name: str
    points_m: np.ndarray
    left: np.ndarray
    right: np.ndarray


@dataclass
class PairSightings:
    """Boards found so far, in side-by-side pictures of one size.

    fresh_px : as in `Sightings`, for the left eye.
    """

    board: Board
    fresh_px: float | None = None
    found: list[PairSighting] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    pictures: int = 0

    def __post_init__(self) -> None:
        self._left = Sightings(self.board, self.fresh_px)

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Of one eye; None before the first picture."""
        return self._left.size_px

    @property
    def cells(self) -> np.ndarray:
        """Points in each cell of the left eye, rows x columns."""
        return self._left.cells

    def add(self, picture: Picture) -> PairSighting | None:
        """Look for the board in both eyes; the sighting if it is a new one."""
        self.pictures += 1
        try:
            left_eye, right_eye = split_stereo(picture.image)
        except ValueError as err:
            raise CalibrationError(
                f"{picture.name}: {err}; give pictures as the ZED makes them"
            ) from err
        right = self.board.find(np.ascontiguousarray(right_eye), picture.name)
        if right is None:
            self.missing.append(picture.name)
            return None
        known = len(self._left.missing)
        left = self._left.add(Picture(picture.name, np.ascontiguousarray(left_eye)))
        if left is None:
            self.missing += self._left.missing[known:]
            return None
        both = _shared(left, right)
        if both is None:
            self._left.found.pop()
            self.missing.append(picture.name)
            return None
        self.found.append(both)
        return both

    def add_all(self, pictures: Iterable[Picture], most: int) -> None:
        """Look at pictures until there are so many new views."""
        for picture in pictures:
            self.add(picture)
            if len(self.found) >= most:
                return


_LEAST_SHARED = 8


def _shared(left: BoardSighting, right: BoardSighting) -> PairSighting | None:
    """The points that both eyes see; None for too few of them."""
    places = {tuple(point): k for k, point in enumerate(right.points_m.tolist())}
    pairs = [
        (k, places[key])
        for k, p in enumerate(left.points_m.tolist())
        if (key := tuple(p)) in places
    ]
    if len(pairs) < _LEAST_SHARED:
        return None
    own, other = np.array(pairs).T
    return PairSighting(left.name, left.points_m[own], left.pixels[own], right.pixels[other])


def stereo_pictures(place: Path, skipped: Skipped) -> tuple[Iterator[Picture], bool]:
    """Side-by-side pictures of a folder, a video or a session, and whether they are stills."""
    if not (place / FILE_NAME).is_file():
        return pictures_of(place, skipped), place.is_dir()
    return _of_session(place, skipped), False


def _of_session(folder: Path, skipped: Skipped) -> Iterator[Picture]:
    for logged in Session.open(folder).stereo_images():
        image = decoded(logged)
        if image is None:
            skipped.lines.append(f"{folder}: picture {logged.sequence} left out: damaged")
            continue
        yield Picture(f"picture {logged.sequence}", image)
