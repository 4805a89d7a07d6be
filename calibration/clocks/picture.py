"""`join.png`: the car's sensors over the film after the fit, what is left, and the search."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.clocks.clock_fit import ClockFit, Seen
from calibration.clocks.level_fit import LevelFit
from calibration.clocks.motion import Source
from geometry import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP_S = 0.2
_FILM, _CAR, _LEFT, _PEAK = "#1b1c1e", "#0072b2", "#d55e00", "#009e73"
_UNITS: dict[Source, tuple[str, float, str, float, str]] = {
    "gyro": ("heading [deg]", math.degrees(1.0), "left over [deg]", math.degrees(1.0), "deg/s"),
    "wheels": ("travelled [m]", 1.0, "left over [mm]", 1e3, "m/s"),
}


def write_join_picture(file: Path, fit: ClockFit, title: str) -> None:
    """A PNG with a column for each sensor: level, residual, rate, correlation."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [one for one in fit.sources if one.fit is not None]
    figure = Figure(figsize=(7.0 * len(shown), 10.5), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(4, len(shown), squeeze=False)
    for column, seen in enumerate(shown):
        assert seen.fit is not None
        _draw_level(grid[0, column], seen.fit, "alone" if seen.is_used else "not used")
        _draw_residual(grid[1, column], seen.fit)
        _draw_rate(grid[2, column], seen.fit)
        _draw_correlation(grid[3, column], seen)
    figure.suptitle(
        f"{title}: offset {fit.offset_s:+.4f} s, sigma {1e3 * fit.sigma_s:.2f} ms, "
        f"skew {1e6 * fit.skew:+.0f} ppm, {'good' if fit.good else 'refused'}"
    )
    figure.savefig(file, dpi=100)


def _draw_level(axes: Axes, fit: LevelFit, word: str) -> None:
    name, unit, *_ = _UNITS[fit.source]
    axes.plot(fit.t_s, unit * fit.filmed, ".", color=_FILM, markersize=3.5, label="film")
    told = _torn(fit, unit * (fit.filmed - fit.residual))
    axes.plot(fit.t_s, told, color=_CAR, linewidth=1.2, label=f"{fit.source}, fitted")
    axes.set_ylabel(name)
    axes.set_title(
        f"{fit.source} {word}: {1e3 * fit.sigma_offset_s:.2f} ms, scale {fit.scale[0]:.4f}",
        fontsize=10,
    )
    axes.legend(fontsize=8, frameon=False)


def _draw_residual(axes: Axes, fit: LevelFit) -> None:
    *_, name, unit, _ = _UNITS[fit.source]
    axes.axhline(0.0, color="#cccccc", linewidth=0.8)
    axes.plot(fit.t_s, unit * fit.residual, ".", color=_LEFT, markersize=3.0)
    rms = unit * fit.residual_rms
    axes.set_ylabel(name)
    axes.set_title(f"film minus {fit.source}: {rms:.3g} rms", fontsize=10)


def _draw_rate(axes: Axes, fit: LevelFit) -> None:
    *_, unit = _UNITS[fit.source]
    scale = math.degrees(1.0) if fit.source == "gyro" else 1.0
    axes.plot(fit.t_s, _torn(fit, scale * fit.rate), color=_CAR, linewidth=1.0, label=fit.source)
    filmed = np.gradient(fit.filmed, fit.t_s)
    gap = np.diff(fit.t_s) > GAP_S
    filmed[1:][gap] = filmed[:-1][gap] = np.nan
    axes.plot(fit.t_s, scale * filmed, ".", color=_FILM, markersize=2.0, label="film, step by step")
    axes.set_ylabel("turn rate [deg/s]" if fit.source == "gyro" else f"speed [{unit}]")
    axes.set_xlabel("time of the film [s]")
    axes.legend(fontsize=8, frameon=False)


def _torn(fit: LevelFit, values: Floats) -> Floats:
    """The values with holes, so that no line is drawn over a gap of the film."""
    torn = values.copy()
    torn[1:][np.diff(fit.t_s) > GAP_S] = np.nan
    return torn


def _draw_correlation(axes: Axes, seen: Seen) -> None:
    found = seen.correlation
    if found is None:
        axes.set_axis_off()
        return
    lag_s = found.lag_s - found.best_lag_s
    axes.plot(lag_s, found.value, color=_CAR, linewidth=0.9)
    axes.plot(0.0, found.best, "o", color=_PEAK, markersize=6)
    axes.axhline(found.second, color=_LEFT, linewidth=0.8, linestyle=":")
    axes.set_ylim(-1.05, 1.05)
    axes.set_ylabel("correlation")
    axes.set_xlabel("offset from the peak [s]")
    axes.set_title(f"peak {found.best:.4f}, next {found.second:.3f} (dotted)", fontsize=10)
