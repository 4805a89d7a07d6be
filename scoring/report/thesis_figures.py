"""The figures of the thesis' chapter 4, drawn as it draws them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dialogue.pages import INK, PALETTE, figure_svg, series_colour
from geometry import Floats
from scoring.comparison import COLUMNS, Comparison
from scoring.comparison.tables import HEADINGS
from scoring.report.comparison_figures import draw_mean
from scoring.report.thinning import thin_path, with_gaps
from scoring.result import Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENE_WIDTH_IN = 4.4
SCENE_HEIGHT_IN = (2.6, 6.0)
ERRORS_SIZE_IN = (10.2, 2.9)
SQUARE_M = 1.0
MARGIN_M = 0.3
ODOMETRY_BEYOND_M = 1.0
"""Odometry that drifts farther than this out of the picture is cut."""
ARROW_M = 0.3


@dataclass(frozen=True, eq=False)
class Panel:
    """One estimate of a data set.

    label : of the algorithm; end : (3,) the last pose of the estimate in `world`; odometry : (n, 3)
    poses in `world` that it was given, from the same start. None where that is not known.
    """

    label: str
    score: Score
    end: Floats | None = None
    odometry: Floats | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """Estimates of one data set, side by side on the same floor."""

    map: str
    dataset: str
    panels: tuple[Panel, ...]


def scene_svgs(scene: Scene, note: str) -> list[str]:
    """A figure as 4.1, 4.3 and 4.5 for each estimate, all of the same part of the floor.

    Green: true path and landmarks; black: those of SLAM; red: odometry; arrows: final headings of
    SLAM and odometry; squares: 1 m. `note` tells apart figures of one page.
    """
    low, high = _bounds(scene.panels)
    width, height = high - low
    size_in = (SCENE_WIDTH_IN, float(np.clip(SCENE_WIDTH_IN * height / width, *SCENE_HEIGHT_IN)))

    def drawn(panel: Panel) -> str:
        def draw(axes: Axes) -> None:
            _draw_panel(axes, panel)
            _set_floor(axes, low, high)

        text = f"{panel.label} on {scene.map} {scene.dataset}, {note}, from above"
        return figure_svg(size_in, draw, text)

    return [drawn(panel) for panel in scene.panels]


def errors_svg(comparison: Comparison, group: str, note: str) -> str:
    """Mean and spread of every error of one map, a bar per algorithm: as 4.2, 4.4 and 4.6."""
    algorithms = comparison.algorithms

    def draw(axes: Axes) -> None:
        width = 0.8 / len(algorithms)
        for summary in comparison.summaries:
            if summary.group != group or summary.mean is None:
                continue
            index = algorithms.index(summary.algorithm)
            x = COLUMNS.index(summary.column) + (index - (len(algorithms) - 1) / 2) * width
            draw_mean(axes, x, 0.86 * width, summary, series_colour(index))
        axes.set_xticks(range(len(COLUMNS)), list(HEADINGS.values()))
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("weighted error [m]")

    return figure_svg(ERRORS_SIZE_IN, draw, f"Mean errors on {group}, {note}")


def _bounds(panels: Sequence[Panel]) -> tuple[Floats, Floats]:
    """Lower left and upper right of everything but far odometry."""
    parts: list[Floats] = []
    for panel in panels:
        score = panel.score
        if score.path is not None:
            parts += [score.path.truth[:, :2], score.path.estimate[:, :2]]
        if score.map is not None:
            parts += [score.map.truth.positions, score.map.estimate.positions]
    points = np.concatenate([part for part in parts if part.size] or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    for panel in panels:
        if panel.odometry is not None and panel.odometry.size:
            own = panel.odometry[:, :2].clip(low - ODOMETRY_BEYOND_M, high + ODOMETRY_BEYOND_M)
            low, high = np.minimum(low, own.min(axis=0)), np.maximum(high, own.max(axis=0))
    return low - MARGIN_M, high + MARGIN_M


def _set_floor(axes: Axes, low: Floats, high: Floats) -> None:
    from matplotlib.ticker import MultipleLocator

    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.xaxis.set_major_locator(MultipleLocator(SQUARE_M))
    axes.yaxis.set_major_locator(MultipleLocator(SQUARE_M))
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def _draw_panel(axes: Axes, panel: Panel) -> None:
    score = panel.score
    true_path = score.true_path
    if true_path is not None and true_path.size:
        _line(axes, true_path[:, :2], PALETTE["driven"], 2.4)
    if panel.odometry is not None and panel.odometry.size:
        _line(axes, panel.odometry[:, :2], PALETTE["odometry"], 1.1)
        _arrow(axes, panel.odometry[-1], PALETTE["odometry"])
    if score.path is not None:
        own = score.path.estimate[:, :2]
        x, y = with_gaps(score.path.t_ns, thin_path(own), own).T
        axes.plot(x, y, color=INK, linewidth=1.3)
    if panel.end is not None:
        _arrow(axes, panel.end, INK)
    if score.map is not None:
        _circles(axes, score.map.truth.positions, PALETTE["driven"], 7.0, 1.6)
        _circles(axes, score.map.estimate.positions, INK, 4.2, 1.1)


def _line(axes: Axes, path: Floats, colour: str, width: float) -> None:
    x, y = path[thin_path(path)].T
    axes.plot(x, y, color=colour, linewidth=width, solid_capstyle="round")


def _arrow(axes: Axes, pose: Floats, colour: str) -> None:
    x, y, heading = (float(part) for part in pose)
    tip = (x + ARROW_M * np.cos(heading), y + ARROW_M * np.sin(heading))
    axes.plot([x, tip[0]], [y, tip[1]], color=colour, linewidth=1.3)
    angle = float(np.degrees(heading)) - 90.0
    axes.plot(*tip, marker=(3, 0, angle), markersize=6.0, color=colour, markeredgewidth=0)


def _circles(axes: Axes, positions: Floats, colour: str, size_pt: float, edge_pt: float) -> None:
    axes.plot(
        positions[:, 0],
        positions[:, 1],
        linestyle="none",
        marker="o",
        markersize=size_pt,
        markerfacecolor="none",
        markeredgecolor=colour,
        markeredgewidth=edge_pt,
    )
