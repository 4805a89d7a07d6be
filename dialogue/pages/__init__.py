"""Pages to look at: one HTML file each that needs nothing else, light, dark, on paper and a phone.

The head, the style and the pieces that pages share; a room brings the template of its own page.
"""

from dialogue.pages.figures import (
    FONT_PT,
    INK,
    PALETTE,
    SERIES,
    figure_svg,
    series_colour,
    series_dash,
)
from dialogue.pages.filling import UNDEFINED, number, render, view

__all__ = [
    "FONT_PT",
    "INK",
    "PALETTE",
    "SERIES",
    "UNDEFINED",
    "figure_svg",
    "number",
    "render",
    "series_colour",
    "series_dash",
    "view",
]
