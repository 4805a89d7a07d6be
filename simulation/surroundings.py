"""The floor around the markers, and the things on it that are no markers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulation.light import Grey


@dataclass(frozen=True)
class Levels:
    """Grey levels 0..255 in full light. Ring and paper differ by 50 times the usual noise."""

    floor: float = 110.0
    paper: float = 170.0
    ring: float = 45.0
    car: float = 70.0


def plain_floor(shape: tuple[int, int], rng: np.random.Generator, level: float = 110.0) -> Grey:
    """A floor (h, w) with faint large stains."""
    import cv2

    small = rng.normal(0.0, 3.0, (shape[0] // 60 + 2, shape[1] // 60 + 2)).astype(np.float32)
    stains = cv2.resize(small, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
    return np.asarray(stains + np.float32(level), np.float32)


def cluttered_floor(
    shape: tuple[int, int], rng: np.random.Generator, items: int = 150, level: float = 110.0
) -> Grey:
    """The same floor with blobs, tape, frames, discs and things that are nearly rings.

    None of them is a marker: their holes are too large or too small, off the middle, or missing.
    """
    import cv2

    floor = plain_floor(shape, rng, level)
    draw = (_blob, _tape, _frame, _disc, _thin_ring, _washer, _eccentric)
    for kind in rng.integers(0, len(draw), items):
        centre = rng.uniform(0.0, 1.0, 2) * shape[::-1]
        size = rng.uniform(0.008, 0.03) * shape[0]
        draw[kind](floor, centre, size, rng)
    return np.asarray(cv2.GaussianBlur(floor, (0, 0), 0.7), np.float32)


def _ellipse(
    floor: Grey, centre: np.ndarray, axes: np.ndarray, turn: float, grey: float, line: int = -1
) -> None:
    import cv2

    middle = [round(16 * float(c)) for c in centre]
    halves = [max(1, round(16 * float(a))) for a in axes]
    cv2.ellipse(floor, middle, halves, turn, 0.0, 360.0, grey, line, cv2.LINE_AA, 4)


def _shape(size: float, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    return size * np.array([1.0, rng.uniform(0.4, 1.0)]), rng.uniform(0.0, 180.0)


def _dark_and_light(rng: np.random.Generator) -> tuple[float, float]:
    return rng.uniform(20.0, 80.0), rng.uniform(130.0, 220.0)


def _blob(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    import cv2

    corners = centre + size * rng.normal(0.0, 1.0, (7, 2))
    fixed = np.rint(16.0 * corners).astype(np.int32)
    cv2.fillPoly(floor, [fixed], rng.uniform(20.0, 220.0), cv2.LINE_AA, 4)


def _tape(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    import cv2

    reach = size * rng.uniform(3.0, 15.0)
    turn = rng.uniform(0.0, np.pi)
    along = reach * np.array([np.cos(turn), np.sin(turn)])
    first, last = (np.rint(16.0 * (centre + s * along)).astype(int).tolist() for s in (-1, 1))
    wide = max(1, round(0.4 * size))
    cv2.line(floor, first, last, rng.uniform(20.0, 220.0), wide, cv2.LINE_AA, 4)


def _frame(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    import cv2

    dark, light = _dark_and_light(rng)
    box = (centre.tolist(), (2.0 * size, 2.0 * size * rng.uniform(0.5, 1.0)), rng.uniform(0, 90))
    corners = cv2.boxPoints(box)
    for scale, grey in ((1.4, light), (1.0, dark), (rng.uniform(0.3, 0.8), light)):
        scaled = centre + scale * (corners - centre)
        fixed = np.rint(16.0 * scaled).astype(np.int32)
        cv2.fillConvexPoly(floor, fixed, grey, cv2.LINE_AA, 4)


def _disc(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    axes, turn = _shape(size, rng)
    dark, light = _dark_and_light(rng)
    _ellipse(floor, centre, 1.4 * axes, turn, light)
    _ellipse(floor, centre, axes, turn, dark)


def _thin_ring(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    axes, turn = _shape(size, rng)
    _ellipse(floor, centre, axes, turn, _dark_and_light(rng)[0], line=max(1, round(0.12 * size)))


def _washer(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    """A ring whose hole is far too large or far too small."""
    axes, turn = _shape(size, rng)
    dark, light = _dark_and_light(rng)
    hole = rng.uniform(0.60, 0.85) if rng.random() < 0.7 else rng.uniform(0.10, 0.22)
    for scale, grey in ((1.4, light), (1.0, dark), (hole, light)):
        _ellipse(floor, centre, scale * axes, turn, grey)


def _eccentric(floor: Grey, centre: np.ndarray, size: float, rng: np.random.Generator) -> None:
    """A ring whose hole is off the middle."""
    axes, turn = _shape(size, rng)
    dark, light = _dark_and_light(rng)
    _ellipse(floor, centre, 1.4 * axes, turn, light)
    _ellipse(floor, centre, axes, turn, dark)
    aside = rng.uniform(0.25, 0.45) * axes.min()
    angle = rng.uniform(0.0, 2.0 * np.pi)
    hole = centre + aside * np.array([np.cos(angle), np.sin(angle)])
    _ellipse(floor, hole, 0.41 * axes, turn, light)
