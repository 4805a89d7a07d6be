"""Figures over many runs: means, ratios, data set by data set, pose error against Total."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from dialogue.pages import FONT_PT, INK, PALETTE, figure_svg, series_colour, series_dash
from scoring.comparison import COLUMNS, Comparison, Interval, Summary, members
from scoring.comparison.tables import HEADINGS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEAN_SIZE_IN = (2.7, 2.1)
RATIO_SIZE_IN = (4.8, 4.2)
CORRELATION_SIZE_IN = (4.8, 4.2)
DATASET_HEIGHT_IN = 2.5
DATASET_STEP_IN = 0.37
GROUP_MARKERS = "osD^vPX"
ALGORITHM_MARKERS = "oD^s"


def mean_svg(comparison: Comparison, column: str) -> str:
    """Mean of one error per group and algorithm, with its interval, spread and the runs.

    A thin whisker is the standard deviation of the runs, a thick one the interval of the mean.
    """

    def draw(axes: Axes) -> None:
        width = 0.8 / len(comparison.algorithms)
        for summary in comparison.summaries:
            if summary.column != column or summary.mean is None:
                continue
            index = comparison.algorithms.index(summary.algorithm)
            offset = (index - (len(comparison.algorithms) - 1) / 2) * width
            x = comparison.groups.index(summary.group) + offset
            draw_mean(axes, x, 0.86 * width, summary, series_colour(index))
            _draw_runs(axes, x - 0.28 * width, comparison, summary, series_colour(index))
        axes.set_xticks(range(len(comparison.groups)), comparison.groups)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(f"{HEADINGS[column]} [m]")

    return figure_svg(MEAN_SIZE_IN, draw, f"Mean {HEADINGS[column]} per group and algorithm")


def draw_mean(axes: Axes, x: float, width: float, summary: Summary, colour: str) -> None:
    """A bar to the mean, a thin whisker for the spread of runs, a thick one for its interval."""
    mean = summary.mean
    assert mean is not None, "only defined means are drawn"
    axes.bar(x, mean, width, color=colour, alpha=0.25, linewidth=0)
    axes.plot([x - width / 2, x + width / 2], [mean, mean], color=colour, linewidth=1.8)
    if summary.std is not None:
        # A mean minus its spread may lie below zero, an error never does.
        low = max(mean - summary.std, 0.0)
        axes.plot([x, x], [low, mean + summary.std], color=INK, linewidth=0.7)
    if summary.interval is not None:
        ends = [summary.interval.low, summary.interval.high]
        axes.plot([x, x], ends, color=INK, linewidth=2.4, solid_capstyle="butt")


def _draw_runs(axes: Axes, x: float, comparison: Comparison, summary: Summary, colour: str) -> None:
    values = [
        value
        for run in members(comparison.runs, comparison.group_by, summary.group)
        if run.algorithm == summary.algorithm
        and (value := run.weighted[summary.column]) is not None
    ]
    axes.plot([x] * len(values), values, "o", markersize=2.4, color=colour, markeredgewidth=0)


def ratio_svg(comparison: Comparison, algorithm: str) -> str:
    """Every error of one algorithm over the baseline's, per group, with intervals, log axis."""
    groups = comparison.groups
    contrasts = [c for c in comparison.contrasts if c.algorithm == algorithm and c.ratio]

    def draw(axes: Axes) -> None:
        axes.axvline(1.0, color=INK, linewidth=0.8)
        for place, group in enumerate(groups):
            own = [c for c in contrasts if c.group == group]
            offset = (place - (len(groups) - 1) / 2) * 0.8 / len(groups)
            y = [COLUMNS.index(c.column) + offset for c in own]
            colour = INK if len(groups) > 1 and place == len(groups) - 1 else PALETTE["muted"]
            marker = GROUP_MARKERS[place % len(GROUP_MARKERS)]
            ratios = [c.ratio or np.nan for c in own]
            axes.plot(ratios, y, marker, color=colour, markersize=4.5, label=group)
            for height, contrast in zip(y, own, strict=True):
                _draw_interval(axes, height, contrast.interval, colour)
        axes.set_xscale("log")
        _set_ratio_ticks(axes)
        axes.set_yticks(range(len(COLUMNS)), list(HEADINGS.values()))
        axes.tick_params(axis="y", length=0)
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.set_xlabel(f"{algorithm} / {comparison.baseline}, ratio of means")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False)

    return figure_svg(RATIO_SIZE_IN, draw, f"Errors of {algorithm} over {comparison.baseline}")


