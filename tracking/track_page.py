"""`track.html`: the path over a frame of the scene, residuals and gaps; one file, no address."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from dialogue import Cell, Table
from dialogue.pages import PALETTE, figure_svg, render, series_colour, view
from geometry import Floats
from tracking.ground_truth import TrackResult
from tracking.preview import Picture
from tracking.verdict import Judgement

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TEMPLATE = Path(__file__).parent / "templates" / "track.html"
_POINTS = 2000
_SIZE_IN = (4.8, 2.1)
_CAR, _STAND, _GAP = series_colour(0), series_colour(1), PALETTE["false"]


def track_page(title: str, result: TrackResult, picture: Picture) -> str:
    """The page as text."""
    import cv2

    _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])
    return render(
        _TEMPLATE,
        title=title,
        subtitle="",
        judgement=result.judgement,
        picture=base64.b64encode(jpeg.tobytes()).decode("ascii"),
        figures=_figures(result),
        facts=view(Table(("what", "value"), tuple(facts(result.judgement)), title="The film")),
        cones=view(_cones(result)),
    )


def facts(judgement: Judgement) -> list[tuple[str, str]]:
    """What a summary says, by name."""
    apart = f"{1e3 * judgement.span_mean_m:.2f} mm, scatter {1e3 * judgement.span_rms_m:.2f} mm"
    return [
        ("frames", f"{judgement.frames}, {judgement.damaged} of them left out"),
        ("coverage", f"{100 * judgement.coverage:.2f} %"),
        ("longest gap", f"{judgement.longest_gap_s:.3f} s"),
        ("bridged poses", f"{judgement.bridged}"),
        ("edges of the car's rings around their fit", f"{judgement.residual_px:.3f} px"),
        ("rings that stand around their places", f"{judgement.standing_px:.3f} px"),
        ("the car's rings apart", apart),
    ]


def _cones(result: TrackResult) -> Table:
    cones = result.truth.landmarks
    assert cones is not None
    assert cones.covariances is not None or not len(cones)
    rows: list[tuple[Cell, ...]] = []
    for k, number in enumerate(cones.ids.tolist()):
        x, y = cones.positions[k].tolist()
        spread = np.zeros((2, 2)) if cones.covariances is None else cones.covariances[k]
        sigma_mm = 1e3 * float(np.sqrt(np.trace(spread)))
        rows.append((number, x, y, sigma_mm))
    columns = ("cone", "x [m]", "y [m]", "sigma [mm]")
    return Table(columns, tuple(rows), title="Cones", digits=4)


def _figures(result: TrackResult) -> list[dict[str, str]]:
    return [
        {
            "svg": _over_time(lambda axes: _draw_residuals(axes, result), "Residuals over time"),
            "caption": "Scatter of the edges around the fit: of the car's rings and of those that "
            "stand. Orange: frames in which the car was not seen.",
        },
        {
            "svg": _over_time(lambda axes: _draw_span(axes, result), "Distance of the rings"),
            "caption": "How far apart the car's rings come out. A slope over the track means a "
            "wrong height or a wrong calibration.",
        },
        {
            "svg": _over_time(lambda axes: _draw_sigma(axes, result), "Standard deviation"),
            "caption": "Standard deviation of the position of base_link, calibration included.",
        },
    ]


def _over_time(draw: Callable[[Axes], None], description: str) -> str:
    def draw_with_time(axes: Axes) -> None:
        draw(axes)
        axes.set_xlabel("time [s]")

    return figure_svg(_SIZE_IN, draw_with_time, description)


def _draw_residuals(axes: Axes, result: TrackResult) -> None:
    t_s, scatter = _since_start(result), result.tracks.scatter_px
    keep = _thinned(len(t_s))
    both = result.tracks.seen[:, -2:].all(axis=1)
    standing = np.where(result.tracks.seen[:, :-2], scatter[:, :-2], np.nan)
    some = result.tracks.seen[:, :-2].any(axis=1)
    typical = np.full(len(t_s), np.nan)
    typical[some] = np.nanmedian(standing[some], axis=1)
    car = np.where(both, scatter[:, -2:].mean(axis=1), np.nan)
    axes.plot(t_s[keep], typical[keep], color=_STAND, linewidth=0.9, label="rings that stand")
    axes.plot(t_s[keep], car[keep], color=_CAR, linewidth=0.9, label="the car's rings")
    _shade_gaps(axes, t_s, np.asarray(both))
    axes.set_ylabel("residual [px]")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8, frameon=False)


def _draw_span(axes: Axes, result: TrackResult) -> None:
    both = result.tracks.seen[:, -2:].all(axis=1)
    _plot_known(axes, _since_start(result), np.flatnonzero(both), 1e3 * result.span_m)
    # Tenths of a millimetre around 200: whole numbers on the axis, not an offset above it.
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_ylabel("distance [mm]")


def _draw_sigma(axes: Axes, result: TrackResult) -> None:
    covariances = result.truth.path_covariances
    assert covariances is not None
    sigma_mm = 1e3 * np.sqrt(covariances[:, 0, 0] + covariances[:, 1, 1])
    _plot_known(axes, _since_start(result), result.rows, sigma_mm)
    axes.set_ylabel("sigma [mm]")
    axes.set_ylim(bottom=0.0)


def _plot_known(axes: Axes, t_s: Floats, rows: npt.NDArray[np.integer], values: Floats) -> None:
    """A line through the frames `rows` (k,), with gaps where there is no value (k,)."""
    whole = np.full(len(t_s), np.nan)
    whole[rows] = values
    keep = _thinned(len(t_s))
    axes.plot(t_s[keep], whole[keep], color=_CAR, linewidth=0.9)


def _shade_gaps(axes: Axes, t_s: Floats, both: npt.NDArray[np.bool_]) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~both).astype(int), [0]])))
    for first, last in edges.reshape(-1, 2).tolist():
        axes.axvspan(t_s[max(first - 1, 0)], t_s[min(last, len(t_s) - 1)], color=_GAP, alpha=0.35)


def _since_start(result: TrackResult) -> Floats:
    t_ns = result.tracks.t_ns
    return np.asarray((t_ns - t_ns[0]) * 1e-9)


def _thinned(count: int) -> slice:
    """A page need not hold more points than a screen shows."""
    return slice(None, None, max(1, count // _POINTS))
