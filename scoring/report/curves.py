"""Errors of the path over time and their distribution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dialogue.pages import INK, PALETTE, figure_svg, series_colour, series_dash
from geometry import Floats
from scoring.report.thinning import thin_series, with_gaps
from scoring.result import PathErrors, Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE_IN = (4.8, 2.3)
SHARES_SHOWN = 600

Drawn = tuple[int, PathErrors]
"""The index of an estimate, which gives its colour, and its errors."""


def position_svg(scores: Sequence[Score], only: int | None = None) -> str:
    """Distance to the truth over time, of all estimates or of the one with index `only`."""
    drawn = _paths(scores, only)
    start_ns = _start_ns(scores)

    def draw(axes: Axes) -> None:
        for index, path in drawn:
            t_s, error = _line(path, path.position_m, start_ns)
            style = "solid" if len(drawn) == 1 else series_dash(index)
            axes.plot(t_s, error, color=series_colour(index), linestyle=style)
            if len(drawn) == 1:
                axes.fill_between(t_s, error, color=series_colour(index), alpha=0.12, linewidth=0)
                _mark_mean(axes, float(path.position_m.mean()))
        axes.set_ylim(bottom=0.0)
        _label(axes, "position error [m]")

    return figure_svg(SIZE_IN, draw, f"Position error over time{_of(scores, only)}")


def track_svg(scores: Sequence[Score], only: int) -> str | None:
    """Along-track and cross-track error over time; None in space, where they do not exist."""
    path = scores[only].path
    if path is None or not np.isfinite(path.cross_m).any():
        return None

    def draw(axes: Axes) -> None:
        for name, values, colour, dash in (
            ("along the track", path.along_m, series_colour(only), "solid"),
            ("across, left positive", path.cross_m, INK, (0, (3.0, 1.2))),
        ):
            t_s, error = _line(path, values, _start_ns(scores))
            axes.plot(t_s, error, color=colour, linestyle=dash, linewidth=1.1, label=name)
        axes.axhline(0.0, color=PALETTE["muted"], linewidth=0.6)
        axes.margins(y=0.16)
        axes.legend(loc="upper left", ncols=2, handlelength=1.6, borderaxespad=0.0, frameon=False)
        _label(axes, "track error [m]")

    return figure_svg(SIZE_IN, draw, f"Track error over time{_of(scores, only)}")


def heading_svg(scores: Sequence[Score], only: int) -> str | None:
    """Heading error over time in degrees; None in space."""
    path = scores[only].path
    if path is None or not np.isfinite(path.heading_rad).any():
        return None

    def draw(axes: Axes) -> None:
        t_s, error = _line(path, np.degrees(path.heading_rad), _start_ns(scores))
        axes.plot(t_s, error, color=series_colour(only))
        axes.axhline(0.0, color=PALETTE["muted"], linewidth=0.6)
        _label(axes, "heading error [deg]")

    return figure_svg(SIZE_IN, draw, f"Heading error over time{_of(scores, only)}")


def distribution_svg(scores: Sequence[Score], only: int | None = None) -> str:
    """Share of the poses whose position error is at most so large."""
    drawn = _paths(scores, only)

    def draw(axes: Axes) -> None:
        for index, path in drawn:
            shares = np.linspace(0.0, 1.0, min(path.position_m.size, SHARES_SHOWN))
            error = np.quantile(path.position_m, shares)
            style = "solid" if len(drawn) == 1 else series_dash(index)
            axes.plot(error, 100 * shares, color=series_colour(index), linestyle=style)
            if len(drawn) == 1:
                _mark_quantiles(axes, path.position_m, series_colour(index))
        axes.set_xlim(left=0.0)
        axes.set_ylim(0.0, 104.0)
        axes.set_yticks([0, 25, 50, 75, 100])
        axes.locator_params(axis="x", nbins=6)
        axes.set_xlabel("position error [m]")
        axes.set_ylabel("poses within [%]")

    return figure_svg(SIZE_IN, draw, f"Distribution of the position error{_of(scores, only)}")


def _mark_mean(axes: Axes, mean_m: float) -> None:
    label = f"mean {mean_m:.3f} m"
    axes.axhline(mean_m, color=INK, linewidth=0.8, linestyle="dashed", label=label)
    axes.margins(y=0.16)
    axes.legend(loc="upper left", handlelength=1.6, borderaxespad=0.0, frameon=False)


def _mark_quantiles(axes: Axes, error_m: Floats, colour: str) -> None:
    for share, name in ((0.5, "median"), (0.95, "95 %")):
        level = float(np.quantile(error_m, share))
        axes.plot(level, 100 * share, marker="o", markersize=4.5, color=colour)
        # Text stands on the side of the curve where there is room.
        left = level > 0.5 * float(error_m.max())
        axes.annotate(
            f"{name} {level:.3f} m",
            (level, 100 * share),
            xytext=(-8, 2) if left else (8, -8),
            textcoords="offset points",
            horizontalalignment="right" if left else "left",
        )


def _paths(scores: Sequence[Score], only: int | None) -> list[Drawn]:
    return [
        (index, score.path)
        for index, score in enumerate(scores)
        if score.path is not None and only in (None, index)
    ]


def _start_ns(scores: Sequence[Score]) -> int:
    """Where time begins in every figure: the first paired pose of any estimate."""
    return min(int(score.path.t_ns[0]) for score in scores if score.path is not None)


def _line(path: PathErrors, values: Floats, start_ns: int) -> tuple[Floats, Floats]:
    t_s = np.asarray((path.t_ns - start_ns) * 1e-9, dtype=np.float64)
    rows = thin_series(t_s, values)
    t_drawn, drawn = with_gaps(path.t_ns, rows, np.column_stack([t_s, values])).T
    return t_drawn, drawn


def _label(axes: Axes, quantity: str) -> None:
    axes.margins(x=0.01)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(quantity)


def _of(scores: Sequence[Score], only: int | None) -> str:
    return "" if only is None else f" of {scores[only].name}"
