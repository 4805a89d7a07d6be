"""How far windows went sideways, by how much they turned, and where the rings are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibration.lever.calibrate import LeverResult

_BEFORE, _AFTER = "#d55e00", "#0072b2"


def write_lever_picture(file: Path, result: LeverResult) -> None:
    """A PNG: a lever arm that is wrong shows as a slope on the left."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    turn = np.degrees(np.concatenate([drive.turn_rad for drive in result.drives]))
    left.plot(turn, 1e3 * result.sideways_before_m, ".", color=_BEFORE, label="as assumed")
    left.plot(turn, 1e3 * result.sideways_m, ".", color=_AFTER, label="calibrated")
    left.set_xlabel("turn of each window [deg]")
    left.set_ylabel("base_link went sideways [mm]")
    left.legend(loc="best")
    rings = result.rings
    half, side = 0.5 * rings.span_m, rings.side_m
    middle = 0.5 * (rings.front_x_m + rings.rear_x_m)
    along = np.array([np.cos(rings.yaw_rad), np.sin(rings.yaw_rad)])
    ends = np.array([middle, side]) + np.outer([-half, half], along)
    right.plot(*(1e3 * ends).T, "o-", color=_AFTER, markersize=9, label="rings, rear and front")
    right.plot(0.0, 0.0, "k+", markersize=14, label="base_link")
    right.axhline(0.0, color="#999999", linewidth=0.8)
    right.set_ylim(-60.0, 60.0)
    right.set_xlabel("x, forward [mm]")
    right.set_ylabel("y, left [mm] (drawn larger)")
    right.legend(loc="best")
    told, word = result.calibration.residuals, "rejected"
    if result.calibration.accepted:
        word = "accepted"
    figure.suptitle(
        f"rings on the car, {word}: sideways {1e3 * told['sideways_rms_before_m']:.2f} mm before, "
        f"{1e3 * told['sideways_rms_m']:.2f} mm after (rms of a window)"
    )
    figure.savefig(file, dpi=110)
