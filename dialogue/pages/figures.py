"""Figures as SVG that lives in a page: its colours, its font, no address, the same bytes each time.

Colours are drawn as the codes of `PALETTE` and leave as CSS variables, so that one figure serves
light, dark and paper; black leaves as `currentColor`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#000000"

PALETTE: Mapping[str, str] = MappingProxyType(
    {
        "muted": "#707070",
        "grid": "#dedede",
        "truth": "#9a9a9a",
        "series1": "#0072b2",
        "series2": "#009e73",
        "series3": "#c47a00",
        "series4": "#56707f",
        "missed": "#aa3c87",
        "false": "#d55e00",
        "driven": "#2e9e4f",
        "odometry": "#c8102e",
    }
)
"""CSS variable -> code it is drawn with; hues after Okabe & Ito, Color Universal Design, 2008."""

SERIES = tuple(name for name in PALETTE if name.startswith("series"))

DASHES: tuple[str | tuple[int, tuple[float, ...]], ...] = (
    "solid",
    (0, (5.0, 1.6)),
    (0, (1.6, 1.2)),
    (0, (6.0, 1.6, 1.6, 1.6)),
)

FONT_PT = 9.0

_REMOVED = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<!--.*?-->|<metadata>.*?</metadata>|<defs>\s*<style.*?</defs>"
    r"|font-family: [^;\"]*;?|transform=\"rotate\(-0 [^\"]*\"|(?<=<g) id=\"[^\"]*\"",
    re.DOTALL,
)
_TAG = re.compile(r"<[^>]*>")
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_POLYLINE = re.compile(r'd="[ML\d\s.-]*"')
_SPACE = re.compile(r"\s+")


def series_colour(index: int) -> str:
    """The drawing colour of the estimate with this index."""
    return PALETTE[SERIES[index % len(SERIES)]]


def series_dash(index: int) -> str | tuple[int, tuple[float, ...]]:
    """Its line style: colour and dash together stay apart for sixteen estimates."""
    return DASHES[(index + index // len(SERIES)) % len(DASHES)]


def figure_svg(size_in: tuple[float, float], draw: Callable[[Axes], None], description: str) -> str:
    """An `<svg>` element with what `draw` puts on one pair of axes, as wide as its place."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    # Text stays text: it is found, copied, and set in the font of the page.
    with mpl.rc_context(
        {"svg.fonttype": "none", "svg.hashsalt": description, "font.size": FONT_PT}
    ):
        figure = Figure(figsize=size_in, layout="constrained")
        figure.patch.set_visible(False)
        axes = figure.add_subplot()
        _style(axes)
        draw(axes)
        return _inlined(figure, description)


def _style(axes: Axes) -> None:
    axes.patch.set_visible(False)
    axes.set_axisbelow(True)
    axes.grid(True, color=PALETTE["grid"], linewidth=0.6)
    axes.tick_params(color=PALETTE["muted"], length=2.5, width=0.6)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(PALETTE["muted"])
        spine.set_linewidth(0.6)


def _inlined(figure: Figure, description: str) -> str:
    from markupsafe import escape

    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    text = _SPACE.sub(" ", _REMOVED.sub("", out.getvalue())).replace("> <", "><")
    # Only what stands in tags is drawing; the texts between them are the reader's.
    text = _TAG.sub(lambda tag: _compact(tag[0]), text)
    head, body = text.split(">", 1)
    view_box = re.search(r'viewBox="[^"]*"', head)
    assert view_box is not None, "matplotlib writes a viewBox"
    # How large its letters come out is for the style to bound: it knows the figure's inches.
    wide = f'style="--inches: {figure.get_figwidth():.4g}"'
    return f'<svg {view_box[0]} {wide} role="img" aria-label="{escape(description)}">{body.strip()}'


def _compact(tag: str) -> str:
    """A tag with the page's colours, and no more digits and letters than a screen shows."""
    tag = tag.replace("xlink:href", "href").replace(INK, "currentColor")
    for name, code in PALETTE.items():
        tag = tag.replace(code, f"var(--{name})")
    tag = _NUMBER.sub(lambda match: f"{float(match[0]):.2f}".rstrip("0").rstrip("."), tag)
    # After M every further pair is a line.
    return _POLYLINE.sub(lambda path: path[0].replace(" L ", " "), tag)
