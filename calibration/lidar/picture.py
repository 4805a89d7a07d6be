"""Cones as the lidar saw them: by the mounting before, by the calibrated one, and the truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.lidar.calibrate import LidarResult
from geometry import Floats, compose, transform_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BEFORE, _AFTER = "#d55e00", "#0072b2"
REACH_M = 0.35


def write_lidar_picture(file: Path, result: LidarResult) -> None:
    """A PNG: the floor on the left; on the right every cone laid over one point, enlarged."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 5.8), layout="constrained")
    FigureCanvasAgg(figure)
    floor, cone = figure.subplots(1, 2)
    for word, colour, mounting, late_s in (
        ("before", _BEFORE, result.before, 0.0),
        ("calibrated", _AFTER, result.mounting, result.late_s),
    ):
        _draw(floor, cone, result, mounting, late_s, colour, word)
    for one in result.seen:
        floor.plot(*one.path.positions.T, color="#999999", linewidth=1.0)
        floor.plot(*one.cones.positions.T, "k+", markersize=11)
    cone.plot(0.0, 0.0, "k+", markersize=16)
    for axes, unit in ((floor, "m"), (cone, "mm")):
        axes.set_aspect("equal")
        axes.set_xlabel(f"x [{unit}]")
        axes.set_ylabel(f"y [{unit}]")
        axes.legend(loc="best")
    cone.set_title("detections around their cones")
    told, word = result.calibration.residuals, "rejected"
    if result.calibration.accepted:
        word = "accepted"
    figure.suptitle(
        f"lidar, {word}: left over {1e3 * told['range_rms_m']:.1f} mm in range, "
        f"{np.degrees(told['bearing_rms_rad']):.2f} deg in bearing (rms)"
    )
    figure.savefig(file, dpi=110)


def _draw(
    floor: Axes,
    cone: Axes,
    result: LidarResult,
    mounting: Floats,
    late_s: float,
    colour: str,
    word: str,
) -> None:
    label = word
    for one, which in zip(result.seen, result.cones, strict=True):
        world = transform_points(compose(one.poses(late_s), mounting), one.points)
        floor.plot(*world.T, ".", markersize=2.0, color=colour, label=label)
        known = which >= 0
        off = 1e3 * (world[known] - one.cones.positions[which[known]])
        cone.plot(*off.T, ".", markersize=3.0, color=colour, label=label)
        label = "_" + word
    cone.set_xlim(-1e3 * REACH_M, 1e3 * REACH_M)
    cone.set_ylim(-1e3 * REACH_M, 1e3 * REACH_M)
