"""The paths by the old and the new calibration over the truth, and what is left over."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibration.odometry.result import OdometryResult

_TRUTH, _OLD, _NEW = "#555555", "#d55e00", "#0072b2"


def write_odometry_picture(file: Path, result: OdometryResult) -> None:
    """A PNG: before and after over the truth on the left, the residuals of the fit on the right."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    floor, left = figure.subplots(1, 2, width_ratios=(6, 5))
    for k, drive in enumerate(result.drives):
        word = "" if k == 0 else "_"
        floor.plot(*drive.xy.T, color=_TRUTH, linewidth=3.5, alpha=0.45, label=word + "truth")
        if result.paths_before is not None and result.paths_after is not None:
            floor.plot(*result.paths_before[k].T, "--", color=_OLD, label=word + "before")
            floor.plot(*result.paths_after[k].T, color=_NEW, linewidth=1.2, label=word + "after")
    floor.set_aspect("equal")
    floor.set_xlabel("x [m]")
    floor.set_ylabel("y [m]")
    floor.legend(loc="best")
    windows = sum(len(drive.pairs) for drive in result.drives)
    left.plot(1e3 * result.fit.residuals[:windows], ".", color=_NEW, label="distance [mm]")
    turns = result.fit.residuals[windows:]
    if turns.size:
        left.plot(np.degrees(turns) * 10.0, ".", color=_OLD, label="turn [0.1 deg]")
    left.set_xlabel("window")
    left.set_title("left over in each window")
    left.legend(loc="best")
    told, word = result.calibration.residuals, "rejected"
    if result.calibration.accepted:
        word = "accepted"
    off = ""
    if "path_rms_m" in told:
        off = (
            f": counts and commands alone are {1e3 * told['path_rms_before_m']:.0f} mm off before, "
            f"{1e3 * told['path_rms_m']:.0f} mm after (rms)"
        )
    figure.suptitle(f"odometry, {word}{off}")
    figure.savefig(file, dpi=110)
