"""The scene from above: paths and landmarks, true and estimated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dialogue.pages import INK, PALETTE, figure_svg, series_colour, series_dash
from geometry import Floats
from scoring.report.thinning import thin_path, with_gaps
from scoring.result import MapErrors, PathErrors, Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_IN = 5.0
HEIGHT_IN = (2.4, 6.4)
MARGIN = 0.04
LANDMARK_MARKERS = "osD^"


@dataclass(frozen=True)
class Marker:
    """The shape of a landmark; an open one is drawn by its edge."""

    shape: str
    size_pt: float
    edge_pt: float
    open: bool = False


RING = Marker("o", 6.0, 0.9, open=True)
DOT = Marker("o", 3.2, 0.0)
MISSED = Marker("D", 6.5, 1.5, open=True)
FALSE = Marker("x", 6.5, 1.7)


def scene_svg(score: Score, index: int = 0) -> str | None:
    """One estimate over the truth, seen from above; None when there is neither path nor map.

    A true landmark is a ring within its pairing circle, a paired estimate a dot joined to it, a
    missed one a diamond, a false one a cross.
    """

    def draw(axes: Axes) -> None:
        _draw_truth(axes, score)
        if score.path is not None:
            _draw_path(axes, score.path, index)
        if score.map is not None:
            _draw_map(axes, score.map, series_colour(index))

    return _framed([score], draw, f"Path and landmarks of {score.name} from above")


def overlay_svg(scores: Sequence[Score]) -> str | None:
    """Several estimates over the truth; None when no score has a path or a map."""

    def draw(axes: Axes) -> None:
        _draw_truth(axes, next((s for s in scores if s.path is not None), scores[0]))
        mapped = next((score.map for score in scores if score.map is not None), None)
        if mapped is not None:
            _points(axes, mapped.truth.positions, INK, RING)
        for index, score in enumerate(scores):
            if score.path is not None:
                _draw_path(axes, score.path, index)
            if score.map is not None:
                dot = replace(DOT, shape=LANDMARK_MARKERS[index % len(LANDMARK_MARKERS)])
                _points(axes, score.map.estimate.positions, series_colour(index), dot)

    return _framed(scores, draw, "Paths and landmarks of all estimates from above")


def _framed(scores: Sequence[Score], draw: Callable[[Axes], None], description: str) -> str | None:
    """The drawing in axes of equal scale whose shape follows the track."""
    points = [part for score in scores for part in _extent(score)]
    if not points:
        return None
    corners = np.concatenate(points)
    low, high = corners.min(axis=0), corners.max(axis=0)
    # A car that never moved still gets a metre of floor.
    half = np.maximum((high - low) * (0.5 + MARGIN), 0.5)
    centre = (low + high) / 2.0
    height_in = float(np.clip(WIDTH_IN * half[1] / half[0], *HEIGHT_IN))

    def draw_framed(axes: Axes) -> None:
        draw(axes)
        axes.set_xlim(centre[0] - half[0], centre[0] + half[0])
        axes.set_ylim(centre[1] - half[1], centre[1] + half[1])
        axes.set_aspect("equal")
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")

    return figure_svg((WIDTH_IN, height_in), draw_framed, description)


def _extent(score: Score) -> list[Floats]:
    parts = [] if score.true_path is None else [score.true_path[:, :2]]
    if score.path is not None:
        parts += [score.path.truth[:, :2], score.path.estimate[:, :2]]
    if score.map is not None:
        c = score.map.cutoff_m
        true = score.map.truth.positions
        parts += [true - c, true + c, score.map.estimate.positions]
    return [part for part in parts if part.size]


def _draw_truth(axes: Axes, score: Score) -> None:
    """The whole true path, not only where it was paired, and which way it began."""
    true_path = score.true_path
    if true_path is None and score.path is not None:
        true_path = score.path.truth
    if true_path is None or not true_path.size:
        return
    path = true_path[:, :2]
    x, y = path[thin_path(path)].T
    axes.plot(x, y, color=PALETTE["truth"], linewidth=2.6, alpha=0.75, solid_capstyle="round")
    away = np.linalg.norm(path - path[0], axis=1)
    moved = np.flatnonzero(away > 0.02 * max(float(away.max()), 1e-9))
    step = path[moved[0]] - path[0] if moved.size else np.array([1.0, 0.0])
    angle = float(np.degrees(np.arctan2(step[1], step[0])))
    axes.plot(*path[0], marker=(3, 0, angle - 90.0), markersize=10.0, color=INK, zorder=5)


def _draw_path(axes: Axes, path: PathErrors, index: int) -> None:
    line = path.estimate[:, :2]
    x, y = with_gaps(path.t_ns, thin_path(line), line).T
    axes.plot(x, y, color=series_colour(index), linestyle=series_dash(index), linewidth=1.3)


def _draw_map(axes: Axes, landmarks: MapErrors, colour: str) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    true, own = landmarks.truth.positions, landmarks.estimate.positions
    circles = PatchCollection(
        [Circle((x, y), landmarks.cutoff_m) for x, y in true],
        facecolor="none",
        edgecolor=PALETTE["truth"],
        linewidth=0.6,
        linestyle=(0, (1.5, 2.0)),
    )
    axes.add_collection(circles)
    for row, column in landmarks.pairs:
        x, y = np.stack([true[row], own[column]]).T
        axes.plot(x, y, color=colour, linewidth=1.1)
    _points(axes, true[landmarks.pairs[:, 0]], INK, RING)
    _points(axes, own[landmarks.pairs[:, 1]], colour, DOT)
    _points(axes, true[landmarks.missed], PALETTE["missed"], MISSED)
    _points(axes, own[landmarks.false], PALETTE["false"], FALSE)


def _points(axes: Axes, positions: Floats, colour: str, marker: Marker) -> None:
    axes.plot(
        positions[:, 0],
        positions[:, 1],
        linestyle="none",
        color=colour,
        marker=marker.shape,
        markersize=marker.size_pt,
        markeredgewidth=marker.edge_pt,
        markerfacecolor="none" if marker.open else colour,
    )
