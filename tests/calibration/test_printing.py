from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from calibration import CharucoBoard, RingGrid
from calibration.pdf import POINTS_PER_MM, Page, pdf_bytes
from calibration.printed import marker_page
from calibration.printing import charuco_page, ring_grid_page, ring_page
from dialogue import TracksideError, UsageError
from geometry import Floats, RingShape
from tracking import Image, find_rings
from trackside.cli import trackside

DOTS_PER_MM = 6.0


def discs(page: Page) -> Floats:
    """x, y, diameter in mm and grey of every filled circle, read from the content stream."""
    found = []
    for grey, path in re.findall(r"([\d.]+) g\n([\d.\s]+ m\n(?:[\d.\s-]+ c\n)+)f", page.content):
        numbers = np.array([float(word) for word in re.findall(r"-?[\d.]+", path)])
        on_edge = np.concatenate([numbers[:2], numbers[2:].reshape(-1, 3, 2)[:, 2].ravel()])
        edge = on_edge.reshape(-1, 2)[:-1] / POINTS_PER_MM
        middle = edge.mean(axis=0)
        radii = np.linalg.norm(edge - middle, axis=1)
        np.testing.assert_allclose(radii, radii[0], rtol=1e-4)
        found.append([*middle, 2.0 * radii[0], float(grey)])
    return np.array(found)


def bars(page: Page) -> Floats:
    """x, y, width, height in mm and grey of every rectangle."""
    found = re.findall(r"([\d.]+) g ([\d. ]+) re f", page.content)
    numbers = [[*map(float, box.split())] for _, box in found]
    greys = np.array([[float(grey)] for grey, _ in found])
    return np.hstack([np.array(numbers) / POINTS_PER_MM, greys])


def printed(page: Page) -> Image:
    """The sheet as a scanner would see it."""
    shape = (round(page.height_mm * DOTS_PER_MM), round(page.width_mm * DOTS_PER_MM))
    sheet = np.full(shape, 255.0)
    rows, columns = np.indices(shape)
    x, y = (columns + 0.5) / DOTS_PER_MM, page.height_mm - (rows + 0.5) / DOTS_PER_MM
    for left, low, width, height, grey in bars(page):
        inside = (x >= left) & (x < left + width) & (y >= low) & (y < low + height)
        sheet[inside] = 255.0 * grey
    for middle_x, middle_y, diameter, grey in discs(page) if " c\n" in page.content else []:
        sheet[np.hypot(x - middle_x, y - middle_y) < diameter / 2.0] = 255.0 * grey
    return sheet.astype(np.uint8)


def test_a_ring_is_true_to_size_and_in_the_middle() -> None:
    page = ring_page(RingShape(), "A4")
    outer, inner = discs(page)
    assert outer[2] == pytest.approx(122.0, abs=0.001)
    assert inner[2] == pytest.approx(50.0, abs=0.001)
    np.testing.assert_allclose(outer[:2], inner[:2], atol=0.001)
    assert outer[0] == pytest.approx(105.0, abs=0.001)
    assert (outer[3], inner[3]) == (0.0, 1.0)


def test_the_ruler_is_100_mm() -> None:
    page = ring_page(RingShape(), "A4")
    widest = max(bars(page).tolist(), key=lambda bar: bar[2])
    assert widest[2] == pytest.approx(100.0, abs=0.001)


def test_the_printed_ring_is_a_ring_to_our_eyes() -> None:
    seen = find_rings(printed(ring_page(RingShape(0.03, 0.0123), "A4")))
    assert len(seen) == 1
    np.testing.assert_allclose(seen.diameters_px / DOTS_PER_MM, 30.0, atol=0.05)


def test_the_printed_charuco_board_is_the_one_that_is_looked_for() -> None:
    board = CharucoBoard()
    page = charuco_page(board, "A4")
    found = board.find(printed(page), "sheet")
    assert found is not None
    assert len(found.pixels) == 9 * 6
    # A plane's similarity: the same scale everywhere is the size being true.
    apart_px = np.linalg.norm(found.pixels - found.pixels[0], axis=1)
    apart_m = np.linalg.norm(found.points_m - found.points_m[0], axis=1)
    np.testing.assert_allclose(apart_px / DOTS_PER_MM, 1e3 * apart_m, atol=0.15)


def test_the_printed_ring_grid_is_the_one_that_is_looked_for() -> None:
    grid = RingGrid()
    page = ring_grid_page(grid, "A4")
    middles = discs(page)[::2]
    assert len(middles) == 24
    assert middles[1, 0] - middles[0, 0] == pytest.approx(45.0, abs=0.001)
    found = grid.find(printed(page), "sheet")
    assert found is not None
    np.testing.assert_allclose(np.ptp(found.pixels, axis=0) / DOTS_PER_MM, [225.0, 135.0], atol=0.1)


def test_the_file_is_a_pdf_whose_table_points_at_its_objects() -> None:
    page = ring_page(RingShape(), "A4")
    data = pdf_bytes([page, page])
    assert data.startswith(b"%PDF-1.4")
    (start,) = re.findall(rb"startxref\n(\d+)\n%%EOF\n$", data)
    assert data[int(start) :].startswith(b"xref\n0 8\n")
    places = [int(line[:10]) for line in data[int(start) :].splitlines()[3:10]]
    for number, place in enumerate(places, start=1):
        assert data[place:].startswith(b"%d 0 obj\n" % number)
    assert b"/MediaBox [0 0 595.2756 841.8898]" in data
    for length, body in re.findall(rb"/Length (\d+) >>\nstream\n(.*?)\nendstream", data, re.DOTALL):
        assert int(length) == len(body)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(UsageError, match=r"does not fit on A4.*it fits on A3"):
        ring_page(RingShape(0.2, 0.08), "A4")
    with pytest.raises(UsageError, match="make it smaller"):
        ring_page(RingShape(2.0, 0.8), "A4")
    with pytest.raises(UsageError, match="no paper 'A7'"):
        ring_page(RingShape(), "A7")
    with pytest.raises(UsageError, match="belong to boards"):
        marker_page("ring", "A4", square_m=0.03)
    with pytest.raises(TracksideError, match="swapped"):
        marker_page("ring", "A4", 0.05, 0.122)


def test_the_command_writes_it(tmp_path: Path) -> None:
    file = tmp_path / "markers.pdf"
    words = ["markers", "--diameter", "122mm", "--paper", "A4", "--copies", "3", "-o", str(file)]
    trackside.main(args=words, standalone_mode=False)
    assert file.read_bytes().count(b"/Type /Page ") == 3
    for kind in ("charuco", "rings"):
        words = ["markers", "--kind", kind, "-o", str(tmp_path / f"{kind}.pdf")]
        trackside.main(args=words, standalone_mode=False)
