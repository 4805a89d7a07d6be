"""Figures that can live in a page."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

from dialogue.pages import PALETTE, figure_svg, series_colour, series_dash

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(axes: Axes) -> None:
    axes.plot([0.0, 1.0, 0.5], [0.0, 1 / 3, 2 / 3], color=series_colour(0))
    axes.plot([0.2], [0.2], marker="o", color="#000000")
    axes.set_xlabel("kept: 0.123456 #000000")


def test_it_is_well_formed_and_fills_its_place() -> None:
    root = ET.fromstring(figure_svg((4.0, 2.0), draw, "a <figure>"))
    assert root.tag == "svg"
    assert root.get("viewBox") == "0 0 288 144"
    assert root.get("aria-label") == "a <figure>"
    assert root.get("width") is None


def test_colours_are_those_of_the_page() -> None:
    svg = figure_svg((4.0, 2.0), draw, "x")
    assert "stroke: var(--series1)" in svg
    assert "currentColor" in svg
    assert not any(code in svg for code in PALETTE.values())


def test_text_stays_as_it_was_written() -> None:
    assert "kept: 0.123456 #000000</text>" in figure_svg((4.0, 2.0), draw, "x")


def test_nothing_points_outside() -> None:
    svg = figure_svg((4.0, 2.0), draw, "x")
    assert "http" not in svg
    assert "<metadata" not in svg
    assert "<style" not in svg
    assert set(re.findall(r'href="(.)', svg)) == {"#"}


def test_references_lead_somewhere_and_ids_stand_once() -> None:
    svg = figure_svg((4.0, 2.0), draw, "x")
    ids = re.findall(r' id="([^"]+)"', svg)
    assert len(set(ids)) == len(ids)
    assert set(re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', svg)) != set()
    for pair in re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', svg):
        assert (pair[0] or pair[1]) in ids


def test_the_same_figure_has_the_same_bytes() -> None:
    first, again = (figure_svg((4.0, 2.0), draw, "x") for _ in "ab")
    assert first == again


def test_sixteen_estimates_look_different() -> None:
    looks = {(series_colour(i), str(series_dash(i))) for i in range(16)}
    assert len(looks) == 16
