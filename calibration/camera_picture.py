"""Where the board was seen and how far off each point is, as a picture to judge at a glance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.camera import CELLS, CameraResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle

_EXAGGERATION = 100.0
_USED, _LEFT_OUT, _EMPTY = "#0072b2", "#d55e00", "#f3d9cc"


def write_camera_picture(file: Path, result: CameraResult) -> None:
    """A PNG: points coloured by residual over the cells covered, and a bar for each view."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    calibration = result.calibration
    figure = Figure(figsize=(12.0, 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    seen, bars = figure.subplots(1, 2, width_ratios=(3, 2))
    _draw_points(seen, result)
    _draw_views(bars, result)
    word = "accepted" if calibration.accepted else "rejected"
    figure.suptitle(
        f"{word}: {calibration.rms_px:.3f} px rms, {100 * calibration.coverage:.0f} % covered"
    )
    figure.savefig(file, dpi=110)


def _draw_points(axes: Axes, result: CameraResult) -> None:
    camera = result.calibration.camera
    wide, high = camera.width_px / CELLS[0], camera.height_px / CELLS[1]
    for row, column in zip(*np.nonzero(result.cells == 0), strict=True):
        corner = (column * wide - 0.5, row * high - 0.5)
        axes.add_patch(_patch(corner, wide, high))
    points = np.concatenate([one.pixels for one in result.used])
    residuals = np.concatenate(result.fit.residuals)
    size = np.hypot(*residuals.T)
    limit = max(float(np.percentile(size, 98)), 1e-3)
    drawn = axes.scatter(
        points[:, 0], points[:, 1], c=size, s=9.0, vmin=0.0, vmax=limit, cmap="viridis"
    )
    axes.figure.colorbar(drawn, ax=axes, label="residual [px]", shrink=0.8)
    axes.quiver(
        *points.T, *residuals.T, angles="xy", scale_units="xy", scale=1.0 / _EXAGGERATION,
        width=0.0012, color="#444444",
    )  # fmt: skip
    axes.set_xlim(-0.5, camera.width_px - 0.5)
    axes.set_ylim(camera.height_px - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_title(f"points, residuals x {_EXAGGERATION:.0f}; never seen: shaded", fontsize=10)


def _patch(corner: tuple[float, float], wide: float, high: float) -> Rectangle:
    from matplotlib.patches import Rectangle

    return Rectangle(corner, wide, high, facecolor=_EMPTY, edgecolor="none")


def _draw_views(axes: Axes, result: CameraResult) -> None:
    views = result.calibration.views
    places = np.arange(len(views))
    colours = [_USED if view.used else _LEFT_OUT for view in views]
    axes.barh(places, [view.rms_px for view in views], color=colours)
    axes.set_yticks(places, [view.name for view in views], fontsize=7)
    axes.invert_yaxis()
    axes.set_xlabel("rms of a view [px]")
    axes.set_title("views; left out: orange", fontsize=10)
