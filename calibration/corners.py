"""Which ring in the picture is which marker on the floor."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

from calibration.errors import CalibrationError
from calibration.survey import Floor, FloorMarker
from geometry import Floats

_NEAR_SHARE = 0.05
"""Of the picture's width: how far from near_px a marker may be."""
_FLATTEST = 0.03
"""Twice a triangle's area over the square of its longest side, below which it is a line."""
_FIRST = {
    "bottom-left": (-1.0, 1.0), "bottom-right": (1.0, 1.0),
    "top-right": (1.0, -1.0), "top-left": (-1.0, -1.0),
}  # fmt: skip


def find_corners(floor: Floor, centres_px: Floats, width_px: int) -> npt.NDArray[np.int64]:
    """Indices (4,) of the rings that are corners 1 to 4.

    By near_px where given, else the four outermost rings, counter-clockwise as seen from above,
    which is counter-clockwise in the picture. Raises `CalibrationError` for fewer than four rings
    and for corners on a line.
    """
    if len(centres_px) < 4:
        raise CalibrationError(
            f"{len(centres_px)} rings are seen, the frame needs its four corners: are all of them "
            "in the picture, uncovered, white inside and around, and is the diameter right?"
        )
    corners = floor.corner_markers
    if all(corner.near_px is not None for corner in corners):
        indices = np.array([_nearest(c, centres_px, width_px) for c in corners], np.int64)
        if len(set(indices.tolist())) < 4:
            raise CalibrationError("two corners have near_px at one and the same ring")
    else:
        indices = _outermost(centres_px, floor.first_corner)
    _refuse_lines(centres_px[indices])
    if _area(centres_px[indices]) > 0.0:
        raise CalibrationError(
            "corners 1, 2, 3, 4 go clockwise in the picture; seen from above they must go "
            "counter-clockwise, or z would point into the floor: swap corners 2 and 4"
        )
    return indices


def find_other(
    marker: FloorMarker, centres_px: Floats, expected_px: Floats | None, width_px: int
) -> int | None:
    """The ring that is a marker, by near_px or by where near_m is seen; None if there is none."""
    aim = marker.near_px if marker.near_px is not None else expected_px
    if aim is None or not np.isfinite(aim).all() or not len(centres_px):
        return None
    apart = np.linalg.norm(centres_px - np.asarray(aim), axis=1)
    nearest = int(apart.argmin())
    return nearest if apart[nearest] <= _NEAR_SHARE * width_px else None


def _nearest(marker: FloorMarker, centres_px: Floats, width_px: int) -> int:
    found = find_other(marker, centres_px, None, width_px)
    if found is None:
        raise CalibrationError(
            f"{marker.name}: there is no ring near {list(marker.near_px or ())} px; rings are at "
            + ", ".join(f"({u:.0f}, {v:.0f})" for u, v in centres_px)
        )
    return found


def _outermost(centres_px: Floats, first: str) -> npt.NDArray[np.int64]:
    """The four rings that span the most, counter-clockwise in the picture, from `first` on."""
    import cv2

    hull = cv2.convexHull(centres_px.astype(np.float32), returnPoints=False).ravel()
    if len(hull) < 4:
        raise CalibrationError(
            "the outermost rings make a triangle or a line, no four corners; give each corner's "
            "near_px in the floor file"
        )
    outer = [int(index) for index in hull]
    choices = [list(four) for four in combinations(outer, 4)]
    best = max(choices, key=lambda four: abs(_area(centres_px[four])))
    if _area(centres_px[best]) > 0.0:
        best.reverse()
    direction = np.array(_FIRST[first])
    start = int((centres_px[best] @ direction).argmax())
    return np.roll(np.array(best, np.int64), -start)


def _area(corners: Floats) -> float:
    """Signed area; positive is clockwise on the screen, where y points down."""
    x, y = corners.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2.0


def _refuse_lines(corners: Floats) -> None:
    for three in combinations(range(4), 3):
        a, b, c = corners[[*three]]
        twice = abs(float((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]))
        longest = max(float(np.hypot(*side)) for side in (b - a, c - a, c - b))
        if twice < _FLATTEST * longest**2:
            names = ", ".join(str(k + 1) for k in three)
            raise CalibrationError(
                f"corners {names} lie on one line in the picture; four corners of a wide "
                "quadrangle are needed"
            )
