"""The Allan deviation with its lines, the bias over time, and the compass before and after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calibration.imu.allan import FLOOR
from calibration.imu.calibrate import AXES, ImuResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = ("#0072b2", "#d55e00", "#009e73")


def write_imu_picture(file: Path, result: ImuResult) -> None:
    """A PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = 2 if result.ellipsoid is None else 3
    figure = Figure(figsize=(5.4 * panels, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, panels)
    _draw_allan(axes[0], result, 0, "gyro [rad/s]")
    _draw_allan(axes[1], result, 3, "accelerometer [m/s^2]")
    if result.ellipsoid is not None:
        _draw_compass(axes[2], result)
    word = "accepted" if result.calibration.accepted else "rejected"
    bias = ", ".join(f"{np.degrees(value):.3f}" for value in result.still.mean[:3].tolist())
    scale = result.calibration.value("gyro_scale")
    told = "" if scale is None else f", scale {scale:.4f}"
    figure.suptitle(
        f"IMU, {word}: bias {bias} deg/s over {result.still.seconds:.1f} s of rest{told}, "
        f"{result.still.glitches} glitches left out"
    )
    figure.savefig(file, dpi=110)


def _draw_allan(axes: Axes, result: ImuResult, first: int, what: str) -> None:
    tau = result.tau_s
    if not tau.size:
        axes.set_title(f"{what}: too short for an Allan deviation")
        return
    for k, colour in enumerate(_COLOURS):
        noise = result.noise[first + k]
        axes.loglog(tau, result.deviation[:, first + k], color=colour, label=AXES[k])
        axes.loglog(tau, noise.white / np.sqrt(tau), ":", color=colour, linewidth=0.9)
        if noise.instability is not None:
            axes.axhline(FLOOR * noise.instability, color=colour, linewidth=0.8, linestyle="--")
        if noise.walk is not None:
            axes.loglog(tau, noise.walk * np.sqrt(tau / 3.0), "-.", color=colour, linewidth=0.8)
    axes.set_title(f"overlapping Allan deviation, {what}")
    axes.set_xlabel("tau [s]; dotted: white, dashed: instability, dash-dot: walk")
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend(loc="best")


def _draw_compass(axes: Axes, result: ImuResult) -> None:
    assert result.ellipsoid is not None
    assert result.field_t is not None
    known = result.ellipsoid
    k = len(known.hard_iron_t)
    corrected = (result.field_t[:, :k] - known.hard_iron_t) @ known.soft_iron
    axes.plot(*(1e6 * result.field_t[:, :2]).T, ".", markersize=2, color=_COLOURS[1], label="read")
    axes.plot(*(1e6 * corrected[:, :2]).T, ".", markersize=2, color=_COLOURS[0], label="corrected")
    axes.set_aspect("equal")
    axes.set_xlabel("x [uT]")
    axes.set_ylabel("y [uT]")
    axes.set_title("compass")
    axes.legend(loc="best")