def _draw_interval(axes: Axes, y: float, interval: Interval | None, colour: str) -> None:
    if interval is not None and interval.low > 0:
        axes.plot([interval.low, interval.high], [y, y], color=colour, linewidth=1.1)


def _set_ratio_ticks(axes: Axes) -> None:
    """1, 2, 5 and their tens as plain numbers: a ratio of 0.5 reads better than 5 x 10^-1."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ticks = [base * 10.0**power for power in range(-3, 4) for base in (1, 2, 5)]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def dataset_svg(comparison: Comparison, column: str) -> str:
    """One error data set by data set, a line per algorithm and map; shaded where ranks disagree.

    Drawn for pose and Total one above the other it is Fig. 4.7 of the thesis, each on its scale.
    """
    runs = [run for run in comparison.runs if not run.missing]
    places = list(dict.fromkeys((run.map, run.dataset) for run in runs))
    size_in = (max(4.8, 0.8 + DATASET_STEP_IN * len(places)), DATASET_HEIGHT_IN)

    def draw(axes: Axes) -> None:
        for ranking in comparison.rankings:
            if ranking.disagrees:
                x = places.index((ranking.map, ranking.dataset))
                axes.axvspan(x - 0.5, x + 0.5, color=PALETTE["false"], alpha=0.15, linewidth=0)
        for index, algorithm in enumerate(comparison.algorithms):
            values = {
                (run.map, run.dataset): run.weighted[column]
                for run in runs
                if run.algorithm == algorithm
            }
            _draw_per_map(axes, places, values, index)
        axes.set_xticks(range(len(places)), [dataset for _, dataset in places], rotation=90)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        axes.set_xlim(-0.5, len(places) - 0.5)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(f"{HEADINGS[column]} [m]")

    return figure_svg(size_in, draw, f"{HEADINGS[column]} data set by data set")


def _draw_per_map(
    axes: Axes,
    places: list[tuple[str, str]],
    values: dict[tuple[str, str], float | None],
    index: int,
) -> None:
    """One algorithm: runs of one map are joined, maps are not."""
    for name_of_map, own in groupby(enumerate(places), key=lambda item: item[1][0]):
        x, keys = zip(*own, strict=True)
        numbers = [values.get(key) for key in keys]
        axes.plot(
            x,
            [np.nan if number is None else number for number in numbers],
            color=series_colour(index),
            linestyle=series_dash(index),
            linewidth=1.0,
            marker=ALGORITHM_MARKERS[index % len(ALGORITHM_MARKERS)],
            markersize=3.6,
        )
        if index == 0:
            axes.axvline(x[-1] + 0.5, color=PALETTE["muted"], linewidth=0.6)
            axes.annotate(
                name_of_map,
                (x[0] - 0.35, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3),
                textcoords="offset points",
                fontsize=FONT_PT,
            )


def correlation_svg(comparison: Comparison) -> str:
    """Total against pose error, a mark per run: colour by algorithm, shape by map."""
    runs = [run for run in comparison.runs if not run.missing]
    maps = list(dict.fromkeys(run.map for run in runs))

    def draw(axes: Axes) -> None:
        for run in runs:
            index = comparison.algorithms.index(run.algorithm)
            axes.plot(
                [run.weighted["pose"] or np.nan],
                [run.weighted["total"] or np.nan],
                GROUP_MARKERS[maps.index(run.map) % len(GROUP_MARKERS)],
                color=series_colour(index),
                markersize=4.5,
                alpha=0.85,
                markeredgewidth=0,
            )
        for place, name_of_map in enumerate(maps):
            marker = GROUP_MARKERS[place % len(GROUP_MARKERS)]
            axes.plot([], [], marker, color=INK, markersize=4.5, label=name_of_map)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False)
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("pose error [m]")
        axes.set_ylabel("Total [m]")

    return figure_svg(CORRELATION_SIZE_IN, draw, "Total against pose error of every run")
