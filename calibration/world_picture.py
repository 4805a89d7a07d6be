"""A floor's calibration to judge at a glance: which ring is which, residuals, accuracy."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.world import WorldResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARK, _ARROW = "#d55e00", "#0072b2"


def write_world_picture(file: Path, result: WorldResult) -> None:
    """A PNG: the picture with every marker named and the axes, and the map of accuracy."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    seen, floor = figure.subplots(1, 2, width_ratios=(8, 5))
    _draw_picture(seen, result)
    _draw_floor(floor, result)
    told, word = result.calibration.accuracy_m, "rejected"
    if result.calibration.accepted:
        word = "accepted"
    figure.suptitle(
        f"{word}: predicted {1e3 * told['floor_rms']:.1f} mm rms on the floor, "
        f"{1e3 * told['car_rms']:.1f} mm at the car's height"
    )
    figure.savefig(file, dpi=110)


def _draw_picture(axes: Axes, result: WorldResult) -> None:
    axes.imshow(result.rings.image, cmap="gray", vmin=0, vmax=255)
    axes.plot(*result.rings.centres_px.T, "x", color="white", markersize=5.0)
    for name, place in zip(result.names, result.centres_px, strict=True):
        axes.plot(*place, "o", markersize=14.0, markerfacecolor="none", color=_MARK)
        axes.annotate(name, place, (9.0, 9.0), textcoords="offset points", color=_MARK)
    corners = result.fit.xy[:4]
    reach = 0.3 * float(np.hypot(*corners[1]))
    ends = np.array([[0.0, 0, 0], [reach, 0, 0], [0, reach, 0], [0, 0, reach]])
    origin, *tips = result.calibration.view.project(ends)
    for axis, tip in zip("xyz", tips, strict=True):
        axes.annotate("", tip, origin, arrowprops={"arrowstyle": "->", "color": _ARROW, "lw": 2})
        axes.annotate(axis, tip, color=_ARROW, fontsize=12)
    axes.set_axis_off()


def _draw_floor(axes: Axes, result: WorldResult) -> None:
    drawn = axes.tricontourf(
        result.grid[:, 0], result.grid[:, 1], 1e3 * result.sigma_m, levels=12, cmap="viridis"
    )
    axes.figure.colorbar(drawn, ax=axes, label="predicted sigma [mm]", shrink=0.8)
    for name, place in zip(result.names, result.fit.xy, strict=True):
        axes.plot(*place, "o", color=_MARK)
        axes.annotate(name, place, (6.0, 6.0), textcoords="offset points", color=_MARK)
    place = dict(zip(result.names, result.fit.xy, strict=True))
    for length in result.calibration.lengths:
        ends = np.array([place[name] for name in length.markers])
        axes.plot(*ends.T, color="white", linewidth=0.8)
        axes.annotate(
            f"{1e3 * length.residual_m:+.1f}", ends.mean(axis=0), color="white", ha="center"
        )
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]; lengths: fitted minus measured [mm]")
